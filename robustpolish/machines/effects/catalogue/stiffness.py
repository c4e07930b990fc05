"""Nonlinear springs, clearances and stops: forces of the displacement alone."""

from __future__ import annotations

import numpy as np

from robustpolish.machines.effects.catalogue import told
from robustpolish.machines.effects.kind import EffectKind, Parameter, Scan, Steepness, Values

# A spring that hardens or softens with the cube of its elongation.


def _cubic_stiffness_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = -p[0] * q[0] * q[0] * q[0]


_CUBIC_STIFFNESS = EffectKind(
    **told("cubic_stiffness"),
    domain="pair",
    parameters=(Parameter("stiffness", "F/L^3", "cubic coefficient, positive if hardening"),),
    law=_cubic_stiffness_law,
    linear_in=("stiffness",),
)


# A spring that is stiffer on one side than on the other.


def _quadratic_stiffness_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = -p[0] * q[0] * q[0]


_QUADRATIC_STIFFNESS = EffectKind(
    **told("quadratic_stiffness"),
    domain="pair",
    parameters=(Parameter("stiffness", "F/L^2", "quadratic coefficient"),),
    law=_quadratic_stiffness_law,
    linear_in=("stiffness",),
)


# A clearance in an existing spring.


def _backlash_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    # gives back what the linear spring, p[1], takes inside the clearance; elastic friction at the
    # same place sees the clearance through its context
    f[0] = p[1] * min(max(q[0], -p[0]), p[0])


_BACKLASH = EffectKind(
    **told("backlash"),
    domain="pair",
    parameters=(Parameter("gap", "L", "clearance on each side of the middle", lower=0.0),),
    law=_backlash_law,
    scan=(Scan("gap", "amplitude", (0.06, 0.12, 0.25, 0.45, 0.7)),),
    gives=(("clearance", "gap"),),
    context=("spring_stiffness",),
    sharp=True,
)


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


_CONTACT_STOP = EffectKind(
    **told("contact_stop"),
    domain="pair",
    parameters=(
        Parameter(
            "gap",
            "L",
            "displacement at which it touches; its sign is the side",
            fit_bounds=_contact_stop_on_its_side,
        ),
        Parameter("stiffness", "F/L", "stiffness of the stop", lower=0.0),
    ),
    law=_contact_stop_law,
    linear_in=("stiffness",),
    scan=(Scan("gap", "percentile", (60, 70, 80, 88, 94, 97.5)),),
    sharp=True,
)


# The restoring moment of weight on a lever.


def _pendulum_gravity_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = -p[0] * np.sin(q[0])


def _pendulum_gravity_gains(values: Values, q: float, v: float) -> Steepness:
    return abs(values["moment"]), 0.0, 0.0


_PENDULUM_GRAVITY = EffectKind(
    **told("pendulum_gravity"),
    domain="dof",
    parameters=(Parameter("moment", "F", "weight times lever, m g l", lower=0.0),),
    law=_pendulum_gravity_law,
    linear_in=("moment",),
    gains=_pendulum_gravity_gains,
)


KINDS = tuple(kind for kind in globals().copy().values() if isinstance(kind, EffectKind))
