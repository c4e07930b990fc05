"""Exact arithmetic on state-space matrices: doubles are fractions, so nothing need be rounded.

Hidden modes are split off exactly, and the frequency response is evaluated in ball
arithmetic, with as many bits as it takes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from flint import acb, arb, arb_mat, fmpq, fmpq_mat, fmpz, fmpz_mat, nmod, nmod_mat
from numpy.typing import ArrayLike, NDArray

from robustpolish.base.checks import described, invalid, square
from robustpolish.linear.arithmetic.balls import is_definite, precision, transfer_matrix
from robustpolish.linear.arithmetic.realisation import Realisation

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
