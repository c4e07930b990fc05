"""Controllers meet disturbances."""

from robustpolish.closed_loop.brush_design import BrushDesign, design_against_brush
from robustpolish.closed_loop.comparison import ControllerComparison, compare_controllers
from robustpolish.closed_loop.published_deviations import PUBLISHED_DEVIATIONS
from robustpolish.closed_loop.robustness import check_robustness
from robustpolish.closed_loop.robustness_result import RobustnessCheck
from robustpolish.closed_loop.simulation import simulate
from robustpolish.closed_loop.thesis_comparison import thesis_comparison
from robustpolish.closed_loop.thesis_structures import thesis_structures

__all__ = [
    "PUBLISHED_DEVIATIONS",
    "BrushDesign",
    "ControllerComparison",
    "RobustnessCheck",
    "check_robustness",
    "compare_controllers",
    "design_against_brush",
    "simulate",
    "thesis_comparison",
    "thesis_structures",
]
