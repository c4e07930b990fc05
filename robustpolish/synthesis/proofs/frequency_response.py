"""The frequency response of a loop at many frequencies, from one Schur form of its state matrix.

With A triangular a frequency takes n^2 steps instead of n^3.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import linalg

from robustpolish.base.arrays import AnyArray, Vector
from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.linear.systems import resolvent_response

# For more frequencies at once the Schur form pays.
_FEW = 4


def responses(A: Matrix, B: Matrix, C: Matrix, D: Matrix, frequencies: Vector) -> AnyArray:
    """Return D + C (i x - A)^-1 B at every frequency x.

    Parameters
    ----------
    A, B, C, D : ndarray
    frequencies : ndarray, shape (k,)
        In rad/s; they may be infinite.

    Returns
    -------
    ndarray of complex, shape (k, p, m)
        Not finite at a pole.
    """
    n, k, m = len(A), len(frequencies), B.shape[1]
    finite = np.isfinite(frequencies)
    if k <= _FEW:
        few = np.tile(D.astype(complex), (k, 1, 1))
        few[finite] = resolvent_response(A, B, C, D, 1j * frequencies[finite])
        return few
    found: Any = linalg.schur(A, output="complex") if n else (A, A)
    triangle, Q = found
    inverse = np.zeros((n, k), complex)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse[:, finite] = 1 / (1j * frequencies[finite] - np.diag(triangle)[:, None])
        # (i x - triangle) X = into, from the last state to the first at all frequencies at once.
        into, X = np.conj(Q.T) @ B, np.zeros((n, k * m), complex)
        for i in range(n - 1, -1, -1):
            row = triangle[i, i + 1 :] @ X[i + 1 :]
            X[i] = ((row.reshape(k, m) + into[i]) * inverse[i][:, None]).ravel()
        return D + (C @ Q) @ X.reshape(n, k, m).transpose(1, 0, 2)
