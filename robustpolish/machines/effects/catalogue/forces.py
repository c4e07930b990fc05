"""Forces of the displacement and the velocity: friction, damping, hysteresis and springs."""

from __future__ import annotations

import numpy as np

from robustpolish.machines.effects.catalogue import declared
from robustpolish.machines.effects.kind import Steepness, Values

# Dry friction: laws of the sliding velocity alone, and laws that remember where they slid.

# Dry friction of constant size against the sliding velocity.


def _coulomb_friction_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    width = max(p[2], abs(p[0]) * p[3])
    direction = np.tanh(v[0] / width) if width > 0.0 else np.sign(v[0])
    f[0] = -p[0] * direction - p[1] * direction * direction


def _coulomb_friction_gains(values: Values, q: float, v: float) -> Steepness:
    return 0.0, values["force"] / values["width"] if values["width"] > 0 else 0.0, 0.0


# A linear spring where the model has none.


def _guide_spring_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = -p[0] * q[0]


# Dry friction in a guide that is tighter at one end.


def _position_dependent_friction_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    size = max(p[1] + p[0] * q[0], 0.0)
    width = max(p[2], size * p[3])
    f[0] = -size * (np.tanh(v[0] / width) if width > 0.0 else np.sign(v[0]))


def _position_dependent_friction_gains(values: Values, q: float, v: float) -> Steepness:
    size = abs(values["force"]) + abs(values["slope"]) * q
    return abs(values["slope"]), size / values["width"] if values["width"] > 0 else 0.0, 0.0


# Dry friction that is larger at low speed.


# Exponent beyond which nothing of an exponential is left beside 1; near its end exp is slow.
_NOTHING_LEFT = 700.0


def _stribeck_friction_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    fast = (v[0] / p[2]) ** 2
    more = np.exp(-fast) if fast < _NOTHING_LEFT else 0.0
    size = p[0] + (p[1] - p[0]) * more
    width = max(p[3], max(p[0], p[1]) * p[4])
    direction = np.tanh(v[0] / width) if width > 0.0 else np.sign(v[0])
    f[0] = -size * direction


def _stribeck_friction_implausible(values: Values) -> str | None:
    """Say why static and sliding friction cannot be those of a machine, or return None."""
    if values["static_force"] < (1 - 1e-9) * values["force"]:
        return "the static friction is below the sliding friction"
    if values["static_force"] > 6 * values["force"]:
        return "the static friction is many times the sliding friction"
    return None


def _stribeck_friction_velocity_fit_bounds(values: Values) -> tuple[float, float]:
    # A corner much sharper than the data shows is none.
    velocity = values["velocity"]
    return (0.2 * velocity, 6 * velocity) if velocity > 0 else (0.0, np.inf)


def _stribeck_friction_gains(values: Values, q: float, v: float) -> Steepness:
    more = abs(values["static_force"] - values["force"])
    width = values["width"]
    slope = max(values["static_force"], values["force"]) / width if width > 0 else 0.0
    return 0.0, max(slope, more / max(values["velocity"], 1e-300)), 0.0


def _elastic_coulomb_friction_gains(values: Values, q: float, v: float) -> Steepness:
    """Return the steepness of a force that builds up over a way, and slides: see `EffectKind`."""
    rate = abs(values["stiffness"]) * v / max(values["force"], 1e-300)
    return abs(values["stiffness"]), 0.0, rate


def _dahl_friction_state_sizes(values: Values, q: float, v: float) -> tuple[float, ...]:
    return (values["force"],)


_dahl_friction_gains = _elastic_coulomb_friction_gains
_lugre_friction_state_sizes = _bouc_wen_hysteresis_state_sizes = _dahl_friction_state_sizes
_lugre_friction_implausible = _stribeck_friction_implausible
_lugre_friction_velocity_fit_bounds = _stribeck_friction_velocity_fit_bounds


# Dry friction behind a spring: stick, slip and memory (Jenkins element).


def _elastic_coulomb_friction_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
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


def _elastic_coulomb_friction_state_sizes(values: Values, q: float, v: float) -> tuple[float, ...]:
    return (max(values["force"] / max(values["stiffness"], 1e-300), 1e-6 * q),)


# Dry friction that builds up over a short way, and remembers it.


def _dahl_friction_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
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


# Dry friction with bristles: presliding, Stribeck effect and memory.


def _lugre_friction_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    # z is the force in the bristles
    # p: sliding and static force, velocity, stiffness, damping, step
    size = max(p[0] + (p[1] - p[0]) * np.exp(-((v[0] / p[2]) ** 2)), 1e-300)
    stiffness = p[3] / max(1.0, p[3] * abs(v[0]) / size * p[5])
    dz[0] = stiffness * (v[0] - abs(v[0]) * z[0] / size)
    f[0] = -z[0] - p[4] / max(p[3], 1e-300) * dz[0]


def _lugre_friction_gains(values: Values, q: float, v: float) -> Steepness:
    stiffness, _, rate = _elastic_coulomb_friction_gains(values, q, v)
    return stiffness, abs(values["damping"]), rate


