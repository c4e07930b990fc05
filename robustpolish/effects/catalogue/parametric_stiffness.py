"""A spring whose stiffness turns with the spindle."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from robustpolish.effects.kind import EffectKind, Parameter
from robustpolish.effects.shapes import Motion, Shape


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    f[0] = -p[0] * np.cos(p[2] * t + p[1]) * q[0]


def _shapes(motion: Motion) -> list[Shape]:
    spin = motion.context.get("spin_frequency", 0.0)
    if not spin:
        return []
    angle = spin * motion.time
    columns = np.stack([-np.cos(angle) * motion.q, np.sin(angle) * motion.q])

    def values(c: NDArray[np.float64]) -> Mapping[str, float]:
        return {"amplitude": float(np.hypot(*c)), "phase": float(np.arctan2(c[1], c[0]))}

    return [Shape(columns, values, (0, 0))]


def _gains(values: Mapping[str, float], q: float, v: float) -> tuple[float, float, float]:
    return abs(values["amplitude"]), 0.0, 0.0


KIND = EffectKind(
    kind="parametric_stiffness",
    title="Stiffness modulated by the spin",
    domain="pair",
    parameters=(
        Parameter("amplitude", "F/L", "amplitude of the stiffness", lower=0.0),
        Parameter("phase", "rad", "phase of the cosine at time 0"),
    ),
    law=_law,
    shapes=_shapes,
    gains=_gains,
    context=("spin_frequency",),
    looks_like="Sidebands at the excitation plus and minus the spin frequency.",
    checks=(
        "Cracked or slotted shafts, worn bearings, unequal brush segments.",
        "Turn the spindle by hand and measure the static stiffness around the circle.",
    ),
    references=("Nayfeh and Mook (1979), Nonlinear Oscillations, chapter 5, Wiley",),
)
