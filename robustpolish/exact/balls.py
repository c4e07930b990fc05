"""Matrices in ball arithmetic: every entry carries a proven bound on its rounding error.

python-flint's ``arb_mat`` encloses each number in a ball, so a conclusion drawn from balls
holds for the exact numbers. A 120 x 120 product takes about 10 ms at 200 bits, which is why
the certificates are checked in balls throughout rather than with hand-made error bounds.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import flint
import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[Any]
Ball = Any  # flint.arb_mat; python-flint ships no stubs for it

# Up to so many rows elimination in balls takes less than about 0.1 s.
_ELIMINATED = 60


@contextmanager
def precision(bits: int) -> Iterator[None]:
    """Work with `bits` bits inside the block and restore the precision afterwards."""
    before = flint.ctx.prec
    flint.ctx.prec = bits
    try:
        yield
    finally:
        flint.ctx.prec = before


def ball(matrix: Matrix) -> Ball:
    """Enclose a matrix of doubles, exactly."""
    array = np.atleast_2d(np.asarray(matrix, dtype=float))
    return flint.arb_mat(array.shape[0], array.shape[1], array.ravel().tolist())


def zeros(rows: int, columns: int) -> Ball:
    """Return the zero matrix."""
    return flint.arb_mat(rows, columns)


def identity(n: int) -> Ball:
    """Return the identity matrix."""
    return ball(np.eye(n)) if n else zeros(0, 0)


def block(rows: Sequence[Sequence[Ball]]) -> Ball:
    """Assemble a matrix of blocks."""
    table: list[list[Any]] = []
    for row in rows:
        listed = [part.tolist() for part in row if part.ncols()]
        height = row[0].nrows()
        table += [[entry for part in listed for entry in part[i]] for i in range(height)]
    columns = sum(part.ncols() for part in rows[0])
    return flint.arb_mat(table) if table and columns else zeros(len(table), columns)


def midpoint(matrix: Ball) -> Matrix:
    """Return the centres, rounded to doubles."""
    shape = matrix.nrows(), matrix.ncols()
    return np.array([float(entry) for entry in matrix.mid().entries()]).reshape(shape)


def magnitude(matrix: Ball) -> Matrix:
    """Return upper bounds of the absolute values of the entries."""
    shape = matrix.nrows(), matrix.ncols()
    return np.array([float(entry.abs_upper()) for entry in matrix.entries()]).reshape(shape)


def symmetric(matrix: Ball) -> Ball:
    """Return the mean of a matrix and its transpose."""
    return (matrix + matrix.transpose()) * flint.arb(0.5)


def is_positive_definite(matrix: Ball) -> bool:
    """Prove that every symmetric matrix enclosed by `matrix` is positive definite.

    With any nonsingular G, M > 0 if and only if G M G' > 0. G is an approximate inverse
    Cholesky factor in doubles; if the enclosure of I - G M G' has a row-sum norm below one,
    then G M G' > 0 (and G is nonsingular, as G M G' is). Small matrices for which this is
    too coarse are eliminated in balls.

    Parameters
    ----------
    matrix : flint.arb_mat
        Encloses a symmetric matrix.

    Returns
    -------
    bool
        True is a proof; False says only that no proof was found.
    """
    n = matrix.nrows()
    if n == 0:
        return True
    diagonal = np.array([float(matrix[i, i].lower()) for i in range(n)])
    if not (np.isfinite(diagonal).all() and (diagonal > 0).all()):
        return False
    scale = ball(np.diag(_powers_of_two(diagonal)))
    scaled = scale * matrix * scale
    return _near_identity(scaled) or (n <= _ELIMINATED and _eliminates(scaled))


def _near_identity(matrix: Ball) -> bool:
    try:
        factor = np.linalg.cholesky(midpoint(matrix))
        inverse = np.linalg.solve(factor, np.eye(len(factor)))
    except np.linalg.LinAlgError:
        return False
    if not np.isfinite(inverse).all():
        return False
    G = ball(inverse)
    rest = magnitude(identity(len(factor)) - G * matrix * G.transpose())
    # The factor covers the rounding errors of the sums, which are taken in doubles.
    return bool(np.isfinite(rest).all() and (rest.sum(axis=1) * (1 + 1e-12)).max() < 1)


def _eliminates(matrix: Ball) -> bool:
    """Tell whether Gaussian elimination proves all pivots to be positive."""
    rows = matrix.tolist()
    for k, row in enumerate(rows):
        pivot = row[k]
        if not pivot.lower() > 0:
            return False
        for i in range(k + 1, len(rows)):
            factor = rows[i][k] / pivot
            rows[i] = rows[i][: k + 1] + [
                a - factor * b for a, b in zip(rows[i][k + 1 :], row[k + 1 :], strict=True)
            ]
    return True


def _powers_of_two(diagonal: Matrix) -> Matrix:
    """Scale a diagonal to about one without rounding."""
    return np.exp2(-np.round(np.log2(diagonal) / 2))
