"""The restoring moment of weight on a lever."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robustpolish.machines.effects.kind import EffectKind, Parameter


def _law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]  # compiled by Numba
    f[0] = -p[0] * np.sin(q[0])


def _gains(values: Mapping[str, float], q: float, v: float) -> tuple[float, float, float]:
    return abs(values["moment"]), 0.0, 0.0


KIND = EffectKind(
    kind="pendulum_gravity",
    title="Gravity on a pendulum",
    domain="dof",
    parameters=(Parameter("moment", "F", "weight times lever, m g l", lower=0.0),),
    law=_law,
    linear_in=("moment",),
    gains=_gains,
    looks_like="A spring that softens at large angles; at small ones it is a linear spring and "
    "cannot be told from one.",
    checks=("Where the centre of mass hangs: lever arm, counterweight, tilt of the axis.",),
    references=("Nayfeh and Mook (1979), Nonlinear Oscillations, section 2.1.1, Wiley",),
)
