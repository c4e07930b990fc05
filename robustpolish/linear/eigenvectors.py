"""Eigenvectors as LAPACK keeps them, put together by compiled code."""

from __future__ import annotations

import numpy as np

from robustpolish.base.jit import njit


@njit(cache=True, error_model="numpy")
def complex_eigenpairs(real, imag, left, right):  # type: ignore[no-untyped-def]  # compiled
    """Return complex eigenvalues and vectors, and the cosines between left and right ones.

    Parameters
    ----------
    real, imag : ndarray, shape (n,)
        Parts of the eigenvalues; pairs stand together, the positive imaginary part first.
    left, right : ndarray, shape (n, n)
        In the rows: a vector, or the real part of a pair's and below it the imaginary part.

    Returns
    -------
    values : ndarray of complex, shape (n,)
    cosines : ndarray, shape (n,)
    left, right : ndarray of complex, shape (n, n)
        In the rows.
    """
    n = imag.size
    L, R = np.empty((n, n), np.complex128), np.empty((n, n), np.complex128)
    values, cosines = np.empty(n, np.complex128), np.empty(n)
    for k in range(n):
        first, sign = k, np.sign(imag[k])
        if sign < 0.0:
            first = k - 1
        other = first + 1 if sign != 0.0 else first
        values[k], total = complex(real[k], imag[k]), complex(0.0, 0.0)
        for j in range(n):
            L[k, j] = complex(left[first, j], sign * left[other, j])
            R[k, j] = complex(right[first, j], sign * right[other, j])
            total += np.conj(L[k, j]) * R[k, j]
        cosines[k] = abs(total)
    return values, cosines, L, R
