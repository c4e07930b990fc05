"""What inputs are between their samples: held, linear or smooth, and late or not.

A run takes every input for a line over each of its steps. One that is not gets the line with the
same mean and the same first moment in that step. So the velocity of a mass at the end of it is
right, and its displacement, whatever the force did in between: it matters where in a step a force
acts to second order only, by what springs and dampers do meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from robustpolish.arrays import Array

HELD, LINEAR, SMOOTH = 0.0, 1.0, 3.0
_DIGITS = 9
"""Of a delay in samples: a whole number of them is one in spite of rounding."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)


class Lines(NamedTuple):
    """What signals are at the beginning and the end of the step after each sample.

    Attributes
    ----------
    begin, end : ndarray, shape (samples, signals)
        The step after the last sample is not run.
    """

    begin: Array
    end: Array


def lines_through(W: Array) -> Lines:
    """Return the lines between the samples of signals that are linear, W of shape (samples, n)."""
    return Lines(W, np.concatenate([W[1:], W[-1:]]))


def between(u: Array, step: float, order: float, delay: float) -> tuple[Array, Array, Array]:
    """Return a signal as it acts, from its record.

    Parameters
    ----------
    u : ndarray, shape (samples,)
        The record.
    step : float
        Time between samples in s.
    order : float
        0 if it is held until the next sample, 1 if it is linear, 3 if it is smooth.
    delay : float
        Time in s by which it acts later, moved as a whole. What was before the record is its first
        sample.

    Returns
    -------
    at_samples, begin, end : ndarray, shape (samples,)
        At the samples, and the line over the step after each of them.

    Examples
    --------
    >>> at, begin, end = between(np.array([0.0, 1.0, 0.0]), 1.0, 0.0, 0.0)
    >>> begin.round(9).tolist(), end.round(9).tolist()
    ([0.0, 1.0, 0.0], [0.0, 1.0, 0.0])
    """
    signal = _signal(u, order)
    samples = np.arange(u.size, dtype=float)
    late = float(np.round(delay / step, _DIGITS))
    kink = late % 1.0  # where in a step the record has its samples
    mean, slope = np.zeros(u.size), np.zeros(u.size)
    for a, b in ((0.0, kink), (kink, 1.0)):
        for node, weight in zip(_NODES, _WEIGHTS, strict=True):
            x = (a + b) / 2 + (b - a) / 2 * node
            value = (b - a) / 2 * weight * signal(samples + (x - late))
            mean += value
            slope += 12 * (x - 0.5) * value
    return signal(samples - late), mean - slope / 2, mean + slope / 2


def _signal(u: Array, order: float) -> Callable[[Array], Array]:
    """Return a record as a function of the number of samples that have passed."""
    last = u.size - 1
    if order == HELD:
        return lambda k: u[np.clip(np.floor(k), 0, last).astype(int)]
    if order == SMOOTH:
        spline = CubicSpline(np.arange(u.size), u)
        return lambda k: np.asarray(spline(np.clip(k, 0, last)))
    return lambda k: np.interp(k, np.arange(u.size), u)
