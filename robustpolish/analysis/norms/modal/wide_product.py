"""Products of matrices with more digits than doubles have, and bounds of their errors."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from robustpolish.arrays import AnyArray, Matrix

Wide: Any = np.longdouble
WIDE = float(np.finfo(Wide).eps)
"""Rounding unit of extended precision; that of doubles where the machine has no more."""

_SLICES = 3
# From so many columns on, sliced products are quicker than sums in extended precision.
_SLICED = 64


def wide_product(M: Matrix, V: AnyArray) -> tuple[AnyArray, Matrix]:
    """Multiply a real and a complex matrix.

    Large matrices are cut into slices of so few digits that doubles hold the products of these
    exactly, in whatever order they are summed [1]_.

    Returns
    -------
    product : ndarray of complex extended precision
    error : ndarray
        Bounds of the errors' magnitudes.

    References
    ----------
    .. [1] K. Ozaki, T. Ogita, S. Oishi, S. M. Rump, "Error-free transformations of matrix
       multiplication by using fast routines of matrix multiplication and its applications",
       Numerical Algorithms 59 (2012) 95-118.
    """
    inner, columns = V.shape
    if inner < _SLICED or columns < _SLICED:
        rounding = 4 * (inner + 8) * WIDE * (np.abs(M) @ np.abs(V))
        return _summed(M, np.real(V)) + 1j * _summed(M, np.imag(V)), rounding
    both, error = _sliced_product(M, np.hstack([np.real(V), np.imag(V)]))
    bound = error[:, :columns] + error[:, columns:]
    return both[:, :columns] + 1j * both[:, columns:], bound


def _summed(M: Matrix, V: Matrix) -> AnyArray:
    """Sum in extended precision, along memory."""
    rows, columns = np.ascontiguousarray(M, Wide), np.ascontiguousarray(V.T, Wide)
    return np.einsum("ij,kj->ik", rows, columns)


def _sliced_product(M: Matrix, V: Matrix) -> tuple[AnyArray, Matrix]:
    inner, columns = V.shape
    left, left_sizes = _slices(M, inner)
    turned, right_sizes = _slices(V.T, inner)
    right = [part.T for part in turned]
    total = np.zeros((M.shape[0], columns), Wide)
    for i in reversed(range(_SLICES)):  # the small ones first
        exact = left[i] @ np.hstack(right[: _SLICES - i])
        for j in reversed(range(_SLICES - i)):
            total += exact[:, j * columns : (j + 1) * columns]
    # What was left out: pairs of small slices, and what the slices do not hold.
    pairs = [(i, j) for i in range(_SLICES + 1) for j in range(_SLICES + 1) if i + j >= _SLICES]
    error = sum(np.outer(left_sizes[i], right_sizes[j]) for i, j in pairs) * inner
    rounding = 4 * _SLICES**2 * WIDE * inner * np.outer(left_sizes[0], right_sizes[0])
    return total, (error + rounding) * (1 + 1e-9)


def _slices(M: Matrix, inner: int) -> tuple[list[Matrix], list[Matrix]]:
    """Cut off the leading digits of each row in turn; return the largest entries of the rows too.

    The last of these belong to what remains.
    """
    digits = math.ceil((54 + math.log2(inner)) / 2)
    rest, parts, sizes = M, [], []
    for _ in range(_SLICES):
        size = np.abs(rest).max(axis=1, initial=0.0)
        _, exponent = np.frexp(size)
        shift = np.ldexp(1.0, exponent + digits)[:, None]
        part = (rest + shift) - shift
        rest = rest - part
        parts.append(part)
        sizes.append(np.maximum(size, np.abs(part).max(axis=1, initial=0.0)))
    return parts, [*sizes, np.abs(rest).max(axis=1, initial=0.0)]
