"""A spring that hardens or softens with the cube of its elongation."""

from __future__ import annotations

from robustpolish.machines.effects.kind import EffectKind, Parameter


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    f[0] = -p[0] * q[0] * q[0] * q[0]


KIND = EffectKind(
    kind="cubic_stiffness",
    title="Cubic stiffness",
    domain="pair",
    parameters=(Parameter("stiffness", "F/L^3", "cubic coefficient, positive if hardening"),),
    law=_law,
    linear_in=("stiffness",),
    looks_like="Third harmonics and a resonance that shifts with amplitude; the residual grows "
    "with the cube of the displacement.",
    checks=(
        "Flexures, membranes, clamped beams and magnets at this place.",
        "Measure the resonance at two amplitudes: it moves with the square of the amplitude.",
    ),
    references=("Kovacic and Brennan (2011), The Duffing Equation, Wiley",),
)
