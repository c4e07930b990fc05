"""The barrier whose least value is the analytic centre, with its derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robustpolish.arrays import AnyArray, Matrix, Vector
from robustpolish.robust.scaled.scalings import Box


@dataclass(frozen=True, eq=False)
class Barrier:
    """Minus the logarithms of all determinants that have to stay positive."""

    parts: tuple[_Determinants, ...]

    @classmethod
    def of(cls, coefficients: AnyArray, boxes: tuple[Box, ...]) -> Barrier:
        """Take what the scalings multiply, of shape (k, size, n, n), and what bounds them."""
        return cls((_Determinants.of(coefficients), *_by_size(coefficients.shape[1], boxes)))

    @classmethod
    def of_bounds(cls, size: int, boxes: tuple[Box, ...]) -> Barrier:
        """Take only what bounds so many scalings."""
        return cls(tuple(_by_size(size, boxes)))

    def value(self, x: Vector) -> float:
        """Return the value; infinite where a determinant is not positive."""
        try:
            total = sum(part.value(x) for part in self.parts)
        except np.linalg.LinAlgError:
            return np.inf
        return float(total) if np.isfinite(total) else np.inf

    def derivatives(self, x: Vector) -> tuple[Vector, Matrix]:
        """Return the slope and the curvature."""
        slope, curvature = np.zeros(len(x)), np.zeros((len(x), len(x)))
        for part in self.parts:
            part.add(x, slope, curvature)
        return slope, curvature


@dataclass(frozen=True, eq=False)
class _Determinants:
    """Matrices of one size, affine in the scalings: all at once, for most are tiny.

    Attributes
    ----------
    rows : ndarray, shape (k n n, size)
        What every scaling adds to their entries.
    columns : ndarray, shape (k, n, size n)
        The same, beside each other as right-hand sides.
    constant : ndarray, shape (k, n, n)
    """

    rows: AnyArray
    columns: AnyArray
    constant: AnyArray

    @classmethod
    def of(cls, coefficients: AnyArray, constant: AnyArray | None = None) -> _Determinants:
        """Take what scalings multiply, of shape (k, size, n, n)."""
        k, size, n, _ = coefficients.shape
        rows = np.ascontiguousarray(coefficients.transpose(0, 2, 3, 1)).reshape(-1, size)
        columns = np.ascontiguousarray(coefficients.transpose(0, 2, 1, 3)).reshape(k, n, size * n)
        return cls(rows, columns, np.zeros((k, n, n)) if constant is None else constant)

    def matrices(self, x: Vector) -> AnyArray:
        return (self.rows @ x).reshape(self.constant.shape) + self.constant

    def value(self, x: Vector) -> float:
        factors = np.linalg.cholesky(self.matrices(x))
        return -2 * float(np.log(np.real(np.diagonal(factors, axis1=1, axis2=2))).sum())

    def add(self, x: Vector, slope: Vector, curvature: Matrix) -> None:
        """Add the first and second derivatives of the value."""
        k, n, _ = self.constant.shape
        solved: AnyArray = np.linalg.solve(self.matrices(x), self.columns)
        weighted = solved.reshape(k, n, len(x), n)
        slope -= np.real(np.einsum("kisi->s", weighted))
        left = weighted.transpose(2, 0, 1, 3).reshape(len(x), -1)
        right = weighted.transpose(0, 3, 1, 2).reshape(-1, len(x))
        curvature += np.real(left @ right)


def _by_size(size: int, boxes: tuple[Box, ...]) -> list[_Determinants]:
    """Gather bounds of the scalings whose matrices have the same size."""
    found = []
    for n in sorted({constant.shape[0] for _, _, constant in boxes}):
        same = [box for box in boxes if box[2].shape[0] == n]
        coefficients: AnyArray = np.zeros((len(same), size, n, n), complex)
        for own, (numbers, units, _) in zip(coefficients, same, strict=True):
            own[numbers] = units
        if not np.imag(coefficients).any():
            coefficients = np.real(coefficients)
        found.append(
            _Determinants.of(coefficients, np.array([constant for _, _, constant in same]))
        )
    return found
