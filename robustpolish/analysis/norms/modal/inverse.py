"""The inverse of the eigenvectors, and what it makes of inputs and outputs, compiled."""

from __future__ import annotations

import numpy as np

from robustpolish.analysis.poles.eigen import EPS
from robustpolish.compiling import njit


@njit(cache=True, error_model="numpy")
def inverse(left, right):  # type: ignore[no-untyped-def]  # compiled
    """Return X, nearly the inverse of the right vectors V.

    Parameters
    ----------
    left, right : ndarray of complex, shape (n, n)
        Vectors of length one, in the rows.

    Returns
    -------
    X : ndarray of complex, shape (n, n)
    gap : float
        Bound of the row-sum norm of 1 - X V, but for the last digits of the sums. It is no number
        where X is none.
    least : float
        The least cosine between vectors of a pair.
    """
    n = left.shape[0]
    X, least = np.conj(left), np.inf
    for i in range(n):
        cosine = complex(0.0, 0.0)
        for j in range(n):
            cosine += X[i, j] * right[i, j]
        least = min(least, abs(cosine))
        if cosine == 0.0:  # numba would raise an error
            X[i] = np.nan
        else:
            X[i] /= cosine
    return X, _gap(X, right), least


@njit(cache=True, error_model="numpy")
def _gap(X, right):  # type: ignore[no-untyped-def]  # compiled
    n = X.shape[0]
    product = X @ right.T
    sums = np.zeros(n)
    for k in range(n):
        for j in range(n):
            sums[j] += abs(right[k, j])
    largest = 0.0
    for i in range(n):
        off, size = 0.0, 0.0
        for j in range(n):
            off += abs(product[i, j] - (1.0 if i == j else 0.0))
            size += abs(X[i, j]) * sums[j]
        row = off + 4.0 * (n + 4) * EPS * size
        if row > largest or row != row:
            largest = row
    return largest


@njit(cache=True, error_model="numpy")
def signals(X, right, B, C):  # type: ignore[no-untyped-def]  # compiled
    """Return X B after one correction and C V, with estimates of what rounding made of them.

    Parameters
    ----------
    X, right : ndarray of complex, shape (n, n)
    B, C : ndarray of complex, shapes (n, m) and (p, n)

    Returns
    -------
    b, c : ndarray of complex, shapes (n, m) and (p, n)
    b_error, c_error : ndarray, shape (n,)
        Of the rows of b and of the columns of c.
    """
    V = right.T
    b = X @ B
    b = b + X @ (B - V @ b)
    few = 4.0 * EPS * np.sqrt(X.shape[0])
    b_error, whole = np.empty(X.shape[0]), few * _size(B)
    for i in range(X.shape[0]):
        b_error[i] = whole * _size(X[i : i + 1])
    return b, C @ V, b_error, np.full(X.shape[0], few * _size(C))


@njit(cache=True, error_model="numpy")
def products(b, c, b_error, c_error, outward):  # type: ignore[no-untyped-def]  # compiled
    """Return what each mode carries from the inputs to the outputs, with bounds.

    Parameters
    ----------
    b, c : ndarray of complex, shapes (n, m) and (p, n)
    b_error, c_error : ndarray, shape (n,)
        Of the rows of b and of the columns of c.
    outward : float
        What the bounds are multiplied by, as their own sums are rounded.

    Returns
    -------
    residues : ndarray of complex, shape (n, p * m)
    shown, moved : ndarray, shape (n,)
        Norms of the columns of c and of the rows of b.
    bounds : ndarray, shape (3, n)
        Of these two, errors included, and of what the errors make of each residue.
    """
    n, m, p = b.shape[0], b.shape[1], c.shape[0]
    residues, bounds = np.empty((n, p * m), np.complex128), np.empty((3, n))
    shown, moved = np.empty(n), np.empty(n)
    for k in range(n):
        shown[k], moved[k] = _size(c[:, k : k + 1]), _size(b[k : k + 1])
        for i in range(p):
            for j in range(m):
                residues[k, i * m + j] = c[i, k] * b[k, j]
        bounds[0, k] = (shown[k] + c_error[k]) * outward
        bounds[1, k] = (moved[k] + b_error[k]) * outward
        bounds[2, k] = (shown[k] * b_error[k] + c_error[k] * (moved[k] + b_error[k])) * outward
    return residues, shown, moved, bounds


@njit(cache=True, error_model="numpy")
def _size(M):  # type: ignore[no-untyped-def]  # compiled
    square = 0.0
    for i in range(M.shape[0]):
        for j in range(M.shape[1]):
            square += M[i, j].real ** 2 + M[i, j].imag ** 2
    return np.sqrt(square)
