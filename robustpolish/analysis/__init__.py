"""Modes, norms, scaling, observability: what a linear system is like."""

from robustpolish.analysis.h2_norm import H2Norm, h2_norm
from robustpolish.analysis.hinf_norm import HinfNorm, hinf_norm

__all__ = ["H2Norm", "HinfNorm", "h2_norm", "hinf_norm"]
