"""The steps in which a sensor counts: what it rounds away is noise, even where nothing moves."""

from __future__ import annotations

import numpy as np

from robustpolish.arrays import Array

_OFF = 0.02
"""Share of a step by which distances between values may be off whole numbers of them."""
_SAME = 1e-9
"""Of the range: values that are nearer than that differ by rounding in the file."""
_FEWEST = 8
"""Distances that have to be whole numbers of steps."""


def rounding(y: Array) -> float:
    """Return the standard deviation of what rounding to the steps of a sensor does to its signal.

    Parameters
    ----------
    y : ndarray, shape (samples,)

    Returns
    -------
    float
        A step over the square root of 12; 0 if the values lie on no grid.

    Examples
    --------
    >>> y = np.round(np.sin(np.arange(100.0)), 1)
    >>> round(rounding(y) * 12**0.5, 6)
    0.1
    >>> rounding(np.sin(np.arange(100.0)))
    0.0
    """
    distances = np.diff(np.unique(y))
    distances = distances[distances > _SAME * np.ptp(y)] if distances.size else distances
    if distances.size < _FEWEST:
        return 0.0
    step = float(np.min(distances))
    step = float(np.mean(distances[distances < 1.5 * step]))
    counts = distances / step
    if np.max(np.abs(counts - np.round(counts))) > _OFF:
        return 0.0
    return step / float(np.sqrt(12))
