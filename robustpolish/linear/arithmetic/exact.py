"""Systems without rounding: powers of two as units, realisations, and rational arithmetic."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import acb, arb, arb_mat, fmpq, fmpq_mat, fmpz, fmpz_mat, nmod, nmod_mat
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import lapack

from robustpolish.base.arrays import EPS, AnyMatrix, Matrix
from robustpolish.base.checks import described, invalid, square
from robustpolish.errors import InvalidInputError
from robustpolish.linear.arithmetic.balls import is_definite, precision, transfer_matrix
from robustpolish.linear.systems import Realisation, nearest_exponent

# Powers of two as factors that round nothing, and the refusal where doubles end.
#
# A double has exponents from -1074 to 1023. A factor that is a power of two changes the exponent
# alone, unless the product leaves that range: then something became infinite, or zero, or lost
# bits.
# Nothing that is computed afterwards would be true, so that is an error and not a result.


LARGEST = 1e100
"""Entries above it, in units that make a system as even as it can be, are refused: the third power
of what is computed with them still has to be a double."""

# The smallest double with all its bits.
_TINY = float(np.finfo(float).tiny)


class FloatRangeError(InvalidInputError):
    """A number that is computed on the way and that no double holds."""

    def __init__(self) -> None:
        super().__init__(
            "the numbers of the system are too far apart for double precision. Choose other units "
            "for states, signals or time, and write 0 for what is nothing."
        )


def scaled(M: Any, *factors: Any) -> Matrix:
    """Return a matrix times powers of two, exactly.

    Parameters
    ----------
    M : ndarray
    *factors : float or ndarray
        Powers of two, broadcast against `M`; their own product may leave the range of doubles.

    Returns
    -------
    ndarray

    Raises
    ------
    FloatRangeError
        If an entry overflows, vanishes or loses bits.

    Examples
    --------
    >>> import numpy as np
    >>> scaled(np.array([[3.0]]), 2.0**1000, 2.0**-999)
    array([[6.]])
    >>> scaled(np.array([[1.0]]), 2.0**-1000, 2.0**-1000)
    Traceback (most recent call last):
    ...
    robustpolish.linear.arithmetic.exact.FloatRangeError: the numbers of the system...
    """
    by: Any = 0
    for factor in factors:
        if not np.all((factor > 0) & np.isfinite(factor)):
            raise FloatRangeError
        by = by + np.frexp(factor)[1] - 1
    with np.errstate(over="ignore", under="ignore"):
        found = np.ldexp(M, by)
        if not np.array_equal(np.ldexp(found, -by), M):
            raise FloatRangeError
    return found


def bracket(value: float, lower: float, upper: float, factor: float) -> tuple[float, float, float]:
    """Return a number and its bounds times a factor, bounds that stay true where doubles end.

    Parameters
    ----------
    value, lower, upper : float
        At least zero.
    factor : float
        Above zero; what is smaller than all normal doubles has lost bits and bounds nothing.

    Returns
    -------
    tuple of float
        value, lower, upper.

    Raises
    ------
    FloatRangeError
        If a finite bound is no longer finite.

    Examples
    --------
    >>> bracket(1.0, 0.5, 2.0, 4.0)
    (4.0, 2.0, 8.0)
    >>> bracket(1.0, 0.5, 2.0, 1e-320)[1:]
    (0.0, 2.2250738585072014e-308)
    """
    most = upper * factor
    if math.isinf(most) and not math.isinf(upper):
        raise FloatRangeError
    if upper > 0:
        most = max(most, _TINY)
    least = lower * factor
    return value * factor, least if least >= _TINY else 0.0, most


@contextmanager
def range_errors_as_input_errors(argument: str, matrices: Mapping[str, Any]) -> Iterator[None]:
    """Turn :class:`FloatRangeError` into an error about the largest and the smallest entry.

    Parameters
    ----------
    argument : str
        Whose matrices they are, for the message.
    matrices : mapping of str to ndarray
        The matrices as they came.

    Raises
    ------
    InvalidInputError

    Examples
    --------
    >>> import numpy as np
    >>> with range_errors_as_input_errors(
    ...     "system", {"A": np.array([[1e300]]), "B": np.array([[1e-300]])}
    ... ):
    ...     raise FloatRangeError
    Traceback (most recent call last):
    ...
    robustpolish.errors.InvalidInputError: system: got entries from 1e-300 (B[0, 0]) to 1e+300...
    """
    try:
        yield
    except FloatRangeError:
        raise entry_range_error(argument, matrices) from None


def entry_range_error(argument: str, matrices: Mapping[str, Any]) -> InvalidInputError:
    """Build the error about numbers that doubles cannot multiply; the caller raises it."""
    sizes = [
        (abs(float(M[place])), f"{name}[{', '.join(map(str, place))}]")
        for name, M in matrices.items()
        for place in np.ndindex(np.shape(M))
        if M[place]
    ]
    (low, first), (high, last) = min(sizes, default=(0.0, "")), max(sizes, default=(0.0, ""))
    shown = described(f"entries from {low:.3g} ({first}) to {high:.3g} ({last})")
    want = "numbers whose products and ratios double precision can hold"
    remedy = "Choose other units for states, signals or time, and write 0 for what is nothing."
    return invalid(argument, shown, want, remedy)


def refuse_extreme(argument: str, matrices: Mapping[str, Any]) -> None:
    """Refuse matrices of which the largest entry is not zero, yet absurd: for given units.

    That is one above :data:`LARGEST` or below its inverse. For what is not scaled before it is
    computed with. Small entries beside larger ones are what matrix exponentials leave.

    Raises
    ------
    InvalidInputError

    Examples
    --------
    >>> import numpy as np
    >>> refuse_extreme("system", {"A": np.array([[-1.0, 1e200]])})
    Traceback (most recent call last):
    ...
    robustpolish.errors.InvalidInputError: system: got entries from 1 (A[0, 0]) to 1e+200...
    """
    with range_errors_as_input_errors(argument, matrices):
        refuse_out_of_range(*matrices.values())
        for M in matrices.values():
            if 0 < np.abs(M).max(initial=0.0) < 1 / LARGEST:
                raise FloatRangeError


def refuse_out_of_range(*matrices: Any) -> None:
    """Refuse scaled matrices with entries above :data:`LARGEST`, or that are not finite.

    Raises
    ------
    FloatRangeError
    """
    for M in matrices:
        if M.size and not np.abs(M).max() <= LARGEST:
            raise FloatRangeError


# State-space matrices as plain arrays, rescaled by powers of two so that nothing is rounded.


_lapack: Any = lapack


def power_of_two(value: float) -> float:
    """Return the power of two nearest to a positive `value`; 1 for zero and infinity."""
    return 2.0 ** nearest_exponent(value)


# Squares between these neither overflow nor lose digits.
_LEAST, _MOST = 1e-260, 1e260


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
    from robustpolish.linear.arithmetic.even_units import balance

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
    from robustpolish.linear.arithmetic.even_units import (
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
    known = _TINY <= time < math.inf and 0 < gain < math.inf
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
    rates = rates[rates > EPS * size(A)]
    return float(np.exp(np.mean(np.log(rates)))) if rates.size else 1.0


# Exact arithmetic on state-space matrices: doubles are fractions, so nothing need be rounded.
#
# Hidden modes are split off exactly, and the frequency response is evaluated in ball
# arithmetic, with as many bits as it takes.


_PRIME = 4611686018427387847  # the largest below 2^62

EXACT_STATES = 60
"""Up to so many coupled states exact arithmetic finds eigenvalues, hidden modes and energies."""


def fraction(value: float) -> fmpq:
    """Return a double as the fraction that it is."""
    return fmpq(*float(value).as_integer_ratio())


def rational(M: NDArray[np.float64]) -> fmpq_mat:
    """Return a matrix of doubles as the fractions that they are."""
    ratios = [value.as_integer_ratio() for value in M.ravel().tolist()]
    common = max((den for _, den in ratios), default=1)
    rows, columns = M.shape
    whole = fmpz_mat(rows, columns, [num * (common // den) for num, den in ratios])
    return fmpq_mat(whole) / common


def to_float(M: fmpq_mat) -> NDArray[np.float64]:
    """Round a rational matrix to doubles."""
    with precision(53):
        values = [float(arb(entry)) for entry in M.entries()]
    return np.array(values, dtype=float).reshape(M.nrows(), M.ncols())


def identity(n: int) -> fmpq_mat:
    """Return the n x n identity."""
    return fmpq_mat(n, n, [int(i == j) for i in range(n) for j in range(n)])


@dataclass(frozen=True, eq=False)
class ExactModel:
    """A system with rational matrices.

    Its frequency variable is s = i x in continuous time and z = (1 + i x)/(1 - i x)
    in discrete time, with x from 0 to infinity.
    """

    A: fmpq_mat
    B: fmpq_mat
    C: fmpq_mat
    D: fmpq_mat
    discrete: bool

    @classmethod
    def of(cls, model: Realisation) -> ExactModel:
        """Read the doubles of `model` as fractions."""
        A, B, C, D = (rational(M) for M in (model.A, model.B, model.C, model.D))
        return cls(A, B, C, D, model.discrete)

    @property
    def states(self) -> int:
        """Number of states."""
        return self.A.nrows()

    def minimal(self) -> ExactModel:
        """Remove the modes that no input moves or no output sees, exactly."""
        A, B, C = reachable(self.A, self.B, self.C)
        A, C, B = reachable(A.transpose(), C.transpose(), B.transpose())
        return ExactModel(A.transpose(), B.transpose(), C.transpose(), self.D, self.discrete)

    def is_zero(self) -> bool:
        """Say whether the output is zero whatever the input."""
        zero = fmpq_mat(self.C.nrows(), self.B.ncols())
        return zero == self.D and self.minimal().states == 0


def reachable(A: fmpq_mat, B: fmpq_mat, C: fmpq_mat) -> tuple[fmpq_mat, fmpq_mat, fmpq_mat]:
    """Restrict a system to the span of B, A B, A^2 B, ...

    Which of these vectors span it is guessed modulo a prime, which is quick, and then proven
    for the rational numbers: the vectors found are independent, and their span holds B and is
    mapped into itself by A.
    """
    n, prime = A.nrows(), fmpz(_PRIME)
    while True:
        columns, pivots = _spanning(A, B, int(prime))
        if len(pivots) == n:
            return A, B, C
        if not pivots:
            onto = fmpq_mat(n, 0)
        else:  # x = onto * (reduced x), the identity in the pivot rows
            basis = _krylov_vectors(A, B, columns)
            top = _rows(basis, pivots)
            onto = top.transpose().solve(basis.transpose()).transpose()
        reduced = _rows(A * onto, pivots), _rows(B, pivots)
        if A * onto == onto * reduced[0] and onto * reduced[1] == B:
            return *reduced, C * onto
        prime = prime - 2  # a prime that hides a direction is rare
        while not prime.is_prime():
            prime = prime - 2


def _spanning(A: fmpq_mat, B: fmpq_mat, prime: int) -> tuple[list[int], list[int]]:
    """Return which of the columns of B, A B, ... are independent, and in which rows."""
    n, m = A.nrows(), B.ncols()
    if n == 0 or m == 0:
        return [], []
    step, block = (nmod_mat(M.numer_denom()[0], prime) for M in (A, B))
    vectors: list[nmod] = []
    for _ in range(n):
        vectors += block.transpose().entries()
        block = step * block
    table = nmod_mat(n * m, n, vectors, prime)
    return _pivots(table.transpose()), _pivots(table)


def _pivots(M: nmod_mat) -> list[int]:
    """Return the columns in which the rows of the reduced echelon form begin."""
    reduced, rank = M.rref()
    columns = range(M.ncols())
    return [next(j for j in columns if int(reduced[i, j])) for i in range(rank)]


def _krylov_vectors(A: fmpq_mat, B: fmpq_mat, columns: list[int]) -> fmpq_mat:
    """Return the given columns of B, A B, A^2 B, ..., up to a factor each."""
    n, m = A.nrows(), B.ncols()
    step, block = (M.numer_denom()[0] for M in (A, B))
    found = []
    for power in range(max(columns) // m + 1):
        found += [[block[i, j % m] for i in range(n)] for j in columns if j // m == power]
        block = step * block
    return fmpq_mat(fmpz_mat(found).transpose())


def _rows(M: fmpq_mat, rows: range | list[int]) -> fmpq_mat:
    columns = range(M.ncols())
    return fmpq_mat(len(rows), M.ncols(), [M[i, j] for i in rows for j in columns])


def transfer(model: ExactModel, x: fmpq | None) -> tuple[NDArray[np.complex128], float]:
    """Evaluate the transfer matrix at frequency x (None: infinity) as if without rounding.

    Returns
    -------
    G : ndarray of complex
        Correct to double precision relative to its largest entry.
    scale : float
        A power of two by which G has to be multiplied.
    """
    bits = 128
    while True:
        with precision(bits):
            s = None if x is None else acb(0, x)
            if model.discrete:
                s = acb(-1) if s is None else (1 + s) / (1 - s)
            A, B, C, D = map(arb_mat, (model.A, model.B, model.C, model.D))
            try:
                G = transfer_matrix(A, B, C, D, s)
            except ZeroDivisionError:  # too few bits to tell the resolvent from a singular one
                bits *= 2
                continue
            entries = G.entries()
            size = max((abs(e).upper() for e in entries), key=float, default=None)
            radius = max((e.rad() for e in entries), key=float, default=None)
            if size is None or radius is None or size == 0 or bits > 4096:
                return np.zeros((G.nrows(), G.ncols()), complex), 1.0
            if radius < size * 2**-60:
                exponent = int(size.log_base(2).floor().unique_fmpz() or 0)
                values = [complex(e * acb(2) ** (-exponent)) for e in entries]
                return np.array(values).reshape(G.nrows(), G.ncols()), float(2.0**exponent)
        bits *= 2


def is_positive_definite(M: ArrayLike) -> bool:
    r"""Decide without rounding whether a symmetric matrix is positive definite.

    The eigenvalues are real, so by Descartes' rule of signs all are positive exactly if the
    coefficients of the characteristic polynomial alternate in sign; they are computed in
    rational arithmetic. There is no tolerance: a singular matrix is not definite.

    Parameters
    ----------
    M : array_like, shape (n, n)
        Symmetric to the last bit.

    Returns
    -------
    bool
        True for n = 0.

    Raises
    ------
    InvalidInputError
        If it is not square, not finite or not symmetric.

    Examples
    --------
    >>> from robustpolish.linear import is_positive_definite
    >>> is_positive_definite([[1.0, 1.0], [1.0, 1.0 + 2**-52]])
    True
    >>> is_positive_definite([[1.0, 1.0], [1.0, 1.0]])
    False
    """
    array = square("M", M)
    if not np.array_equal(array, array.T):
        gap = float(np.abs(array - array.T).max())
        shown = described(f"entries that differ by {gap:.3g} from their mirror images")
        raise invalid("M", shown, "a symmetric matrix", "Pass (M + M.T) / 2.")
    return is_definite(rational(array))
