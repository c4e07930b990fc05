"""Units in which the entries of a system are near one, and complex eigenvectors: compiled loops.

Those of units work in place on the four matrices as one, [[A, B], [C, D]], and on the exponents
which its rows and columns have been given. A power that pushes an entry out of the range of doubles
loses it, so that :func:`is_exact_scaling` has to have the last word.
"""

from __future__ import annotations

import math

import numpy as np

from robustpolish.base.jit import njit
from robustpolish.linear.systems import MOST_EXPONENT, nearest_exponent

# Squares of numbers between these neither overflow nor vanish.
_SMALL, _BIG = 1e-140, 1e140
# LAPACK's dgebal does not move a scale beyond these, nor for less than a twentieth of the size.
_LEAST_UNIT, _MOST, _WORTH = 2.0**-969, 2.0**969, 0.95
_nearest = njit(cache=True)(nearest_exponent)


@njit(cache=True, error_model="numpy")
def equilibrate_states(M, n, rows, columns, continuous):  # type: ignore[no-untyped-def]  # compiled
    """Bring the largest entry of A near one, then balance the states; return the exponent of time.

    The largest entry comes first, so that squares neither overflow nor vanish.
    """
    unit = _nearest(np.abs(M[:n, :n]).max()) if continuous else 0
    _slow_down(M, n, rows, unit)
    balance(M, n, rows, columns, False)
    return unit


@njit(cache=True, error_model="numpy")
def equilibrate_signals(M, n, rows, columns, unit):  # type: ignore[no-untyped-def]  # compiled
    """Divide rates by 2**unit, balance states and signals together; return exponents of the gain.

    Three of them, in turn: their product may leave the range of doubles where their sum would not.
    """
    _slow_down(M, n, rows, unit)
    first = _even_gains(M, n, rows, columns)
    balance(M, n, rows, columns, True)
    second = _even_gains(M, n, rows, columns)
    balance(M, n, rows, columns, True)
    return first, second, _even_gains(M, n, rows, columns)


@njit(cache=True, error_model="numpy")
def is_exact_scaling(M, rows, columns, given, largest):  # type: ignore[no-untyped-def]  # compiled
    """Whether the entries are what was given times the powers, and none is above `largest`."""
    for i in range(M.shape[0]):
        for j in range(M.shape[1]):
            if not abs(M[i, j]) <= largest:
                return False
            if math.ldexp(M[i, j], -(rows[i] + columns[j])) != given[i, j]:
                return False
    return True


@njit(cache=True, error_model="numpy")
def _slow_down(M, n, rows, unit):  # type: ignore[no-untyped-def]  # compiled
    """Divide the rates of all states by a power of two."""
    if unit:
        M[:n] *= 2.0**-unit
        rows[:n] -= unit


@njit(cache=True, error_model="numpy")
def _even_gains(M, n, rows, columns):  # type: ignore[no-untyped-def]  # compiled
    """Bring the sizes of B and C near one; return the exponent that they lose."""
    b, c = _nearest(_size(M[:n, n:])), _nearest(_size(M[n:, :n]))
    M[:n, n:] *= 2.0**-b
    M[n:, :n] *= 2.0**-c
    for i in range(n, M.shape[0]):
        for j in range(n, M.shape[1]):
            M[i, j] = math.ldexp(M[i, j], -(b + c))
    columns[n:] -= b
    rows[n:] -= c
    return b + c


@njit(cache=True, error_model="numpy")
def balance(M, n, rows, columns, signals):  # type: ignore[no-untyped-def]  # compiled
    """Even the sizes of the rows and columns of the first `n`, as LAPACK's dgebal does.

    With `signals`, B and C belong to the rows and columns, and all inputs together with all outputs
    are treated as one more state, because only a common factor of them may be traded for a gain.
    """
    moved = True
    while moved:
        moved = False
        for i in range(n + 1 if signals else n):
            if i == n:
                column, row = M[:n, n:], M[n:, :n]
            elif signals:
                column, row = M[:, i : i + 1], M[i : i + 1]
            else:
                column, row = M[:n, i : i + 1], M[i : i + 1, :n]
            power = _evening(_size(column), _size(row), columns[i] if i < columns.size else 0)
            if power:
                moved = True
                _move(M, n, i, power)
                columns[i : columns.size if i == n else i + 1] += power
                rows[i : rows.size if i == n else i + 1] -= power


@njit(cache=True, error_model="numpy")
def _evening(c, r, so_far):  # type: ignore[no-untyped-def]  # compiled
    """Return the exponent for a column of size `c` that makes it as large as its row."""
    if not (c > 0.0 and r > 0.0 and c < np.inf and r < np.inf):
        return 0
    before, power = c + r, 0
    while c < r / 2.0 and max(2.0**power, c) < _MOST and r > _LEAST_UNIT:
        power, c, r = power + 1, 2.0 * c, r / 2.0
    while c / 2.0 >= r and r < _MOST and min(2.0**power, c / 2.0) > _LEAST_UNIT:
        power, c, r = power - 1, c / 2.0, 2.0 * r
    if c + r >= _WORTH * before or abs(so_far + power) > MOST_EXPONENT:
        return 0
    return power


@njit(cache=True, error_model="numpy")
def _move(M, n, i, power):  # type: ignore[no-untyped-def]  # compiled
    """Multiply the column of a state (or of all signals) by a power of two, and divide its row."""
    factor, back = 2.0**power, 2.0**-power
    if i == n:
        M[:n, n:] *= factor
        M[n:, :n] *= back
        return
    itself = M[i, i]
    M[:, i] *= factor
    M[i] *= back
    M[i, i] = itself


@njit(cache=True, error_model="numpy")
def _size(M):  # type: ignore[no-untyped-def]  # compiled
    """Return the Frobenius norm, without overflow."""
    largest = 0.0
    for x in M.flat:
        largest = max(largest, abs(x))
    if not (largest > 0.0 and largest < np.inf):
        return largest
    unit = 1.0 if _SMALL < largest < _BIG else largest
    total = 0.0
    for x in M.flat:
        total += (x / unit) ** 2
    return unit * math.sqrt(total)


# Eigenvectors as LAPACK keeps them, put together.


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
