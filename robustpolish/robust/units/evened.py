"""Units of nodes of a network that make what each does to others like what others do to it.

They follow from the network: whatever units its nodes came in, the numbers are the same in the
end, but for rounding. Powers of two would not be: a thousand is none.
"""

from __future__ import annotations

import numpy as np

from robustpolish.arrays import AnyArray, Matrix, Vector

# A node that acts one way only would get smaller for ever: by a factor of e in each two steps.
_STEPS = 28
_SETTLED = 1e-13
# Directions that matter less than this, relative, are left as the first guess has them.
_FLAT = 1e-12


def evened(sizes: Matrix) -> Vector:
    """Return units d that make rows and columns of ``sizes_ij d_j / d_i`` equal in norm.

    Parameters
    ----------
    sizes : ndarray, shape (n, n)
        How much node j does to node i, at least 0. What is on the diagonal does not matter.

    Returns
    -------
    ndarray, shape (n,)
        With a geometric mean of 1.

    Notes
    -----
    Osborne's units [1]_ make the sum of squares off the diagonal least, which is a convex problem
    in their logarithms: Newton's method solves it, from units that make logarithms of the entries
    small [2]_.

    References
    ----------
    .. [1] E. E. Osborne, "On pre-conditioning of matrices", Journal of the ACM 7 (1960) 338-345.
    .. [2] A. R. Curtis, J. K. Reid, "On the automatic scaling of matrices for Gaussian
       elimination", IMA Journal of Applied Mathematics 10 (1972) 118-124.
    """
    n = len(sizes)
    used = (sizes > 0) & ~np.eye(n, dtype=bool)
    if not used.any():
        return np.ones(n)
    logs = np.log(np.where(used, sizes, 1.0))
    links = used.astype(float) + used.T
    pull = logs.sum(axis=1) - logs.sum(axis=0)
    y = _solved(np.diag(links.sum(axis=1)) - links, pull)
    value, squares = _squares(logs, used, y)
    for _ in range(_STEPS):
        out, into = squares.sum(axis=0), squares.sum(axis=1)
        curvature = 2 * (np.diag(out + into) - squares - squares.T)
        step = _solved(curvature, into - out)
        length, moved = 1.0 / max(1.0, float(np.abs(step).max())), False
        while length > 1e-6 and not moved:
            after, trial = _squares(logs, used, y + length * step)
            moved = after <= value
            if moved:
                y, value, squares = y + length * step, after, trial
            length /= 2
        if not moved or np.abs(step).max() < _SETTLED:
            break
    return np.exp(y - y.mean())


def _squares(logs: Matrix, used: AnyArray, y: Vector) -> tuple[float, Matrix]:
    """Return the logarithm of the sum of squares, and all of them as shares of it."""
    exponents = np.where(used, 2 * (logs + y - y[:, None]), -np.inf)
    largest = exponents.max()
    squares = np.exp(exponents - largest)
    total = float(squares.sum())
    return float(largest + np.log(total)), squares / total


def _solved(matrix: Matrix, right: Vector) -> Vector:
    return np.linalg.lstsq(matrix, right, rcond=_FLAT)[0].astype(float)
