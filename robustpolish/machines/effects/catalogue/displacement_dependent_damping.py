"""Damping that grows with the square of the displacement."""

from __future__ import annotations

from robustpolish.machines.effects.kind import EffectKind, Parameter


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    f[0] = -p[0] * q[0] * q[0] * v[0]


KIND = EffectKind(
    kind="displacement_dependent_damping",
    title="Displacement-dependent damping",
    domain="pair",
    parameters=(
        Parameter("coefficient", "F*T/L^3", "damping over displacement squared", lower=0.0),
    ),
    law=_law,
    linear_in=("coefficient",),
    looks_like="Damping that grows with amplitude while the velocity does not matter; third "
    "harmonics in quadrature to those of a cubic spring.",
    checks=(
        "Joints and seals that clamp harder when deflected; squeeze films.",
        "Shift the rest position with a static load: the damping changes.",
    ),
    references=("Elliott, Tehrani, Langley (2015), Phil. Trans. R. Soc. A 373, 20140402",),
)
