"""Controllers meet disturbances."""

from robustpolish.closed_loop.against_brush import design_against_brush
from robustpolish.closed_loop.brush_design import BrushDesign
from robustpolish.closed_loop.buildable_design import BuildableBrushDesign
from robustpolish.closed_loop.comparison import ControllerComparison, compare_controllers
from robustpolish.closed_loop.limits_of_hardware import HardwareLimit
from robustpolish.closed_loop.published_deviations import PUBLISHED_DEVIATIONS
from robustpolish.closed_loop.robustness import check_robustness
from robustpolish.closed_loop.robustness_result import RobustnessCheck
from robustpolish.closed_loop.simulation import simulate
from robustpolish.closed_loop.thesis_comparison import thesis_comparison
from robustpolish.closed_loop.thesis_structures import thesis_structures

__all__ = [
    "PUBLISHED_DEVIATIONS",
    "BrushDesign",
    "BuildableBrushDesign",
    "ControllerComparison",
    "HardwareLimit",
    "RobustnessCheck",
    "check_robustness",
    "compare_controllers",
    "design_against_brush",
    "simulate",
    "thesis_comparison",
    "thesis_structures",
]
