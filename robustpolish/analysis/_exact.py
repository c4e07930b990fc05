"""Exact arithmetic on state-space matrices: doubles are fractions, so nothing need be rounded.

A characteristic polynomial with integer coefficients and isolated roots
decides what double precision cannot: on which side of the axis a pole lies,
and whether a gain is ever reached. At twelve states it costs a millisecond.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from flint import acb, acb_mat, arb, arb_mat, ctx, fmpq, fmpq_mat, fmpz_mat, fmpz_poly, nmod_mat
from numpy.typing import NDArray

from robustpolish.analysis._realisation import Realisation

_PRIME = 4611686018427387847  # the largest below 2^62


@contextmanager
def precision(bits: int) -> Iterator[None]:
    """Work with the given number of bits, then go back."""
    before = ctx.prec
    ctx.prec = bits
    try:
        yield
    finally:
        ctx.prec = before


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


def joined(blocks: list[list[fmpq_mat]]) -> fmpq_mat:
    """Join rows of blocks into one matrix; blocks without columns are passed over."""
    rows: list[list[fmpq]] = []
    for line in blocks:
        tables = [block.table() for block in line if block.ncols()]
        rows += [[e for table in tables for e in table[i]] for i in range(line[0].nrows())]
    return fmpq_mat(rows)


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
        A, B, C = _reachable(self.A, self.B, self.C)
        A, C, B = _reachable(A.transpose(), C.transpose(), B.transpose())
        return ExactModel(A.transpose(), B.transpose(), C.transpose(), self.D, self.discrete)

    def is_zero(self) -> bool:
        """Say whether the output is zero whatever the input."""
        zero = fmpq_mat(self.C.nrows(), self.B.ncols())
        return zero == self.D and self.minimal().states == 0


def _fully_reachable(A: fmpq_mat, B: fmpq_mat) -> bool:
    """Say whether B, A B, A^2 B, ... span everything modulo a prime, hence exactly.

    False proves nothing, but is rare for a reachable pair.
    """
    n, m = A.nrows(), B.ncols()
    if n == 0 or m == 0:
        return n == 0
    step, block = (nmod_mat(M.numer_denom()[0], _PRIME) for M in (A, B))
    columns = []
    for _ in range(n):
        columns += block.transpose().entries()
        block = step * block
    return nmod_mat(n * m, n, columns, _PRIME).rank() == n


def _reachable(A: fmpq_mat, B: fmpq_mat, C: fmpq_mat) -> tuple[fmpq_mat, fmpq_mat, fmpq_mat]:
    """Restrict a system to the span of B, A B, A^2 B, ..."""
    if _fully_reachable(A, B):
        return A, B, C
    n, m = A.nrows(), B.ncols()
    basis, rank = fmpq_mat(0, n), 0
    block = B.transpose()
    for _ in range(n):
        stacked = fmpq_mat(rank + m, n, basis.entries() + block.entries())
        reduced, found = stacked.rref()
        if found == rank:
            break
        basis, rank = _rows(reduced, range(found)), found
        block = block * A.transpose()
    pivots = [next(j for j in range(n) if basis[i, j] != 0) for i in range(rank)]
    onto = basis.transpose()  # x = onto * (reduced x), the identity in the pivot rows
    return _rows(A * onto, pivots), _rows(B, pivots), C * onto


def _rows(M: fmpq_mat, rows: range | list[int]) -> fmpq_mat:
    columns = range(M.ncols())
    return fmpq_mat(len(rows), M.ncols(), [M[i, j] for i in rows for j in columns])


@dataclass(frozen=True)
class PoleCount:
    """Poles by where they lie, decided exactly.

    Attributes
    ----------
    unstable, marginal : tuple of complex
        Poles beyond and on the imaginary axis or the unit circle, in the
        units of the matrix; repeated as often as they occur.
    """

    unstable: tuple[complex, ...]
    marginal: tuple[complex, ...]


def count_poles(A: fmpq_mat, discrete: bool) -> PoleCount:
    """Sort the eigenvalues of a rational matrix by the side of the stability boundary."""
    sided = _sided(fmpz_poly(A.charpoly().numer().coeffs()), discrete)
    return PoleCount(
        tuple(pole for pole, side in sided if side > 0),
        tuple(pole for pole, side in sided if side == 0),
    )


def hidden_poles(A: fmpq_mat, B: fmpq_mat, discrete: bool) -> list[tuple[complex, bool]]:
    """Return the eigenvalues that B does not reach, and whether each is strictly stable."""
    reached, _, _ = _reachable(A, B, fmpq_mat(0, A.nrows()))
    if reached.nrows() == A.nrows():
        return []
    rest = A.charpoly() // reached.charpoly() if reached.nrows() else A.charpoly()
    sided = _sided(fmpz_poly(rest.numer().coeffs()), discrete)
    return [(pole, side < 0) for pole, side in sided]


def _sided(polynomial: fmpz_poly, discrete: bool) -> list[tuple[complex, int]]:
    """Return the roots with -1, 0 or 1 for inside, on and beyond the stability boundary."""
    n = polynomial.degree()
    if discrete:  # roots at z = -1 go to infinity, where the degree tells
        polynomial = _mobius(polynomial, n)
    sided = [(complex(-1), 0)] * (n - polynomial.degree())
    if polynomial.degree() == 0:
        return sided
    mirrored = fmpz_poly([(-1) ** k * int(c) for k, c in enumerate(polynomial.coeffs())])
    symmetric = polynomial.gcd(mirrored)  # holds every root on the axis, and pairs around it
    for root, times in _resolved(polynomial, _axis_count(symmetric)):
        where = complex(root)
        side = int(root.real > 0) - int(root.real < 0)
        sided += [(_pole(where if side else 1j * where.imag, discrete), side)] * times
    return sided


def eigenvalues(A: fmpq_mat) -> list[complex]:
    """Return the eigenvalues of a rational matrix, each part correctly rounded."""
    polynomial = fmpz_poly(A.charpoly().numer().coeffs())
    bits = 128
    while True:
        with precision(bits):
            roots = isolated_roots(polynomial)
            if bits > 4096 or all(_sharp(root.real) and _sharp(root.imag) for root, _ in roots):
                return [complex(root) for root, times in roots for _ in range(times)]
        bits *= 2


def _sharp(value: arb) -> bool:
    """Say whether a part of an eigenvalue is known to double precision or is exactly zero."""
    return value.rel_accuracy_bits() >= 56 or value == 0


def _pole(root: complex, discrete: bool) -> complex:
    return (1 + root) / (1 - root) if discrete and root != 1 else root


def _mobius(polynomial: fmpz_poly, n: int) -> fmpz_poly:
    """Return (1 - s)^n p((1 + s)/(1 - s))."""
    up, down = fmpz_poly([1, 1]), fmpz_poly([1, -1])
    result, power = fmpz_poly([0]), fmpz_poly([1])
    for k, c in enumerate(polynomial.coeffs()):
        result += power * down ** (n - k) * c
        power *= up
    return result


def _resolved(polynomial: fmpz_poly, on_axis: int) -> list[tuple[acb, int]]:
    """Isolate the roots until only the `on_axis` ones have no sign in their real part."""
    bits = 64
    while True:
        with precision(bits):
            roots = isolated_roots(polynomial)
        if sum(times for root, times in roots if root.real.contains(0)) == on_axis:
            return roots
        bits *= 2


def _axis_count(symmetric: fmpz_poly) -> int:
    """Count the roots on the imaginary axis of an even or odd polynomial."""
    coefficients = symmetric.coeffs()
    zeros = next(k for k, c in enumerate(coefficients) if c != 0)
    rest = coefficients[zeros:]
    even = fmpz_poly([(-1) ** k * int(c) for k, c in enumerate(rest[::2])])  # in x = -s^2
    return zeros + 2 * sum(times for _, times in positive_roots(even))


def isolated_roots(polynomial: fmpz_poly) -> list[tuple[acb, int]]:
    """Return disjoint balls around the roots, with multiplicities, at the precision in force."""
    roots: Any = polynomial.complex_roots()  # the library's stub forgets the multiplicities
    return roots


def positive_roots(polynomial: fmpz_poly) -> list[tuple[acb, int]]:
    """Isolate the real roots at or above zero of a polynomial with integer coefficients."""
    if polynomial.degree() <= 0:
        return []
    coefficients = polynomial.coeffs()
    zeros = next(k for k, c in enumerate(coefficients) if c != 0)
    found: list[tuple[acb, int]] = [(acb(0), zeros)] if zeros else []
    rest = fmpz_poly(coefficients[zeros:])
    bits = 128
    while True:
        with precision(bits):
            roots = isolated_roots(rest) if rest.degree() > 0 else []
        real = [(root, times) for root, times in roots if root.imag == 0]
        if not any(root.real.contains(0) for root, _ in real):
            return found + [(root, times) for root, times in real if root.real > 0]
        bits *= 2


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
            G = _transfer(model, x)
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


def _transfer(model: ExactModel, x: fmpq | None) -> acb_mat:
    D = acb_mat(arb_mat(model.D))
    n = model.states
    if n == 0 or (x is None and not model.discrete):
        return D
    one = acb(1)
    z = acb(-1) if x is None else acb(0, x)
    if model.discrete and x is not None:
        z = (one + z) / (one - z)
    resolvent = -acb_mat(arb_mat(model.A))
    for i in range(n):
        resolvent[i, i] += z
    return D + acb_mat(arb_mat(model.C)) * resolvent.solve(acb_mat(arb_mat(model.B)))
