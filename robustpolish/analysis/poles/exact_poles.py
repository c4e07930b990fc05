"""Poles by exact arithmetic: the characteristic polynomial in integers, its roots isolated.

That decides what double precision cannot: on which side of the stability boundary a
pole lies. At twelve states it costs a millisecond.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from flint import acb, arb, fmpq_mat, fmpz_poly

from robustpolish.exact.balls import precision
from robustpolish.exact.rational import reachable


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
    sided = sided_poles(A, discrete)
    return PoleCount(
        tuple(pole for pole, side in sided if side > 0),
        tuple(pole for pole, side in sided if side == 0),
    )


def sided_poles(A: fmpq_mat, discrete: bool) -> list[tuple[complex, int]]:
    """Return the eigenvalues with -1, 0 or 1 for inside, on and beyond the stability boundary."""
    return _sided(fmpz_poly(A.charpoly().numer().coeffs()), discrete)


def hidden_poles(A: fmpq_mat, B: fmpq_mat, discrete: bool) -> list[tuple[complex, bool]]:
    """Return the eigenvalues that B does not reach, and whether each is strictly stable."""
    reached, _, _ = reachable(A, B, fmpq_mat(0, A.nrows()))
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
    """Return the eigenvalues of a rational matrix, each part to double precision."""
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
