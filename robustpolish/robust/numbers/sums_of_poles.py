"""What a number adds to the Lyapunov operator, which is singular where two poles have the sum 0."""

from __future__ import annotations

import numpy as np

from robustpolish.arrays import Matrix


def both_sides(B: Matrix) -> tuple[Matrix, Matrix]:
    """Return the matrices from Y, of shape (r, n), to B Y and to Y' B', as (n n, r n).

    Parameters
    ----------
    B : ndarray, shape (n, r)

    Returns
    -------
    left, right : ndarray
        Kept apart, as their entries are those of B and zeros, and nothing is rounded.
    """
    n, r = B.shape
    left = np.einsum("ai,jb->abij", B, np.eye(n)).reshape(n * n, r * n)
    right = np.einsum("bi,ja->abij", B, np.eye(n)).reshape(n * n, r * n)
    return left, right
