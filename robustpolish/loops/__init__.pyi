from .analysis import (
    LoopAnalysis as LoopAnalysis,
)
from .analysis import (
    MeasuredLoopAnalysis as MeasuredLoopAnalysis,
)
from .analysis import (
    loop_analysis as loop_analysis,
)
from .disk_margins import (
    DiskMargin as DiskMargin,
)
from .loop import (
    Loop as Loop,
)
from .margins import (
    Crossing as Crossing,
)
from .margins import (
    LoopMargins as LoopMargins,
)
from .margins import (
    MarginsAtOnce as MarginsAtOnce,
)
from .performance import (
    Effort as Effort,
)
from .performance import (
    GivenEffort as GivenEffort,
)
from .performance import (
    LoopBandwidth as LoopBandwidth,
)
from .performance import (
    MeasuredSensitivities as MeasuredSensitivities,
)
from .performance import (
    SampleRate as SampleRate,
)
from .performance import (
    Sensitivities as Sensitivities,
)
from .requirements import (
    LoopRequirements as LoopRequirements,
)

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
