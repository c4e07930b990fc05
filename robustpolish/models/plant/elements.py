"""What stands between a controller and its machine: lags of actuators, sensors and filters."""

from __future__ import annotations

import math
from typing import Any

import control
import numpy as np

from robustpolish.models.plant.blocks import named_system
from robustpolish.models.plant.given_system import as_state_space
from robustpolish.validation import described, invalid, is_whole, positive

MOST_ORDER = 8
"""A lag of a higher order is a delay and better given as one."""


def lag(
    bandwidth_hz: float, order: int | None, damping: float | None, dt: float | bool
) -> control.StateSpace:
    """Return a lag whose gain is 1 at rest and has fallen by 3 dB at its bandwidth.

    Parameters
    ----------
    bandwidth_hz : float
        Where the gain is 1 / sqrt(2), in Hz.
    order : int or None
        1 by default, 2 if a damping is given; above 2 that of Butterworth.
    damping : float or None
        Damping ratio of order 2; 1 / sqrt(2), Butterworth's, by default.
    dt : float or True
        Sampling time: 0 is continuous; otherwise the bilinear image, right at the bandwidth.

    Returns
    -------
    control.StateSpace
    """
    hertz = positive("bandwidth_hz", bandwidth_hz, "Hz")
    if damping is not None:
        damping = positive("damping", damping)
        if order not in (None, 2):
            shown = described(f"a damping for order {order}")
            raise invalid("damping", shown, "order=2", "A damping ratio belongs to order 2.")
        order = 2
    order = 1 if order is None else order
    if not is_whole(order) or not 1 <= order <= MOST_ORDER:
        want = f"a whole number from 1 to {MOST_ORDER}"
        raise invalid("order", order, want, "Pass another lag as dynamics=, a delay with_delay.")
    A, B, C = np.zeros((0, 0)), np.zeros((0, 1)), np.ones((1, 0))
    D = np.ones((1, 1))
    for a, b, c in _sections(int(order), damping):
        k = len(A)
        A = np.block([[A, np.zeros((k, len(a)))], [b @ C, a]])
        B = np.vstack([B, b @ D])
        C, D = np.hstack([np.zeros((1, k)), c]), np.zeros((1, 1))
    rate = 2 * math.pi * hertz
    if not dt:
        return named_system((A * rate, B * rate, C, D), 0, ["u"], ["y"], _names(len(A)))
    return bilinear(A, B, C, D, dt, rate)


def bilinear(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, dt: float | bool, rate: float
) -> control.StateSpace:
    """Return the discrete image of a system in units of `rate`, with the same response there.

    Parameters
    ----------
    A, B, C, D : ndarray
        In time units of 1 / rate.
    dt : float or True
        Sampling time in s.
    rate : float
        In rad/s; below the Nyquist frequency.
    """
    step = 1.0 if dt is True else float(dt)
    if rate * step >= math.pi:
        shown = described(f"{rate / (2 * math.pi):.6g} Hz")
        want = f"less than the Nyquist frequency {0.5 / step:.6g} Hz"
        raise invalid("frequency", shown, want, "Leave the lag out, or sample faster.")
    half = math.tan(rate * step / 2)  # s = (z - 1) / (z + 1) / half
    one = np.eye(len(A))
    inner = np.linalg.inv(one - half * A)
    matrices = (
        inner @ (one + half * A),
        2 * half * inner @ B,
        C @ inner,
        D + half * C @ inner @ B,
    )
    return named_system(matrices, dt, ["u"], ["y"], _names(len(A)))


def single_filter(argument: str, value: Any, dt: float | bool) -> control.StateSpace:
    """Return a system of one input and one output that fits the plant's time.

    Parameters
    ----------
    argument : str
        Its name, for messages.
    value : control.StateSpace, control.TransferFunction or float
    dt : float or True
        The plant's sampling time.

    Returns
    -------
    control.StateSpace
    """
    system = as_state_space(argument, value, dt)
    if (system.ninputs, system.noutputs) != (1, 1):
        shown = described(f"{system.ninputs} inputs and {system.noutputs} outputs")
        raise invalid(argument, shown, "one of each", "Give each signal a filter of its own.")
    own = dt if system.dt is None or not system.nstates else system.dt
    if own != dt:
        raise invalid(
            argument,
            described(f"sampling time {system.dt}"),
            f"{dt} like the plant",
            "Discretise it, for instance with control.sample_system.",
        )
    return system


def _sections(order: int, damping: float | None) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return A, B, C of lags of first and second order in a row, in units of the bandwidth."""
    found = [(np.array([[-1.0]]), np.ones((1, 1)), np.ones((1, 1)))] if order % 2 else []
    for k in range(order // 2):
        zeta = math.sin(math.pi * (2 * k + 1) / (2 * order)) if damping is None else damping
        # |G| = 1 / sqrt(2) at 1: w^2 + ... solved for the natural frequency.
        spread = 1 - 2 * zeta**2
        natural = 1.0 if damping is None else 1 / math.sqrt(spread + math.hypot(spread, 1))
        found.append(
            (
                np.array([[0.0, natural], [-natural, -2 * zeta * natural]]),
                np.array([[0.0], [natural]]),
                np.array([[1.0, 0.0]]),
            )
        )
    return found


def _names(count: int) -> list[str]:
    return [f"x[{i}]" for i in range(count)]
