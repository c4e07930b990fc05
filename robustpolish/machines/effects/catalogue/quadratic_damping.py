"""Drag that grows with the square of the velocity, as of air or oil."""

from __future__ import annotations

from robustpolish.machines.effects.kind import EffectKind, Parameter


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    f[0] = -p[0] * abs(v[0]) * v[0]


KIND = EffectKind(
    kind="quadratic_damping",
    title="Quadratic (fluid) damping",
    domain="pair",
    parameters=(Parameter("coefficient", "F*T^2/L^2", "force over velocity squared", lower=0.0),),
    law=_law,
    linear_in=("coefficient",),
    looks_like="Damping that grows with amplitude; the residual grows with v|v|.",
    checks=(
        "Air or oil that is pushed through gaps: covers, cavities, dashpots, fans.",
        "Let it decay freely: the decrement falls with the amplitude.",
    ),
    references=("Nayfeh and Mook (1979), Nonlinear Oscillations, section 3.3, Wiley",),
)
