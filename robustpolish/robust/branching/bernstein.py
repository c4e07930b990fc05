"""Polynomials in Bernstein's form: their values over a box lie between their coefficients.

References
----------
.. [1] M. Zettler, J. Garloff, "Robustness analysis of polynomials with polynomial parameter
   dependency using Bernstein expansion", IEEE Transactions on Automatic Control 43 (1998) 425-431.
"""

from __future__ import annotations

from functools import cache
from math import comb
from typing import Any

import flint
import numpy as np
from numpy.typing import NDArray

from robustpolish.arrays import AnyArray, Matrix
from robustpolish.exact.rational import fraction

Balls = NDArray[np.object_]
"""An array of flint.arb or flint.fmpq; python-flint ships no stubs for them."""


def nodes(degree: int) -> list[Any]:
    """Return as many numbers as a polynomial needs, between 1/4 and 3/4, as flint.fmpq."""
    return [flint.fmpq(degree + 2 * j, 4 * degree) for j in range(degree + 1)]


@cache
def from_values(degree: int) -> Balls:
    """Return the matrix from values at the nodes to the coefficients between 0 and 1, exactly."""
    rows = [
        [comb(degree, k) * x**k * (1 - x) ** (degree - k) for k in range(degree + 1)]
        for x in nodes(degree)
    ]
    return _table(flint.fmpq_mat(rows).inv())


def from_powers(degree: int, low: float, high: float) -> Any:
    """Return the matrix from coefficients of powers to those over an interval, as arb_mat.

    Parameters
    ----------
    degree : int
    low, high : float
        Taken as exact.

    Returns
    -------
    flint.arb_mat, shape (degree + 1, degree + 1)
        To be multiplied from the right with rows of coefficients, the constant one first.
    """
    a, b = fraction(low), fraction(high)
    rows = []
    for power in range(degree + 1):
        moved = [comb(power, j) * a ** (power - j) * (b - a) ** j for j in range(power + 1)]
        rows.append(
            [
                sum(
                    (flint.fmpq(comb(k, j), comb(degree, j)) * moved[j]
                     for j in range(min(k, power) + 1)),
                    flint.fmpq(0),
                )
                for k in range(degree + 1)
            ]
        )  # fmt: skip
    return flint.arb_mat(flint.fmpq_mat(rows))


def along(table: AnyArray, coefficients: AnyArray, axis: int) -> AnyArray:
    """Return what a matrix makes of an array along one of its axes."""
    return np.moveaxis(np.tensordot(table, coefficients, (1, axis)), 0, axis)


@cache
def halves(degree: int) -> tuple[Matrix, Matrix]:
    """Return the matrices from coefficients to those over the lower and the upper half.

    Their entries are exact, not negative, and sum up to 1 in a row.
    """
    lower = np.array(
        [[comb(i, j) / 2.0**i if j <= i else 0.0 for j in range(degree + 1)]
         for i in range(degree + 1)]
    )  # fmt: skip
    return lower, lower[::-1, ::-1].copy()


def square(low: float, high: float, degree: int) -> AnyArray:
    """Return the coefficients of x^2 over an interval, for a degree of at least 2."""
    k = np.arange(degree + 1)
    mixed, last = k / degree, k * (k - 1) / (degree * (degree - 1))
    return low * low * (1 - 2 * mixed + last) + 2 * low * high * (mixed - last) + high * high * last


def _table(matrix: Any) -> Balls:
    found = np.empty((matrix.nrows(), matrix.ncols()), dtype=object)
    for i, row in enumerate(matrix.tolist()):
        for j, entry in enumerate(row):
            found[i, j] = entry
    return found
