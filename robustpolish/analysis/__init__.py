"""Modes, norms, scaling, observability: what a linear system is like."""

from robustpolish.analysis.decoupled_blocks import Block, decoupled_blocks
from robustpolish.analysis.h2_norm import H2Norm, h2_norm
from robustpolish.analysis.hinf_norm import HinfNorm, hinf_norm
from robustpolish.analysis.modes import Mode, Modes, modes
from robustpolish.analysis.pbh import (
    Feasibility,
    ModeTest,
    PbhTest,
    controllability,
    is_detectable,
    is_stabilizable,
    observability,
)
from robustpolish.analysis.scaling import Scaling, scale_system
from robustpolish.analysis.stability import Stability, stability

__all__ = [
    "Block",
    "Feasibility",
    "H2Norm",
    "HinfNorm",
    "Mode",
    "ModeTest",
    "Modes",
    "PbhTest",
    "Scaling",
    "Stability",
    "controllability",
    "decoupled_blocks",
    "h2_norm",
    "hinf_norm",
    "is_detectable",
    "is_stabilizable",
    "modes",
    "observability",
    "scale_system",
    "stability",
]
