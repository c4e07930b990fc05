"""What a loop is like: sensitivities, margins, noise, effort, sampling, and whether to build it."""

from robustpolish.loops.analysis import LoopAnalysis, loop_analysis
from robustpolish.loops.bandwidth import LoopBandwidth
from robustpolish.loops.effort import Effort, GivenEffort
from robustpolish.loops.loop import Loop
from robustpolish.loops.margins.all_loops import MarginsAtOnce
from robustpolish.loops.margins.disk import DiskMargin
from robustpolish.loops.margins.one_loop import Crossing, LoopMargins
from robustpolish.loops.measured.analysis import MeasuredLoopAnalysis, MeasuredSensitivities
from robustpolish.loops.requirements import LoopRequirements
from robustpolish.loops.sampling import SampleRate
from robustpolish.loops.sensitivities import Sensitivities

__all__ = [
    "Crossing",
    "DiskMargin",
    "Effort",
    "GivenEffort",
    "Loop",
    "LoopAnalysis",
    "LoopBandwidth",
    "LoopMargins",
    "LoopRequirements",
    "MarginsAtOnce",
    "MeasuredLoopAnalysis",
    "MeasuredSensitivities",
    "SampleRate",
    "Sensitivities",
    "loop_analysis",
]
