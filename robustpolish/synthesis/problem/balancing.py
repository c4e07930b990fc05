"""Balancing by powers of two."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

Matrix = NDArray[Any]


def balancing_scale(size: Matrix) -> Matrix:
    """Return s such that the rows and columns of size * s / s[:, None] are alike in size.

    Parameters
    ----------
    size : ndarray, shape (n, n)
        Absolute values count only. Where an entry is not finite nothing is scaled.

    Returns
    -------
    ndarray, shape (n,)
        Powers of two.
    """
    if not (size.size and np.isfinite(size).all()):
        return np.ones(len(size))
    # SciPy casts permutation indices that were never set, and may complain about their values.
    with np.errstate(invalid="ignore"):
        _, (scale, _) = linalg.matrix_balance(size, permute=False, separate=True)
    return np.asarray(scale)
