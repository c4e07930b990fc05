"""Robust control design with certificates, for machines with contact."""

from robustpolish.analysis import H2Norm, HinfNorm, h2_norm, hinf_norm
from robustpolish.closed_loop import ControllerComparison, compare_controllers, simulate
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
)
from robustpolish.synthesis import Certificate, Design, certify

__version__ = "0.1.0"

__all__ = [
    "AirBearingParameters",
    "Certificate",
    "ControllerComparison",
    "Design",
    "GeneralizedPlant",
    "H2Norm",
    "HinfNorm",
    "InfeasibleError",
    "InvalidInputError",
    "MissingDependencyError",
    "RobustPolishError",
    "RobustPolishWarning",
    "SolverError",
    "air_bearing",
    "certify",
    "compare_controllers",
    "h2_norm",
    "hinf_norm",
    "simulate",
]
