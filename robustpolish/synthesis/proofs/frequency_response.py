"""The frequency response of a large loop at many frequencies, from one reduction of its states.

With A in Hessenberg form a frequency takes n^2 steps instead of n^3.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import linalg

from robustpolish.base.arrays import AnyArray, Array
from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.jit import njit


def responses(A: Matrix, B: Matrix, C: Matrix, D: Matrix, frequencies: Array) -> AnyArray:
    """Return D + C (i x - A)^-1 B at every frequency x.

    Parameters
    ----------
    A, B, C, D : ndarray
    frequencies : ndarray, shape (k,)
        In rad/s, finite.

    Returns
    -------
    ndarray of complex, shape (k, p, m)
        Not finite where a pole is hit.

    Notes
    -----
    A. J. Laub, IEEE Transactions on Automatic Control 26 (1981) 407-408.
    """
    H, Q = linalg.hessenberg(A, calc_q=True)  # type: ignore[misc]
    compiled: Any = _responses
    H, B, C = (np.ascontiguousarray(M) for M in (H, Q.T @ B, C @ Q))
    return compiled(H, B, C.astype(complex), D.astype(complex), frequencies)


@njit(cache=True, error_model="numpy")
def _responses(H, B, C, D, frequencies):  # type: ignore[no-untyped-def]  # compiled
    """Eliminate the entries below the diagonal, then substitute backwards."""
    n, m = B.shape
    found = np.empty((frequencies.size, *D.shape), np.complex128)
    R, X = np.empty((n, n), np.complex128), np.empty((n, m), np.complex128)
    for f in range(frequencies.size):
        s = 1j * frequencies[f]
        for k in range(n):
            first = max(k - 1, 0)
            for j in range(first, n):
                R[k, j] = -H[k, j]
            R[k, k] += s
            X[k] = B[k]
            if k:
                _eliminate(R[k - 1, first:], X[k - 1], R[k, first:], X[k])
        for k in range(n - 1, -1, -1):
            if R[k, k] == 0.0:  # numba would raise an error where complex numbers are divided by it
                X[:] = np.nan
                break
            for i in range(m):
                total = X[k, i]
                for j in range(k + 1, n):
                    total -= R[k, j] * X[j, i]
                X[k, i] = total / R[k, k]
        found[f] = D + C @ X
    return found


@njit(cache=True, error_model="numpy")
def _eliminate(row, right, below, right_below):  # type: ignore[no-untyped-def]  # compiled
    """Let the larger first entry stand in the row, and take its multiple from the row below."""
    if abs(below[0]) > abs(row[0]):
        for j in range(row.size):
            row[j], below[j] = below[j], row[j]
        for i in range(right.size):
            right[i], right_below[i] = right_below[i], right[i]
    if below[0] == 0.0:
        return
    share = below[0] / row[0]
    for j in range(1, row.size):
        below[j] -= share * row[j]
    for i in range(right.size):
        right_below[i] -= share * right[i]