# Damping and hysteresis: forces that take energy out of the motion without dry friction.

# Drag that grows with the square of the velocity, as of air or oil.


def _quadratic_damping_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = -p[0] * abs(v[0]) * v[0]


# Damping inside a material: the loss of a cycle grows with its amplitude squared, not its rate.
#
# Hysteretic damping, a complex stiffness k (1 + j eta), is a law over frequency: no force in time
# that knows the past alone answers to it. Reid's force does: it opposes the motion in proportion to
# the displacement, and takes the same energy out of a harmonic motion, pi eta k A^2 per cycle, if
# its coefficient is pi/2 eta k.


def _structural_damping_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = -p[0] * abs(q[0]) * np.sign(v[0])


# Damping that grows with the square of the displacement.


def _displacement_dependent_damping_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = -p[0] * q[0] * q[0] * v[0]


# A spring and a damper in a row beside what the model has: a force that relaxes.


def _maxwell_element_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    # z is the force, which begins relaxed; p: stiffness, relaxation time, spring beside it, step
    f[0] = -z[0]
    dz[0] = p[0] * v[0] - z[0] / max(p[1], p[3], 1e-300)


def _maxwell_element_time_fit_bounds(values: Values) -> tuple[float, float]:
    # one that relaxes at once is a damper, one that never does a spring: a fit moves the relaxation
    # time by a factor of 100 at most
    return values["time"] / 100.0, values["time"] * 100.0


def _maxwell_element_gains(values: Values, q: float, v: float) -> Steepness:
    return abs(values["stiffness"]), 0.0, 1 / max(values["time"], 1e-300)


def _maxwell_element_state_sizes(values: Values, q: float, v: float) -> tuple[float, ...]:
    # at most its spring alone, or its damper alone
    return (values["stiffness"] * max(min(q, values["time"] * v), 1e-6 * q),)


# Smooth hysteresis.
#
# The force z follows ``z' = k (v - (beta |v| sign(z) + gamma v) |z / F|^n)``. With beta + gamma = 1
# the reference force F is the yield force; where beta + gamma is not positive nothing yields, and
# the loops stiffen. In the usual notation the coefficients are ``k beta / F^n``, ``k gamma / F^n``.


def _bouc_wen_hysteresis_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    # z is the hysteretic force, p: reference force, stiffness, exponent, beta, gamma, step
    level = max(abs(z[0]) / max(p[0], 1e-300), 1e-12)
    bends = level ** p[2]
    rate = p[1] * abs(v[0]) * p[2] * abs(p[3]) * bends / (level * max(p[0], 1e-300))
    stiffness = p[1] / max(1.0, rate * p[5])
    dz[0] = stiffness * (v[0] - (p[3] * abs(v[0]) * np.sign(z[0]) + p[4] * v[0]) * bends)
    f[0] = -z[0]


def _bouc_wen_hysteresis_gains(values: Values, q: float, v: float) -> Steepness:
    steepest = values["exponent"] * (abs(values["beta"]) + abs(values["gamma"]))
    rate = steepest * abs(values["stiffness"]) * v / max(values["force"], 1e-300)
    return abs(values["stiffness"]), 0.0, rate


def _bouc_wen_hysteresis_implausible(values: Values) -> str | None:
    if values["exponent"] > 12:
        return "its exponent is that of an elastic Coulomb element"
    if values["beta"] <= 0:
        return "its loops would feed energy into the motion"
    return None


def _bouc_wen_hysteresis_beta_fit_size(values: Values) -> float:
    """Return the size that beta and gamma share: one of them may be near 0."""
    return max(abs(values["beta"]), abs(values["gamma"])) or 1.0


_bouc_wen_hysteresis_gamma_fit_size = _bouc_wen_hysteresis_beta_fit_size

# Nonlinear springs, clearances and stops: forces of the displacement alone.

# A spring that hardens or softens with the cube of its elongation.


def _cubic_stiffness_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = -p[0] * q[0] * q[0] * q[0]


# A spring that is stiffer on one side than on the other.


def _quadratic_stiffness_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = -p[0] * q[0] * q[0]


# A clearance in an existing spring.


def _backlash_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    # gives back what the linear spring, p[1], takes inside the clearance; elastic friction at the
    # same place sees the clearance through its context
    f[0] = p[1] * min(max(q[0], -p[0]), p[0])


# A stiff stop on one side, after a gap.


def _contact_stop_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    # the sign of the gap is the side on which the stop stands
    depth = q[0] - p[0]
    if (p[0] >= 0.0 and depth > 0.0) or (p[0] < 0.0 and depth < 0.0):
        f[0] = -p[1] * depth
    else:
        f[0] = 0.0


def _contact_stop_gap_fit_bounds(values: Values) -> tuple[float, float]:
    return (0.0, np.inf) if values["gap"] >= 0 else (-np.inf, 0.0)


# The restoring moment of weight on a lever.


def _pendulum_gravity_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = -p[0] * np.sin(q[0])


def _pendulum_gravity_gains(values: Values, q: float, v: float) -> Steepness:
    return abs(values["moment"]), 0.0, 0.0


KINDS = declared(globals())
