"""Coloured sensor noise: autoregressive models of what an observer leaves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def resonates(a: Array) -> bool:
    """Return whether a noise model has a lightly damped mode: that is a machine, not a sensor."""
    roots = np.roots(a)
    roots = roots[(np.abs(roots) > 0.3) & (np.abs(roots.imag) > 1e-3)]
    s = np.log(roots.astype(complex))
    return bool(np.any(-np.real(s) / np.abs(s) < 0.35))


def autoregression(e: Array, order: int) -> Array:
    """Return the whitening filter of an autoregressive fit."""
    if order == 0:
        return np.ones(1)
    n = len(e)
    r = np.array([e[: n - k] @ e[k:] for k in range(order + 1)]) / n
    R = r[np.abs(np.subtract.outer(np.arange(order), np.arange(order)))]
    a = np.linalg.solve(R + 1e-10 * r[0] * np.eye(order), r[1:])
    return np.concatenate([[1.0], -a])
