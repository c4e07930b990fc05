"""What effects on signals do to them: as a linear model keeps it, and over time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from robustpolish.arrays import Array


class SignalSlope(NamedTuple):
    """What a linear model keeps of an effect on an input or an output.

    Attributes
    ----------
    gain : float
    delay : float
        In s.
    lag : float
        Time constant of a first-order lag in s.
    """

    gain: float = 1.0
    delay: float = 0.0
    lag: float = 0.0


class Timing(NamedTuple):
    """When the samples of an input act, of an effect that changes only that.

    Attributes
    ----------
    order : float or None
        Of the hold between them: 0 held, 1 linear, 3 smooth; None if it says nothing about that.
    delay : float
        In s.
    lag : float
        Time constant in s with which it follows them.
    """

    order: float | None = None
    delay: float = 0.0
    lag: float = 0.0


def lagged(begin: Array, end: Array, step: float, lag: float) -> Array:
    """Return a signal behind a first-order lag, at its samples: exact for lines between them.

    Parameters
    ----------
    begin, end : ndarray, shape (samples,)
        The line over the step after each sample.
    step, lag : float
        Time between samples and time constant, in s.

    Returns
    -------
    ndarray, shape (samples,)
        It has followed the first sample for long.

    Examples
    --------
    >>> ramp = np.arange(4.0)
    >>> (ramp - lagged(ramp, ramp + 1, 1.0, 0.1)).round(3).tolist()
    [0.0, 0.1, 0.1, 0.1]
    """
    if not lag > 0:
        return begin
    kept = np.exp(-step / lag)
    behind = (end - begin) * (lag / step)
    driven = end - behind - kept * (begin - behind)
    return np.asarray(lfilter([1.0], [1.0, -kept], np.concatenate([begin[:1], driven[:-1]])))
