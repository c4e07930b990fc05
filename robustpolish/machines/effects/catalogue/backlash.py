"""A clearance in an existing spring."""

from __future__ import annotations

from robustpolish.machines.effects.kind import EffectKind, Parameter, Scan

BEHIND_CLEARANCE = Parameter(
    "behind_clearance", "1", "1 if it acts behind a clearance at its place, 0 beside it",
    lower=0.0, upper=1.0, default=1.0, fitted=False, choices=(1.0, 0.0), matters_with="clearance",
)  # fmt: skip
"""Of an elastic friction: with a clearance it is in series (a damper behind a worn pin), or what
moves in the clearance rubs as well."""


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    # gives back what the linear spring, p[1], takes inside the clearance; elastic friction at the
    # same place sees the clearance through its context
    f[0] = p[1] * min(max(q[0], -p[0]), p[0])


KIND = EffectKind(
    kind="backlash",
    title="Backlash (clearance)",
    domain="pair",
    parameters=(Parameter("gap", "L", "clearance on each side of the middle", lower=0.0),),
    law=_law,
    scan=(Scan("gap", "amplitude", (0.06, 0.12, 0.25, 0.45, 0.7)),),
    gives=(("clearance", "gap"),),
    context=("spring_stiffness",),
    sharp=True,
    looks_like="The spring gives way around the middle: a lower resonance at small amplitudes, "
    "a dead band in the restoring force.",
    checks=(
        "Gears, keys, couplings, pins and worn joints at this place: preload, wear.",
        "Push and pull by hand: it moves without a force inside the clearance.",
    ),
    references=("Nordin and Gutman (2002), Automatica 38(10), 1633-1649",),
)
