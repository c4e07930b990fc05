"""Matrices that are affine in the decision variables of a semidefinite program."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from robustpolish.arrays import Matrix

# SciPy's stubs make nothing of the shape of a sparse array.
Sparse = Any
_csr: Any = sparse.csr_array


class Affine:
    """A matrix whose entries are affine functions of a vector of variables.

    ``vec(value) = constant + linear @ x``, with the columns stacked. It supports ``+``, ``-``,
    ``*`` and ``/`` by numbers, products with constant matrices from either side and ``.T``, which
    is all that a linear matrix inequality needs; every backend then receives the same numbers.

    Parameters
    ----------
    shape : (int, int)
        Rows and columns.
    constant : ndarray, shape (rows * columns,)
    linear : sparse array, shape (rows * columns, number of variables)
    """

    # Makes NumPy leave ``array @ affine`` and ``array + affine`` to this class.
    __array_ufunc__ = None

    def __init__(self, shape: tuple[int, int], constant: Matrix, linear: Sparse) -> None:
        self.shape = shape
        self.constant = constant
        self.linear = linear

    @classmethod
    def of(cls, value: Affine | ArrayLike) -> Affine:
        """Return `value` itself, or a constant with the value of an array."""
        if isinstance(value, Affine):
            return value
        array = np.atleast_2d(np.asarray(value, dtype=float))
        rows, columns = array.shape
        nothing = _csr((array.size, 0))
        return cls((rows, columns), array.ravel(order="F"), nothing)

    def widened(self, variables: int) -> Sparse:
        """Return `linear` with zero columns for variables declared later."""
        rows, known = self.linear.shape
        if known == variables:
            return self.linear
        csr = self.linear.tocsr()
        return _csr((csr.data, csr.indices, csr.indptr), shape=(rows, variables))

    def at(self, x: Matrix) -> Matrix:
        """Return the value for the variables `x`."""
        known = self.linear.shape[1]
        return np.reshape(self.constant + self.linear @ x[:known], self.shape, order="F")

    @property
    def T(self) -> Affine:
        """The transpose."""
        rows, columns = self.shape
        order = np.arange(rows * columns).reshape(rows, columns, order="F").ravel()
        return Affine((columns, rows), self.constant[order], self.linear.tocsr()[order])

    def __add__(self, other: Affine | ArrayLike) -> Affine:
        other = Affine.of(other)
        if other.shape != self.shape:
            raise ValueError(f"shapes {self.shape} and {other.shape} do not add")
        n = max(self.linear.shape[1], other.linear.shape[1])
        linear = _csr(self.widened(n) + other.widened(n))
        return Affine(self.shape, self.constant + other.constant, linear)

    __radd__ = __add__

    def __neg__(self) -> Affine:
        return Affine(self.shape, -self.constant, _csr(-self.linear))

    def __sub__(self, other: Affine | ArrayLike) -> Affine:
        return self + (-Affine.of(other))

    def __rsub__(self, other: Affine | ArrayLike) -> Affine:
        return Affine.of(other) + (-self)

    def __mul__(self, factor: float) -> Affine:
        return Affine(self.shape, self.constant * factor, _csr(self.linear * factor))

    __rmul__ = __mul__

    def __truediv__(self, divisor: float) -> Affine:
        return self * (1.0 / divisor)

    def __rmatmul__(self, left: ArrayLike) -> Affine:
        left = np.atleast_2d(np.asarray(left, dtype=float))
        if left.shape[1] != self.shape[0]:
            raise ValueError(f"shapes {left.shape} and {self.shape} do not multiply")
        product = sparse.kron(sparse.eye_array(self.shape[1]), left, format="csr")
        return self._mapped((left.shape[0], self.shape[1]), _csr(product))

    def __matmul__(self, right: ArrayLike) -> Affine:
        right = np.atleast_2d(np.asarray(right, dtype=float))
        if right.shape[0] != self.shape[1]:
            raise ValueError(f"shapes {self.shape} and {right.shape} do not multiply")
        product = sparse.kron(right.T, sparse.eye_array(self.shape[0]), format="csr")
        return self._mapped((self.shape[0], right.shape[1]), _csr(product))

    def times(self, matrix: ArrayLike) -> Affine:
        """Return this scalar (a 1 x 1 expression) times a constant matrix."""
        array = np.atleast_2d(np.asarray(matrix, dtype=float))
        column = _csr(array.reshape(-1, 1, order="F"))
        rows, columns = array.shape
        return self._mapped((rows, columns), column)

    @property
    def trace(self) -> Affine:
        """The sum of the diagonal, a 1 x 1 expression."""
        rows = self.shape[0]
        pick = _csr(np.eye(rows).reshape(1, -1))
        return self._mapped((1, 1), pick)

    def _mapped(self, shape: tuple[int, int], by: Sparse) -> Affine:
        return Affine(shape, by @ self.constant, _csr(by @ self.linear))


def symmetric_block(upper: Sequence[Sequence[Affine | ArrayLike | None]]) -> Affine:
    """Assemble a symmetric block matrix from its upper triangle.

    Parameters
    ----------
    upper : sequence of sequences
        Row i lists the blocks (i, i), (i, i + 1), ...; None is a zero block.
        The diagonal blocks have to be given and symmetric.

    Returns
    -------
    Affine

    Examples
    --------
    >>> import numpy as np
    >>> symmetric_block([[np.eye(1), [[2.0]]], [[[5.0]]]]).at(np.zeros(0))
    array([[1., 2.],
           [2., 5.]])
    """
    blocks = [[None if b is None else Affine.of(b) for b in row] for row in upper]
    sizes = []
    for row in blocks:
        if row[0] is None:
            raise ValueError("a diagonal block is missing")
        sizes.append(row[0].shape[0])
    starts = np.concatenate([[0], np.cumsum(sizes)])
    total = int(starts[-1])
    result = Affine.of(np.zeros((total, total)))
    for i, row in enumerate(blocks):
        for j, block in enumerate(row, start=i):
            if block is None:
                continue
            up = _placed(block, starts[i], starts[j], total)
            result = result + (up if i == j else up + up.T)
    return result


def _placed(block: Affine, top: int, left: int, total: int) -> Affine:
    rows, columns = block.shape
    r, c = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    target = ((left + c) * total + top + r).ravel(order="F")
    size = rows * columns
    by = _csr((np.ones(size), (target, np.arange(size))), shape=(total**2, size))
    return block._mapped((total, total), by)
