"""Robust control design with certificates, for machines with contact."""

from robustpolish.analysis import (
    H2Norm,
    HinfNorm,
    controllability,
    h2_norm,
    hinf_norm,
    is_detectable,
    is_stabilizable,
    modes,
    observability,
    prescale,
)
from robustpolish.brush import BrushParameters, simulate_brush
from robustpolish.closed_loop import (
    BrushDesign,
    ControllerComparison,
    compare_controllers,
    design_against_brush,
    simulate,
)
from robustpolish.errors import (
    InfeasibleError,
    InvalidInputError,
    MissingDependencyError,
    RobustPolishError,
    RobustPolishWarning,
    SolverError,
)
from robustpolish.models import (
    AirBearingParameters,
    GeneralizedPlant,
    air_bearing,
    linearize,
)
from robustpolish.synthesis import (
    Certificate,
    Design,
    Disk,
    HalfPlane,
    Sector,
    certify,
    given_controller,
    state_feedback,
)

__version__ = "0.1.0"

__all__ = [
    "AirBearingParameters",
    "BrushDesign",
    "BrushParameters",
    "Certificate",
    "ControllerComparison",
    "Design",
    "Disk",
    "GeneralizedPlant",
    "H2Norm",
    "HalfPlane",
    "HinfNorm",
    "InfeasibleError",
    "InvalidInputError",
    "MissingDependencyError",
    "RobustPolishError",
    "RobustPolishWarning",
    "Sector",
    "SolverError",
    "air_bearing",
    "certify",
    "compare_controllers",
    "controllability",
    "design_against_brush",
    "given_controller",
    "h2_norm",
    "hinf_norm",
    "is_detectable",
    "is_stabilizable",
    "linearize",
    "modes",
    "observability",
    "prescale",
    "simulate",
    "simulate_brush",
    "state_feedback",
]
