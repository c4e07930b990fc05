"""A force at one frequency that nobody measured."""

from __future__ import annotations

import numpy as np

from robustpolish.machines.effects.kind import LINE, EffectKind, Parameter, Scan


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    f[0] = p[0] * np.cos(2.0 * np.pi * p[1] * t + p[2])


KIND = EffectKind(
    kind="harmonic_force",
    title="Harmonic force",
    domain="dof",
    parameters=(
        Parameter("amplitude", "F", "amplitude along the coordinate", lower=0.0),
        Parameter("frequency", "1/T", "frequency in Hz", lower=0.0, fit_scale=1e-3),
        Parameter("phase", "rad", "phase of the cosine at time 0"),
    ),
    law=_law,
    linear_in=("amplitude",),
    scan=(Scan("frequency", LINE, (0, 1, 2)),),
    looks_like="One line in the residual's spectrum, whatever the input does.",
    checks=(
        "Fans, pumps, mains hum, drives and neighbours that run at this frequency.",
        "Record with the input switched off: the line stays.",
    ),
    references=("Ewins (2000), Modal Testing, chapter 3, Research Studies Press",),
)
