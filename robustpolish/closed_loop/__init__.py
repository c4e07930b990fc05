"""Controllers meet disturbances."""

from robustpolish.closed_loop.against_brush import design_against_brush
from robustpolish.closed_loop.brush_design import BrushDesign
from robustpolish.closed_loop.buildable_design import BuildableBrushDesign
from robustpolish.closed_loop.comparison import ControllerComparison, compare_controllers
from robustpolish.closed_loop.force_control import (
    ForceComparison,
    ForceControl,
    PolishingAxis,
    admittance_control,
    compare_force_control,
    height_deviation,
    hinf_force_control,
    impedance_control,
    passive_stiffness,
)
from robustpolish.closed_loop.limits_of_hardware import HardwareLimit
from robustpolish.closed_loop.published_deviations import PUBLISHED_DEVIATIONS
from robustpolish.closed_loop.robustness import check_robustness
from robustpolish.closed_loop.robustness_result import RobustnessCheck
from robustpolish.closed_loop.simulation import simulate
from robustpolish.closed_loop.studies import SampledLoops, monte_carlo
from robustpolish.closed_loop.thesis_comparison import thesis_comparison
from robustpolish.closed_loop.thesis_structures import thesis_structures
from robustpolish.closed_loop.with_brush.comparison import CoupledComparison, compare_coupled
from robustpolish.closed_loop.with_brush.coupled import simulate_coupled
from robustpolish.closed_loop.with_brush.linearization import linearize_with_brush

__all__ = [
    "PUBLISHED_DEVIATIONS",
    "BrushDesign",
    "BuildableBrushDesign",
    "ControllerComparison",
    "CoupledComparison",
    "ForceComparison",
    "ForceControl",
    "HardwareLimit",
    "PolishingAxis",
    "RobustnessCheck",
    "SampledLoops",
    "admittance_control",
    "check_robustness",
    "compare_controllers",
    "compare_coupled",
    "compare_force_control",
    "design_against_brush",
    "height_deviation",
    "hinf_force_control",
    "impedance_control",
    "linearize_with_brush",
    "monte_carlo",
    "passive_stiffness",
    "simulate",
    "simulate_coupled",
    "thesis_comparison",
    "thesis_structures",
]
