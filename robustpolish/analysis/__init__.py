"""Modes, norms, scaling, observability: what a linear system is like."""

from robustpolish.analysis.decoupled_blocks import Block, decoupled_blocks
from robustpolish.analysis.definite import is_positive_definite
from robustpolish.analysis.h2_norm import H2Norm, h2_norm
from robustpolish.analysis.hinf_norm import HinfNorm, hinf_norm
from robustpolish.analysis.lmi import LmiCheck, h2_norm_lmi, hinf_norm_lmi, lyapunov_lmi
from robustpolish.analysis.modes import Mode, Modes, modes
from robustpolish.analysis.pbh import (
    controllability,
    is_detectable,
    is_stabilizable,
    observability,
)
from robustpolish.analysis.pbh_result import Feasibility, ModeTest, PbhTest
from robustpolish.analysis.prescale import Prescaled, prescale
from robustpolish.analysis.scaling import Scaling, scale_system
from robustpolish.analysis.singular_values import singular_values
from robustpolish.analysis.stability import Stability, stability
from robustpolish.analysis.zeros import AxisZero, zeros_on_axis

__all__ = [
    "AxisZero",
    "Block",
    "Feasibility",
    "H2Norm",
    "HinfNorm",
    "LmiCheck",
    "Mode",
    "ModeTest",
    "Modes",
    "PbhTest",
    "Prescaled",
    "Scaling",
    "Stability",
    "controllability",
    "decoupled_blocks",
    "h2_norm",
    "h2_norm_lmi",
    "hinf_norm",
    "hinf_norm_lmi",
    "is_detectable",
    "is_positive_definite",
    "is_stabilizable",
    "lyapunov_lmi",
    "modes",
    "observability",
    "prescale",
    "scale_system",
    "singular_values",
    "stability",
    "zeros_on_axis",
]
