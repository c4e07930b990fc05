"""Nonlinear springs, clearances and stops: forces of the displacement alone."""

from __future__ import annotations

import numpy as np

from robustpolish.machines.effects.catalogue import declared
from robustpolish.machines.effects.kind import EffectKind, Steepness, Values

# A spring that hardens or softens with the cube of its elongation.


def _cubic_stiffness_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = -p[0] * q[0] * q[0] * q[0]


_CUBIC_STIFFNESS = declared("cubic_stiffness", law=_cubic_stiffness_law)


# A spring that is stiffer on one side than on the other.


def _quadratic_stiffness_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = -p[0] * q[0] * q[0]


_QUADRATIC_STIFFNESS = declared("quadratic_stiffness", law=_quadratic_stiffness_law)


# A clearance in an existing spring.


def _backlash_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    # gives back what the linear spring, p[1], takes inside the clearance; elastic friction at the
    # same place sees the clearance through its context
    f[0] = p[1] * min(max(q[0], -p[0]), p[0])


_BACKLASH = declared("backlash", law=_backlash_law)


# A stiff stop on one side, after a gap.


def _contact_stop_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    # the sign of the gap is the side on which the stop stands
    depth = q[0] - p[0]
    if (p[0] >= 0.0 and depth > 0.0) or (p[0] < 0.0 and depth < 0.0):
        f[0] = -p[1] * depth
    else:
        f[0] = 0.0


def _contact_stop_on_its_side(values: Values) -> tuple[float, float]:
    return (0.0, np.inf) if values["gap"] >= 0 else (-np.inf, 0.0)


_CONTACT_STOP = declared(
    "contact_stop", law=_contact_stop_law, fit_bounds={"gap": _contact_stop_on_its_side}
)


# The restoring moment of weight on a lever.


def _pendulum_gravity_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = -p[0] * np.sin(q[0])


def _pendulum_gravity_gains(values: Values, q: float, v: float) -> Steepness:
    return abs(values["moment"]), 0.0, 0.0


_PENDULUM_GRAVITY = declared(
    "pendulum_gravity", law=_pendulum_gravity_law, gains=_pendulum_gravity_gains
)


KINDS = tuple(kind for kind in globals().copy().values() if isinstance(kind, EffectKind))
