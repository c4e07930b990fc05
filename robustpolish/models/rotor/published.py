"""Rotors whose natural frequencies are printed in a book.

Friswell, Penny, Garvey, Lees (2010), Dynamics of rotating machines, Cambridge: examples 5.9.1,
5.9.2, 5.9.5 and 5.9.9, in the digits in which ross (petrobras/ross, ross/tests/test_examples.py)
holds its own results to them.
"""

from __future__ import annotations

import math

from robustpolish.models.rotor.parts import RotorBearing, RotorDisc, ShaftSegment
from robustpolish.models.rotor.rotor import RotorModel

FAST = 4000 * math.pi / 30
"""4000 rev/min in rad/s."""
SHAFT = [ShaftSegment(1.5, 0.05, elements=6)]
LEFT = RotorDisc.cylinder(0.5, diameter=0.28, width=0.07, bore=0.05)
RIGHT = RotorDisc.cylinder(1.0, diameter=0.35, width=0.07, bore=0.05)


def _on_two_bearings(stiffness: float | tuple[float, float], damping: float = 0.0) -> RotorModel:
    ends = [RotorBearing(at, stiffness, damping) for at in (0.0, 1.5)]
    return RotorModel(SHAFT, [LEFT, RIGHT], ends)


ISOTROPIC = _on_two_bearings(1e6)
ANISOTROPIC = _on_two_bearings((1e6, 8e5))
DAMPED = _on_two_bearings(1e6, 3e3)
OVERHUNG = RotorModel(
    SHAFT,
    [RotorDisc.cylinder(1.5, diameter=0.35, width=0.07, bore=0.05)],
    [RotorBearing(0.0, 1e7), RotorBearing(1.0, 1e7)],
)

IN_RAD: dict[str, tuple[RotorModel, float, list[float]]] = {
    "5.9.1 at rest": (ISOTROPIC, 0.0, [86.66, 86.66, 274.31, 274.31, 716.78, 716.78]),
    "5.9.1": (ISOTROPIC, FAST, [85.39, 87.80, 251.78, 294.71, 600.18, 827.08]),
    "5.9.2 at rest": (ANISOTROPIC, 0.0, [82.65, 86.66, 254.52, 274.31, 679.49, 716.79]),
    "5.9.2": (ANISOTROPIC, FAST, [82.33, 86.86, 239.64, 287.25, 583.49, 806.89]),
    "5.9.9 at rest": (OVERHUNG, 0.0, [90.14, 90.14, 630.73, 630.73, 830.43, 830.43]),
    "5.9.9": (OVERHUNG, FAST, [76.19, 103.91, 565.99, 634.23, 647.75, 1174.2]),
}
"""Undamped natural frequencies in rad/s."""
DAMPED_HZ: dict[float, tuple[list[float], list[float]]] = {
    0.0: (
        [13.91, 13.91, 48.18, 48.18, 137.06, 137.06],
        [13.89, 13.89, 46.54, 46.54, 103.22, 103.22],
    ),
    FAST: (
        [13.70, 14.09, 43.61, 52.18, 122.37, 149.81],
        [13.68, 14.07, 41.98, 50.65, 104.25, 105.66],
    ),
}
"""Of 5.9.5: natural frequencies (magnitudes) and those of the oscillations, in Hz."""
