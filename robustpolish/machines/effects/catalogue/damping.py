"""Damping and hysteresis: forces that take energy out of the motion without dry friction."""

from __future__ import annotations

import numpy as np

from robustpolish.machines.effects.catalogue import declared
from robustpolish.machines.effects.kind import EffectKind, Steepness, Values

# Drag that grows with the square of the velocity, as of air or oil.


def _quadratic_damping_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = -p[0] * abs(v[0]) * v[0]


_QUADRATIC_DAMPING = declared("quadratic_damping", law=_quadratic_damping_law)


# Damping inside a material: the loss of a cycle grows with its amplitude squared, not its rate.
#
# Hysteretic damping, a complex stiffness k (1 + j eta), is a law over frequency: no force in time
# that knows the past alone answers to it. Reid's force does: it opposes the motion in proportion to
# the displacement, and takes the same energy out of a harmonic motion, pi eta k A^2 per cycle, if
# its coefficient is pi/2 eta k.


def _structural_damping_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = -p[0] * abs(q[0]) * np.sign(v[0])


_STRUCTURAL_DAMPING = declared("structural_damping", law=_structural_damping_law)


# Damping that grows with the square of the displacement.


def _displacement_dependent_damping_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = -p[0] * q[0] * q[0] * v[0]


_DISPLACEMENT_DEPENDENT_DAMPING = declared(
    "displacement_dependent_damping", law=_displacement_dependent_damping_law
)


# A spring and a damper in a row beside what the model has: a force that relaxes.


def _maxwell_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    # z is the force, which begins relaxed; p: stiffness, relaxation time, spring beside it, step
    f[0] = -z[0]
    dz[0] = p[0] * v[0] - z[0] / max(p[1], p[3], 1e-300)


def _maxwell_near(values: Values) -> tuple[float, float]:
    # one that relaxes at once is a damper, one that never does a spring: a fit moves the relaxation
    # time by a factor of 100 at most
    return values["time"] / 100.0, values["time"] * 100.0


def _maxwell_gains(values: Values, q: float, v: float) -> Steepness:
    return abs(values["stiffness"]), 0.0, 1 / max(values["time"], 1e-300)


def _maxwell_state_sizes(values: Values, q: float, v: float) -> tuple[float, ...]:
    # at most its spring alone, or its damper alone
    return (values["stiffness"] * max(min(q, values["time"] * v), 1e-6 * q),)


_MAXWELL_ELEMENT = declared(
    "maxwell_element",
    law=_maxwell_law,
    gains=_maxwell_gains,
    state_sizes=_maxwell_state_sizes,
    fit_bounds={"time": _maxwell_near},
)


# Smooth hysteresis.
#
# The force z follows ``z' = k (v - (beta |v| sign(z) + gamma v) |z / F|^n)``. With beta + gamma = 1
# the reference force F is the yield force; where beta + gamma is not positive nothing yields, and
# the loops stiffen. In the usual notation the coefficients are ``k beta / F^n``, ``k gamma / F^n``.


def _bouc_wen_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    # z is the hysteretic force, p: reference force, stiffness, exponent, beta, gamma, step
    level = max(abs(z[0]) / max(p[0], 1e-300), 1e-12)
    bends = level ** p[2]
    rate = p[1] * abs(v[0]) * p[2] * abs(p[3]) * bends / (level * max(p[0], 1e-300))
    stiffness = p[1] / max(1.0, rate * p[5])
    dz[0] = stiffness * (v[0] - (p[3] * abs(v[0]) * np.sign(z[0]) + p[4] * v[0]) * bends)
    f[0] = -z[0]


def _bouc_wen_gains(values: Values, q: float, v: float) -> Steepness:
    steepest = values["exponent"] * (abs(values["beta"]) + abs(values["gamma"]))
    rate = steepest * abs(values["stiffness"]) * v / max(values["force"], 1e-300)
    return abs(values["stiffness"]), 0.0, rate


def _bouc_wen_implausible(values: Values) -> str | None:
    if values["exponent"] > 12:
        return "its exponent is that of an elastic Coulomb element"
    if values["beta"] <= 0:
        return "its loops would feed energy into the motion"
    return None


def _bouc_wen_bend(values: Values) -> float:
    """Return the size that beta and gamma share: one of them may be near 0."""
    return max(abs(values["beta"]), abs(values["gamma"])) or 1.0


def _bouc_wen_state_sizes(values: Values, q: float, v: float) -> tuple[float, ...]:
    return (values["force"],)


_BOUC_WEN_HYSTERESIS = declared(
    "bouc_wen_hysteresis",
    law=_bouc_wen_law,
    gains=_bouc_wen_gains,
    implausible=_bouc_wen_implausible,
    state_sizes=_bouc_wen_state_sizes,
    fit_size={"beta": _bouc_wen_bend, "gamma": _bouc_wen_bend},
)


KINDS = tuple(kind for kind in globals().copy().values() if isinstance(kind, EffectKind))
