"""Dry friction that builds up over a short way, and remembers it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robustpolish.machines.effects.catalogue.backlash import BEHIND_CLEARANCE
from robustpolish.machines.effects.kind import EffectKind, Parameter, Scan


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    # z is the friction force, p: sliding force, stiffness at reversals, whether it acts behind the
    # clearance, that clearance, step. On its way through a clearance z grows from -reach to reach,
    # and no force acts. A step may overshoot the sliding force past it: the force is cut off, and
    # the overshoot slides back.
    size = max(p[0], 1e-300)
    reach = p[1] * p[2] * p[3]
    if abs(z[0]) < reach:
        dz[0] = p[1] * v[0]
        f[0] = 0.0
    else:
        force = z[0] - np.sign(z[0]) * reach
        stiffness = p[1] / max(1.0, p[1] * abs(v[0]) / size * p[4])
        dz[0] = stiffness * (v[0] - abs(v[0]) * force / size)
        f[0] = -force
        if reach > 0.0:
            f[0] = -min(max(force, -size), size)


def gains(values: Mapping[str, float], q: float, v: float) -> tuple[float, float, float]:
    """Return the steepness of a force that builds up over a way, and slides: see `EffectKind`."""
    rate = abs(values["stiffness"]) * v / max(values["force"], 1e-300)
    return abs(values["stiffness"]), 0.0, rate


def _state_sizes(values: Mapping[str, float], q: float, v: float) -> tuple[float, ...]:
    return (values["force"],)


KIND = EffectKind(
    kind="dahl_friction",
    title="Dahl friction",
    domain="pair",
    parameters=(
        Parameter("force", "F", "sliding friction force", lower=0.0),
        Parameter("stiffness", "F/L", "stiffness after a reversal", lower=0.0),
        BEHIND_CLEARANCE,
    ),
    law=_law,
    linear_in=("force",),
    scan=(Scan("stiffness", "per slip", (0.003, 0.01, 0.03, 0.1, 0.3)),),
    gains=gains,
    state_sizes=_state_sizes,
    states=1,
    context=("clearance", "step"),
    family="dry friction",
    sharp=True,
    looks_like="Like Coulomb friction, with rounded corners after each reversal: over some way, "
    "however slowly it is gone.",
    checks=(
        "Rolling bearings, seals and dampers: the way over which the force builds up.",
        "Move slowly to and fro by a few micrometres: the force follows displacement.",
    ),
    references=("Dahl (1976), AIAA Journal 14(12), 1675-1682",),
)
