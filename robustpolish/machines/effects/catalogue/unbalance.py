"""A mass beside the axis of rotation, at the known spin frequency."""

from __future__ import annotations

import numpy as np

from robustpolish.machines.effects.kind import EffectKind, Parameter, Scan


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    size = p[0] * p[3] * p[3]
    f[0] = size * np.cos(p[3] * t + p[1])
    f[1] = p[2] * size * np.sin(p[3] * t + p[1])


KIND = EffectKind(
    kind="unbalance",
    title="Unbalance",
    domain="axes",
    parameters=(
        Parameter("unbalance", "M*L", "mass times eccentricity", lower=0.0),
        Parameter("phase", "rad", "angle from the first axis at time 0"),
        Parameter(
            "direction",
            "1",
            "1 if it turns from the first axis to the second, else -1",
            default=1.0,
            fitted=False,
        ),
    ),
    law=_law,
    linear_in=("unbalance",),
    scan=(Scan("direction", "1", (1.0, -1.0)),),
    context=("spin_frequency",),
    looks_like="A line at the spin frequency on both axes, a quarter of a turn apart.",
    checks=(
        "Balance the rotor; check the seat of chuck, tool and brush.",
        "Change the speed: the force grows with its square.",
    ),
    references=("ISO 21940-11:2016, Mechanical vibration - Rotor balancing",),
)
