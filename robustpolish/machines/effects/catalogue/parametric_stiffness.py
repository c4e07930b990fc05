"""A spring whose stiffness turns with the spindle."""

from __future__ import annotations

import numpy as np

from robustpolish.machines.effects.kind import EffectKind, Parameter


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    f[0] = -p[0] * np.cos(p[2] * t + p[1]) * q[0]


KIND = EffectKind(
    kind="parametric_stiffness",
    title="Stiffness modulated by the spin",
    domain="pair",
    parameters=(
        Parameter("amplitude", "F/L", "amplitude of the stiffness", lower=0.0),
        Parameter("phase", "rad", "phase of the cosine at time 0"),
    ),
    law=_law,
    linear_in=("amplitude",),
    context=("spin_frequency",),
    looks_like="Sidebands at the excitation plus and minus the spin frequency.",
    checks=(
        "Cracked or slotted shafts, worn bearings, unequal brush segments.",
        "Turn the spindle by hand and measure the static stiffness around the circle.",
    ),
    references=("Nayfeh and Mook (1979), Nonlinear Oscillations, chapter 5, Wiley",),
)
