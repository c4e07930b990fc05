"""Excitation from outside and by rotation, coupling of axes, and an attached resonator."""

from __future__ import annotations

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.machines.effects import kind
from robustpolish.machines.effects.catalogue import declared
from robustpolish.machines.effects.evaluate import force_with

# A force that never changes.


def _constant_force_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = p[0]


# A force at one frequency that nobody measured.


def _harmonic_force_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = p[0] * np.cos(2.0 * np.pi * p[1] * t + p[2])


# A force of magnets and slots, teeth or a screw, which repeats along the way.


def _cogging_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = p[0] * np.cos(2.0 * np.pi * q[0] / p[1] + p[2])


def _cogging_period_fit_bounds(values: kind.Values) -> tuple[float, float]:
    return 0.9 * values["period"], 1.1 * values["period"]


def _cogging_gains(values: kind.Values, q: float, v: float) -> kind.Steepness:
    wave = 2.0 * np.pi / max(values["period"], 1e-300)
    return abs(values["force"]) * wave, 0.0, wave * v


# A mode beside those of the model, which an input drives and a sensor sees.


def _parallel_mode_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    w = 2.0 * np.pi * p[1]
    dz[0] = z[1]
    dz[1] = p[0] * q[0] - 2.0 * p[2] * w * z[1] - w * w * z[0]
    f[0] = z[0] if p[3] == 0.0 else z[1] if p[3] == 1.0 else dz[1]


def _parallel_mode_state_sizes(values: kind.Values, q: float, v: float) -> tuple[float, ...]:
    return q, 2.0 * np.pi * values["frequency"] * q


def _parallel_mode_gains(values: kind.Values, q: float, v: float) -> kind.Steepness:
    return 0.0, 0.0, 20.0 * np.pi * values["frequency"]  # lightly damped: steps show at once


# A mass beside the axis of rotation, at the known spin frequency.


def _unbalance_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    size = p[0] * p[3] * p[3]
    f[0] = size * np.cos(p[3] * t + p[1])
    f[1] = p[2] * size * np.sin(p[3] * t + p[1])


# A spring whose stiffness turns with the spindle.


def _parametric_stiffness_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = -p[0] * np.cos(p[2] * t + p[1]) * q[0]


# Two axes of a spinning body that turn each other.


def _gyroscopic_coupling_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = -p[0] * v[1]
    f[1] = p[0] * v[0]


# Springs across two axes, as of seals, fluid films or tilted supports.


def _cross_stiffness_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    f[0] = -p[0] * q[1]
    f[1] = -p[1] * q[0]


def _cross_stiffness_shapes(motion: kind.Motion) -> list[kind.Shape]:
    x, y, none = -motion.q[0], -motion.q[1], np.zeros_like(motion.q[0])

    def values(c: Array, mixed: float) -> kind.Values:
        return {"stiffness_xy": float(c[0]), "stiffness_yx": float(mixed)}

    return [
        kind.Shape(np.array([[y, -x]]), lambda c: values(c, -c[0]), (0,)),
        kind.Shape(np.array([[y, x]]), lambda c: values(c, c[0]), (0,)),
        kind.Shape(np.array([[y, none], [none, x]]), lambda c: values(c, c[1]), (0, 0)),
    ]


def _cross_stiffness_gains(values: kind.Values, q: float, v: float) -> kind.Steepness:
    return max(abs(values["stiffness_xy"]), abs(values["stiffness_yx"])), 0.0, 0.0


# A mass on a spring that the model does not have: a missing mode.


_RESONATOR_DAMPING = 0.04
"""Damping ratio that is tried first."""


def _attached_resonator_law(t, q, v, z, p, f, dz):  # type: ignore[no-untyped-def]
    # z: displacement and velocity of the mass, relative to where it is attached
    pull = p[1] * (z[0] - q[0]) + p[2] * (z[1] - v[0])
    f[0] = pull
    dz[0] = z[1]
    dz[1] = -pull / max(p[0], 1e-300)


def _attached_resonator_shapes(motion: kind.Motion) -> list[kind.Shape]:
    """Try frequencies from where displacements begin to where velocities end, and the lines.

    A mass pulls by its acceleration: what is slow for the displacement may be quick for it.
    """
    dt = motion.time[1] - motion.time[0]
    if not motion.q[0].any():
        return []
    first = 3 / (motion.q.shape[1] * dt)
    low = max(0.5 * _frequency_below(motion.q[0], 0.01, dt), first)
    high = min(2.0 * _frequency_below(motion.v[0], 0.99, dt), 0.15 / dt)
    if high <= low:
        return []
    count = int(np.clip(np.log(high / low) / 0.06, 4, 60))
    lines = [
        f for f in kind.Scan("frequency", kind.LINE, (0, 1)).values(motion) if first < f < 0.15 / dt
    ]
    return [
        _resonator_at(motion, frequency) for frequency in (*np.geomspace(low, high, count), *lines)
    ]


def _frequency_below(signal: Array, share: float, dt: float) -> float:
    """Return the frequency below which a share of a signal's power lies, in Hz."""
    power = np.cumsum(np.abs(np.fft.rfft(signal - signal.mean())) ** 2)
    bins = np.fft.rfftfreq(signal.size, dt)
    return float(bins[np.searchsorted(power, share * power[-1])]) if power[-1] > 0 else 0.0


def _resonator_at(motion: kind.Motion, frequency: float) -> kind.Shape:
    """Return the pull of a mass, and its derivative, which moves frequency and damping."""
    column = force_with(_ATTACHED_RESONATOR, _attached_resonator_swinging(1.0, frequency), motion)
    turned = np.gradient(column[0], motion.time[1] - motion.time[0])[None] / (2 * np.pi * frequency)
    return kind.Shape(
        np.stack([column, turned]),
        lambda c: _attached_resonator_swinging(float(c[0]), frequency),
        (1, 0),
        lambda c: bool(abs(c[1]) <= abs(c[0])),
    )


def _attached_resonator_swinging(mass: float, frequency: float) -> kind.Values:
    omega = 2 * np.pi * frequency
    damping = 2 * _RESONATOR_DAMPING * omega * mass
    return {"mass": mass, "stiffness": mass * omega**2, "damping": damping}


def _attached_resonator_gains(values: kind.Values, q: float, v: float) -> kind.Steepness:
    mass = max(values["mass"], 1e-300)
    return 0.0, 0.0, float(np.sqrt(abs(values["stiffness"]) / mass) + abs(values["damping"]) / mass)


def _attached_resonator_state_sizes(values: kind.Values, q: float, v: float) -> tuple[float, ...]:
    return (q, v)


*_, _ATTACHED_RESONATOR = KINDS = declared(globals())
