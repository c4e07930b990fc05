"""A weight between a gain at low and a gain at high frequencies."""

from __future__ import annotations

import math
from typing import Any

import control
import numpy as np

from robustpolish.models.plant.blocks import named_system
from robustpolish.models.plant.elements import bilinear
from robustpolish.validation import described, invalid, is_whole, positive

MOST_ORDER = 10
# Gains and frequencies beyond it, or below its inverse, have squares that no double holds.
_LARGEST = 1e100


def weight(
    low: float,
    crossover_hz: float,
    high: float,
    order: int = 1,
    *,
    inverse: bool = False,
    dt: float | bool = 0,
) -> control.StateSpace:
    r"""Return a weight that goes from one gain to another and is 1 in between.

    .. math:: W(s) = \left(\frac{h\, s + l\, p}{s + p}\right)^n, \quad
              l = \mathrm{low}^{1/n},\ h = \mathrm{high}^{1/n}

    with p such that \|W\| = 1 at the crossover.

    Parameters
    ----------
    low : float
        Gain at rest; infinite for an integrator, which suits loop shaping but no norm.
    crossover_hz : float
        Where the gain is 1, in Hz.
    high : float
        Gain at high frequencies, on the other side of 1 than `low`.
    order : int, optional
        Number n of equal sections: the steepness, 20 dB per decade each.
    inverse : bool, optional
        Return 1 / W instead: low, crossover and high are then those of a bound that a transfer
        function has to keep, and W its weight.
    dt : float or True, optional
        Sampling time in s; 0 is continuous. Otherwise the bilinear image with the same gain at
        rest, at the crossover and, for `high`, at the Nyquist frequency.

    Returns
    -------
    control.StateSpace
        Stable, with a stable inverse; of n states in a row.

    Raises
    ------
    InvalidInputError
        If 1 does not lie between the gains, or one is negative.

    Notes
    -----
    As MATLAB's ``makeweight(low, [w 1], high)`` with w in rad/s; for order 1 it is the same system.
    Skogestad, Postlethwaite, "Multivariable Feedback Control", 2nd edition, 2005, equation (2.105)
    gives performance weights as (s / M + w_B) / (s + w_B A): ``weight(1 / A, f, 1 / M)``, whose
    crossover f lies near w_B / (2 pi).

    Examples
    --------
    >>> import robustpolish as rp
    >>> W = rp.weight(100.0, 2.0, 0.5)
    >>> [float(abs(W(2j * 3.141592653589793 * f)).round(4)) for f in (0.0, 2.0, 1e6)]
    [100.0, 1.0, 0.5]
    >>> rp.weight(0.01, 2.0, 10.0, order=2, inverse=True).nstates
    2
    """
    low, high = _gain("low", low), _gain("high", high)
    if not isinstance(inverse, bool | np.bool_):
        raise invalid("inverse", inverse, "True or False", "Choose one of them.")
    if inverse:
        if low == 0 or high == 0:
            name, shown = ("low", low) if low == 0 else ("high", high)
            raise invalid(name, shown, "a gain above 0 to be inverted", "Pass a small one.")
        low, high = 1 / low, 1 / high
    if math.isinf(high):
        shown = described("an infinite gain at high frequencies")
        raise invalid("high", shown, "a finite one", "Such a weight is no state-space system.")
    hertz = positive("crossover_hz", crossover_hz, "Hz")
    if not 1 / _LARGEST <= hertz <= _LARGEST:
        want = f"a frequency from {1 / _LARGEST:g} to {_LARGEST:g} Hz"
        raise invalid("crossover_hz", crossover_hz, want, "Check its unit.")
    if not is_whole(order) or not 1 <= order <= MOST_ORDER:
        raise invalid("order", order, f"a whole number from 1 to {MOST_ORDER}", "Take fewer.")
    if not (low > 1 > high or low < 1 < high):
        raise invalid(
            "low",
            described(f"gains {low:g} and {high:g}"),
            "one above and one below 1, which the weight passes at its crossover",
            "For another gain at the crossover multiply the weight by a number.",
        )
    a, b, c, d = _section(low ** (1 / order), high ** (1 / order))
    A, B, C, D = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.ones((1, 1))
    for _ in range(int(order)):
        k = len(A)
        A = np.block([[A, np.zeros((k, 1))], [b * C, np.full((1, 1), a)]])
        B = np.vstack([B, b * D])
        C = np.hstack([d * C, [[c]]])
        D = d * D
    rate = 2 * math.pi * hertz
    if dt is not True:
        dt = positive("dt", dt, "s", zero=True)
    if dt:
        return bilinear(A, B, C, D, dt, rate)
    names = [f"x[{i}]" for i in range(len(A))]
    root = math.sqrt(rate)
    return named_system((A * rate, B * root, C * root, D), 0, ["u"], ["y"], names)


def _section(low: float, high: float) -> tuple[float, float, float, float]:
    """Return a, b, c, d of (high s + low p) / (s + p) with gain 1 at 1 rad/s."""
    if math.isinf(low):
        pole, gain = 0.0, math.sqrt(1 - high**2)  # low p in the limit
    else:
        pole = math.sqrt((1 - high**2) / (low**2 - 1))
        gain = (low - high) * pole
    size = math.sqrt(abs(gain))
    return -pole, size, math.copysign(size, gain), high


def _gain(argument: str, value: Any) -> float:
    """Return a gain from 0 to infinity."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not number >= 0:
        raise invalid(argument, value, "a gain of at least 0", "Pass a ratio, not decibels.")
    if number not in (0.0, math.inf) and not 1 / _LARGEST <= number <= _LARGEST:
        want = f"0, a gain from {1 / _LARGEST:g} to {_LARGEST:g}, or infinity"
        raise invalid(argument, value, want, "Pass a ratio, not decibels.")
    return number
