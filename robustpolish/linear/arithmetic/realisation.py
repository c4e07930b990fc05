"""State-space matrices as plain arrays, rescaled by powers of two so that nothing is rounded.

Compiled loops find the units in which the entries of a system are near one. They work in place on
the four matrices as one, [[A, B], [C, D]], and on the exponents which its rows and columns have
been given. A power that pushes an entry out of the range of doubles loses it, so that
:func:`is_exact_scaling` has to have the last word.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import control
import numpy as np
from scipy.linalg import lapack

from robustpolish.base.arrays import AnyMatrix, Matrix
from robustpolish.base.checks import state_space
from robustpolish.base.jit import njit
from robustpolish.linear.arithmetic.powers_of_two import (
    LARGEST,
    MOST_EXPONENT,
    FloatRangeError,
    entry_range_error,
    nearest_exponent,
)

# Squares of numbers between these neither overflow nor vanish.
_SMALL, _BIG = 1e-140, 1e140
# LAPACK's dgebal does not move a scale beyond these, nor for less than a twentieth of the size.
_LEAST_UNIT, _MOST_UNIT, _WORTH = 2.0**-969, 2.0**969, 0.95
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
    while c < r / 2.0 and max(2.0**power, c) < _MOST_UNIT and r > _LEAST_UNIT:
        power, c, r = power + 1, 2.0 * c, r / 2.0
    while c / 2.0 >= r and r < _MOST_UNIT and min(2.0**power, c / 2.0) > _LEAST_UNIT:
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


_lapack: Any = lapack


@dataclass(frozen=True, eq=False)
class Realisation:
    """The matrices of a system in scaled units, and how to come back.

    Attributes
    ----------
    A, B, C, D : ndarray
        Scaled matrices; every scale is a power of two, so they are exact.
    discrete : bool
        True for discrete time.
    step : float
        Sampling time in s (1 if none was given); 1 in continuous time.
    time : float
        Scaled frequency times `time` is rad/s; 1 in discrete time.
    gain : float
        Scaled gain times `gain` is the gain of the original system.
    """

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    discrete: bool
    step: float = 1.0
    time: float = 1.0
    gain: float = 1.0

    @property
    def states(self) -> int:
        """Number of states."""
        return self.A.shape[0]

    @property
    def matrices(self) -> dict[str, Matrix]:
        """A, B, C and D by name."""
        return {"A": self.A, "B": self.B, "C": self.C, "D": self.D}


def realisation(argument: str, system: Any) -> Realisation:
    """Read a validated ``control.StateSpace``; an unspecified `dt` means continuous time."""
    system = state_space(argument, system)
    n, m, p = system.nstates, system.ninputs, system.noutputs
    discrete = bool(system.isdtime(strict=True))
    step = 1.0 if system.dt is None or system.dt is True or not discrete else float(system.dt)
    shapes = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
    A, B, C, D = (
        np.array(getattr(system, name), dtype=float).reshape(s) for name, s in shapes.items()
    )
    return Realisation(A, B, C, D, discrete, step)


def named_like(
    system: control.StateSpace, A: Matrix, B: Matrix, C: Matrix, D: Matrix
) -> control.StateSpace:
    """Return a system of these matrices with the sampling time and names of another."""
    kinds = ("state", "input", "output")
    names: dict[str, Any] = {f"{kind}s": getattr(system, f"{kind}_labels") for kind in kinds}
    return control.StateSpace(A, B, C, D, system.dt, remove_useless_states=False, **names)


def power_of_two(value: float) -> float:
    """Return the power of two nearest to a positive `value`; 1 for zero and infinity."""
    return 2.0 ** nearest_exponent(value)


# Squares between these neither overflow nor lose digits.
_LEAST, _MOST = 1e-260, 1e260
_LEAST_NORMAL = float(np.finfo(float).tiny)


def size(M: AnyMatrix) -> float:
    """Return the Frobenius norm, without overflow."""
    square = np.vdot(M, M).real
    if _LEAST < square < _MOST:
        return math.sqrt(square)
    largest = float(np.abs(M).max(initial=0.0))
    if largest == 0 or not math.isfinite(largest):
        return largest
    return largest * float(np.linalg.norm(M / largest))


def state_scales(
    A: Matrix, B: Matrix | None = None, C: Matrix | None = None
) -> tuple[Matrix, float]:
    """Balance A by powers of two, together with B and C if they are given.

    All inputs together, and all outputs together, are treated as one more
    state, because only a common factor of them may be traded for a gain.

    Returns
    -------
    scales : ndarray of shape (n,)
        x = scales * (scaled x).
    signal : float
        B is multiplied by `signal` and C divided by it.
    """
    from robustpolish.linear.arithmetic.realisation import balance

    n, signals = A.shape[0], False
    M = np.array(A, dtype=float, order="C")
    if B is not None and C is not None:
        M, signals = np.zeros((n + C.shape[0], n + B.shape[1])), True
        M[:n, :n], M[:n, n:], M[n:, :n] = A, B, C
    if not np.isfinite(M).all():
        raise FloatRangeError
    rows, columns = (np.zeros(size, np.int64) for size in M.shape)
    balance(M, n, rows, columns, signals)
    scales = np.ldexp(1.0, columns)
    return scales[:n], float(scales[n]) if scales.size > n else 1.0


def rescaled(system: Realisation) -> Realisation:
    """Balance the states, then choose units of time and gain that make the entries near one."""
    if system.states == 0:
        return system
    # Imports Numba, which what only holds a realisation does without.
    from robustpolish.linear.arithmetic.realisation import (
        equilibrate_signals,
        equilibrate_states,
        is_exact_scaling,
    )

    n, m, p = system.states, system.B.shape[1], system.C.shape[0]
    given = np.empty((n + p, n + m))
    given[:n, :n], given[:n, n:] = system.A, system.B
    given[n:, :n], given[n:, n:] = system.C, system.D
    M, rows, columns = given.copy(), np.zeros(n + p, np.int64), np.zeros(n + m, np.int64)
    rates = [equilibrate_states(M, n, rows, columns, not system.discrete), 0]
    if not system.discrete:
        rates[1] = nearest_exponent(typical_rate(M[:n, :n]))
    gains = equilibrate_signals(M, n, rows, columns, rates[1])
    try:
        time, gain = _times(system.time, rates), _times(system.gain, gains)
    except OverflowError:
        time = gain = math.inf
    known = _LEAST_NORMAL <= time < math.inf and 0 < gain < math.inf
    if not (known and is_exact_scaling(M, rows, columns, given, LARGEST)):
        raise entry_range_error("system", system.matrices)
    A, B, C, D = M[:n, :n].copy(), M[:n, n:].copy(), M[n:, :n].copy(), M[n:, n:].copy()
    return Realisation(A, B, C, D, system.discrete, system.step, time, gain)


def _times(value: float, exponents: Iterable[int]) -> float:
    """Multiply by powers of two, one after the other, none of which may leave the doubles."""
    for exponent in exponents:
        value = math.ldexp(value, exponent)
        if value == 0:
            raise OverflowError
    return value


def typical_rate(A: Matrix) -> float:
    """Return the geometric mean of the magnitudes of the eigenvalues that are not zero."""
    if not A.size:
        return 1.0
    factors = _lapack.dgetrf(A)[0]  # silent where A is singular
    pivots = [abs(pivot) for pivot in factors.diagonal().tolist()]
    if min(pivots) > 1e-6 * max(pivots):  # no eigenvalue is nearly zero
        return math.exp(sum(map(math.log, pivots)) / len(pivots))
    rates = np.abs(np.linalg.eigvals(A))
    rates = rates[rates > np.finfo(float).eps * size(A)]
    return float(np.exp(np.mean(np.log(rates)))) if rates.size else 1.0
