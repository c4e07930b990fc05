"""A force that never changes."""

from __future__ import annotations

from robustpolish.machines.effects.kind import CONSTANT, EffectKind, Parameter


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    f[0] = p[0]


KIND = EffectKind(
    kind="constant_force",
    title="Constant force",
    domain="dof",
    parameters=(Parameter("force", "F", "force along the coordinate"),),
    law=_law,
    linear_in=("force",),
    family=CONSTANT,
    looks_like="A residual with a mean; the free run starts right and settles beside the data.",
    checks=(
        "Weight, preload, cables, an offset of the force sensor or amplifier.",
        "Record the machine at rest, with and without the drive switched on.",
    ),
    references=("Janot, Gautier, Brunot (2019), Data set and reference models of EMPS",),
)
