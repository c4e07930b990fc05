"""A spring that is stiffer on one side than on the other."""

from __future__ import annotations

from robustpolish.machines.effects.kind import EffectKind, Parameter


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    f[0] = -p[0] * q[0] * q[0]


KIND = EffectKind(
    kind="quadratic_stiffness",
    title="Quadratic stiffness",
    domain="pair",
    parameters=(Parameter("stiffness", "F/L^2", "quadratic coefficient"),),
    law=_law,
    linear_in=("stiffness",),
    looks_like="Second harmonics and a mean that drifts with the amplitude.",
    checks=(
        "Preloaded or curved springs, asymmetric contacts, magnets on one side.",
        "Load it statically in both directions: the deflections differ.",
    ),
    references=("Kovacic and Brennan (2011), The Duffing Equation, chapter 8, Wiley",),
)
