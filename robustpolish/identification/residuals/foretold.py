"""How much of a force follows from the motion at one place."""

from __future__ import annotations

import numpy as np

from robustpolish.arrays import Array


def foretold(q: Array, v: Array, force: Array, bins: int = 12, blocks: int = 20) -> float:
    """Return the share of a force's power that the map of one half of a record says of the other.

    Parameters
    ----------
    q, v, force : ndarray, shape (samples,)
        Displacement, velocity and force; NaN forces follow from nothing.
    bins : int, optional
        Cells of the map in each direction.
    blocks : int, optional
        Stretches of the record that belong to one half and to the other in turn.

    Returns
    -------
    float
        From 0 to 1. Cells that only one half visits count as foretold to be zero.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> time = np.arange(4000) / 100
    >>> q, v = np.sin(time) + 0.3 * np.sin(7.3 * time), np.cos(time) + 2.2 * np.cos(7.3 * time)
    >>> foretold(q, v, np.sign(v)) > 0.9, foretold(q, v, rng.standard_normal(4000)) < 0.05
    (True, True)
    """
    total = float(np.sum(force**2))
    if not 0 < total < np.inf:
        return 0.0
    cell = bins * _cells(q, bins) + _cells(v, bins)
    half = (np.arange(force.size) * blocks // force.size) % 2
    left = 0.0
    for this in (0, 1):
        other = half != this
        count = np.bincount(cell[other], minlength=bins**2)
        mean = np.bincount(cell[other], force[other], bins**2) / np.maximum(count, 1)
        left += float(np.sum((force[~other] - mean[cell[~other]]) ** 2))
    return float(np.clip(1 - left / total, 0.0, 1.0))


def _cells(values: Array, bins: int) -> np.ndarray:
    edges = np.linspace(values.min(), values.max(), bins + 1)
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, bins - 1)
