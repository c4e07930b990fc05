from .against_brush import design_against_brush
from .against_thesis import thesis_comparison
from .brush_design import BrushDesign
from .buildable_design import BuildableBrushDesign
from .comparison import ControllerComparison, compare_controllers
from .force_control import (
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
from .limits_of_hardware import HardwareLimit
from .published_deviations import PUBLISHED_DEVIATIONS
from .robustness import check_robustness
from .robustness_result import RobustnessCheck
from .simulation import simulate
from .structures_of_thesis import thesis_structures
from .studies import SampledLoops, monte_carlo
from .with_brush.comparison import CoupledComparison, compare_coupled
from .with_brush.coupled import simulate_coupled
from .with_brush.linearization import linearize_with_brush

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
