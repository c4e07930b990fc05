"""Dry friction behind a spring: stick, slip and memory (Jenkins element)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robustpolish.machines.effects.catalogue.backlash import BEHIND_CLEARANCE
from robustpolish.machines.effects.catalogue.dahl_friction import gains
from robustpolish.machines.effects.kind import EffectKind, Parameter, Scan


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    # z is the elongation between the slider and the end, p: slip force, stiffness, whether it acts
    # behind the clearance, the clearance and the length of a step.
    # It follows the motion until the slider slips. A step may overshoot the elongation of slip:
    # the force is cut off, and the overshoot slides back with the sliding distance, but not beyond
    # its end in one step, where the slider would stick again.
    reach = p[0] / max(p[1], 1e-300)
    gap = p[2] * p[3]
    longest = reach + gap
    side = np.sign(z[0])
    over = abs(z[0]) - longest
    if over >= 0.0:
        f[0] = -side * p[0]
        if side * v[0] > 0.0:
            dz[0] = -side * over * min(abs(v[0]) / max(reach, 1e-300), 1.0 / max(p[4], 1e-300))
        else:
            dz[0] = v[0]
    else:
        f[0] = -side * p[1] * max(abs(z[0]) - gap, 0.0)
        dz[0] = v[0]


def _state_sizes(values: Mapping[str, float], q: float, v: float) -> tuple[float, ...]:
    return (max(values["force"] / max(values["stiffness"], 1e-300), 1e-6 * q),)


KIND = EffectKind(
    kind="elastic_coulomb_friction",
    title="Elastic Coulomb friction (Jenkins element)",
    domain="pair",
    parameters=(
        Parameter("force", "F", "force at which it slips", lower=0.0),
        Parameter("stiffness", "F/L", "stiffness while it sticks", lower=0.0),
        BEHIND_CLEARANCE,
    ),
    law=_law,
    linear_in=("force",),
    scan=(Scan("stiffness", "per slip", (0.02, 0.05, 0.12, 0.3, 0.6, 1.0)),),
    gains=gains,
    state_sizes=_state_sizes,
    states=1,
    context=("clearance", "step"),
    family="dry friction",
    sharp=True,
    looks_like="Parallelogram loops of residual force over displacement; stiff after each "
    "reversal, then constant. A force without memory cannot follow it.",
    checks=(
        "Bolted or clamped joints, belts, friction dampers: clamping force, wear.",
        "Move slowly to and fro with growing amplitude: small loops are elastic.",
    ),
    references=("Gaul and Nitsche (2001), Appl. Mech. Rev. 54(2), 93-106",),
)
