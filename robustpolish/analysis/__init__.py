"""Modes, norms, scaling, observability: what a linear system is like."""

from robustpolish.analysis.delays.delay_stability import DelayStability, delay_stability
from robustpolish.analysis.delays.delayed_system import DelayedSystem, DelayLine
from robustpolish.analysis.norms.h2_norm import H2Norm, h2_norm
from robustpolish.analysis.norms.hinf_norm import HinfNorm, hinf_norm
from robustpolish.analysis.norms.lmi import LmiCheck, h2_norm_lmi, hinf_norm_lmi, lyapunov_lmi
from robustpolish.analysis.norms.singular_values import singular_values
from robustpolish.analysis.poles.modes import Mode, Modes, modes
from robustpolish.analysis.poles.pbh import (
    controllability,
    is_detectable,
    is_stabilizable,
    observability,
)
from robustpolish.analysis.poles.pbh_result import Feasibility, ModeTest, PbhTest
from robustpolish.analysis.poles.stability import Stability, stability
from robustpolish.analysis.poles.zeros import AxisZero, zeros_on_axis
from robustpolish.analysis.scaling.decoupled_blocks import Block, decoupled_blocks
from robustpolish.analysis.scaling.prescale import Prescaled, prescale
from robustpolish.analysis.scaling.units import Scaling, scale_system
from robustpolish.copies import register
from robustpolish.exact.rational import is_positive_definite

register()  # whatever holds a linear system imports this room

__all__ = [
    "AxisZero",
    "Block",
    "DelayLine",
    "DelayStability",
    "DelayedSystem",
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
    "delay_stability",
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
