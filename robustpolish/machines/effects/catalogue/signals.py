"""Inputs and outputs: what actuators make of commands, and sensors of the motion."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from robustpolish.base.arrays import Array
from robustpolish.machines.effects import kind
from robustpolish.machines.effects.catalogue import declared
from robustpolish.machines.effects.evaluate import first_order_lag

# A measured input that acts later than it says.


def _input_delay_shapes(motion: kind.Motion) -> list[kind.Shape]:
    signal, shapes = motion.q[0], []
    for samples in (1, 2, 4, 8):
        delay = samples * (motion.time[1] - motion.time[0])
        late = np.concatenate([signal[:1].repeat(samples), signal[:-samples]])
        shapes.append(kind.signal_candidate(late - signal, "delay", delay, (0.0, 3.0)))
    return shapes


def _input_delay_on_signal(u: Array, time: Array, values: kind.Values) -> Array:
    if not values["delay"]:
        return u
    return CubicSpline(time, u)(np.maximum(time - values["delay"], time[0]))


def _input_delay_timing(values: kind.Values) -> kind.Timing:
    return kind.Timing(delay=values["delay"])


# An actuator that follows its input with a first-order lag.


def _input_lag_shapes(motion: kind.Motion) -> list[kind.Shape]:
    """Try six time constants, from a sample to the time in which the input itself changes."""
    step = float(motion.time[1] - motion.time[0])
    speed = motion.speed
    longest = max(2 * motion.amplitude / speed if speed else 0.0, 8 * step)
    shapes = []
    for lag in np.geomspace(step, longest, 6).tolist():
        column = _input_lag_on_signal(motion.q[0], motion.time, {"lag": lag}) - motion.q[0]
        # within these times of the constant that was tried, the force is nearly linear in it
        shapes.append(kind.signal_candidate(column, "lag", lag, (0.5, 2.0)))
    return shapes


def _input_lag_on_signal(u: Array, time: Array, values: kind.Values) -> Array:
    step = float(time[-1] - time[0]) / (time.size - 1)
    return first_order_lag(u, np.concatenate([u[1:], u[-1:]]), step, values["lag"])


def _input_lag_timing(values: kind.Values) -> kind.Timing:
    return kind.Timing(lag=values["lag"])


# A sensor that warms up.


def _sensor_drift_on_signal(y: Array, time: Array, values: kind.Values) -> Array:
    return y + values["drift"] * (1 - np.exp(-np.maximum(time, 0.0) / max(values["time"], 1e-9)))


# A measured input that acts with another size than it says.


def _input_gain_on_signal(u: Array, time: Array, values: kind.Values) -> Array:
    return u * values["gain"]


# What an input does between its samples; no effect of the machine but of the record.
#
# Runs take each step by itself, see ``simulation/stepper.py``. As a record of its own, a zero-order
# hold, or a smooth signal with content near the sampling rate, is the linear interpolation of a
# filtered one; short filters match the frequency responses.


def _input_hold_on_signal(u: Array, time: Array, values: kind.Values) -> Array:
    """Return the record whose linear interpolation acts like `u` with another hold."""
    order = values["order"]
    if order == 1.0:
        return u
    padded = np.concatenate([u[:1], u[:1], u, u[-1:], u[-1:]])
    far, last, now, later, farther = (padded[i : i + u.size] for i in range(5))
    if order == 0.0:
        return (7 * (now + last) - later - far) / 12
    second = last - 2 * now + later
    fourth = far - 4 * last + 6 * now - 4 * later + farther
    return now - second / 12 + fourth / 90


def _input_hold_timing(values: kind.Values) -> kind.Timing:
    return kind.Timing(values["order"])


# An actuator that cannot do more than its limit.


def _input_saturation_shapes(motion: kind.Motion) -> list[kind.Shape]:
    """Try limits as shares of the largest force that is asked for."""
    signal = motion.q[0]
    peak = float(np.max(np.abs(signal)))
    # the signal may be cut half as deep again, in what was cut off
    return [
        kind.signal_candidate(
            np.clip(signal, -limit, limit) - signal, "limit", limit - peak, (0.0, 1.5), peak
        )
        for limit in (share * peak for share in (0.92, 0.8, 0.65, 0.5, 0.35) if peak)
    ]


def _input_saturation_on_signal(u: Array, time: Array, values: kind.Values) -> Array:
    return np.clip(u, -values["limit"], values["limit"])


# An actuator that does nothing about small commands.


def _input_dead_zone_shapes(motion: kind.Motion) -> list[kind.Shape]:
    """Try half widths as shares of the largest force that is asked for."""
    signal = motion.q[0]
    peak = float(np.max(np.abs(signal)))
    # up to twice the half width that was tried, the force is nearly linear in it
    return [
        kind.signal_candidate(-np.clip(signal, -width, width), "width", width, (0.0, 2.0))
        for width in (share * peak for share in (0.02, 0.06, 0.15, 0.3) if peak)
    ]


def _input_dead_zone_on_signal(u: Array, time: Array, values: kind.Values) -> Array:
    return np.asarray(u - np.clip(u, -values["width"], values["width"]))


# A sensor that does not show zero at zero.


def _sensor_offset_on_signal(u: Array, time: Array, values: kind.Values) -> Array:
    return u + values["offset"]


# A sensor that shows another size than there is.


_sensor_gain_on_signal = _input_gain_on_signal


def _sensor_gain_shapes(motion: kind.Motion) -> list[kind.Shape]:
    def values(c: Array) -> kind.Values:
        return {"gain": 1.0 / (1.0 - float(np.clip(c[0], -0.9, 0.9)))}

    return [kind.Shape(motion.q[None], values, (0,))]


_input_saturation_linear_signal = _input_dead_zone_linear_signal = kind.unchanged_signal
_sensor_offset_linear_signal = kind.unchanged_signal
KINDS = declared(globals())
