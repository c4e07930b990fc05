"""Modes, norms, scaling, observability: what a linear system is like."""

from robustpolish.analysis.decoupled_blocks import Block, decoupled_blocks
from robustpolish.analysis.h2_norm import H2Norm, h2_norm
from robustpolish.analysis.hinf_norm import HinfNorm, hinf_norm
from robustpolish.analysis.stability import Stability, stability

__all__ = [
    "Block",
    "H2Norm",
    "HinfNorm",
    "Stability",
    "decoupled_blocks",
    "h2_norm",
    "hinf_norm",
    "stability",
]
