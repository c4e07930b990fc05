"""Two axes of a spinning body that turn each other."""

from __future__ import annotations

from robustpolish.machines.effects.kind import EffectKind, Parameter


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    f[0] = -p[0] * v[1]
    f[1] = p[0] * v[0]


KIND = EffectKind(
    kind="gyroscopic_coupling",
    title="Gyroscopic coupling",
    domain="axes",
    parameters=(Parameter("coefficient", "F*T/L", "force over the other axis' velocity"),),
    law=_law,
    linear_in=("coefficient",),
    looks_like="Each axis' residual follows the other axis' velocity, with opposite signs; no "
    "energy is lost.",
    checks=(
        "Polar inertia and speed of the spinning parts, off-centre bearings.",
        "Change the speed: the coupling is proportional to it.",
    ),
    references=("Genta (2005), Dynamics of Rotating Systems, chapter 4, Springer",),
)
