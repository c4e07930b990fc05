"""Control of the polishing force: the classical schemes of chapter 3, and H-infinity."""

from robustpolish.closed_loop.force_control.axis import PolishingAxis
from robustpolish.closed_loop.force_control.comparison import (
    ForceComparison,
    compare_force_control,
    height_deviation,
)
from robustpolish.closed_loop.force_control.controllers import (
    ForceControl,
    admittance_control,
    hinf_force_control,
    impedance_control,
    passive_stiffness,
)

__all__ = [
    "ForceComparison",
    "ForceControl",
    "PolishingAxis",
    "admittance_control",
    "compare_force_control",
    "height_deviation",
    "hinf_force_control",
    "impedance_control",
    "passive_stiffness",
]
