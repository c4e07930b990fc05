"""A spring that hardens or softens with the cube of its elongation."""

from __future__ import annotations

from collections.abc import Mapping

from robustpolish.effects.kind import EffectKind, Parameter
from robustpolish.effects.shapes import Motion, Shape, single


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    f[0] = -p[0] * q[0] * q[0] * q[0]


def _shapes(motion: Motion) -> list[Shape]:
    return [single(-(motion.q**3), "stiffness", sign=0)]


def _gains(values: Mapping[str, float], q: float, v: float) -> tuple[float, float, float]:
    return 3 * abs(values["stiffness"]) * q**2, 0.0, 0.0


KIND = EffectKind(
    kind="cubic_stiffness",
    title="Cubic stiffness",
    domain="pair",
    parameters=(Parameter("stiffness", "F/L^3", "cubic coefficient, positive if hardening"),),
    law=_law,
    shapes=_shapes,
    gains=_gains,
    looks_like="Third harmonics and a resonance that shifts with amplitude; the residual grows "
    "with the cube of the displacement.",
    checks=(
        "Flexures, membranes, clamped beams and magnets at this place.",
        "Measure the resonance at two amplitudes: it moves with the square of the amplitude.",
    ),
    references=("Kovacic and Brennan (2011), The Duffing Equation, Wiley",),
)
