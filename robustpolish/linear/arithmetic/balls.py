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

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import Vector
from robustpolish.base.budget import check_deadline

Ball = Any  # flint.arb_mat; python-flint ships no stubs for it

# Beside the strongest direction, doubles see those above this; a pass of the proof of definiteness
# brings up the weaker ones by its inverse, about so many bits.
_WEAK = 1e-13
_BITS_PER_PASS = 40


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
    table = joined_rows(rows)
    columns = sum(part.ncols() for part in rows[0])
    return flint.arb_mat(table) if table and columns else zeros(len(table), columns)


def part(matrix: Ball, rows: Sequence[int], columns: Sequence[int]) -> Ball:
    """Return the entries of some rows and columns of a real matrix."""
    entries = [matrix[i, j] for i in rows for j in columns]
    return flint.arb_mat(len(rows), len(columns), entries)


def joined_rows(blocks: Sequence[Sequence[Any]]) -> list[list[Any]]:
    """Join rows of blocks, of any kind of number; blocks without columns are passed over."""
    rows: list[list[Any]] = []
    for line in blocks:
        tables = [block.tolist() for block in line if block.ncols()]
        rows += [[entry for table in tables for entry in table[i]] for i in range(line[0].nrows())]
    return rows


def midpoint(matrix: Ball) -> Matrix:
    """Return the centres, real or complex, rounded to doubles."""
    shape = matrix.nrows(), matrix.ncols()
    kind: Any = complex if isinstance(matrix, flint.acb_mat) else float
    return np.array(list(map(kind, matrix.mid().entries())), dtype=kind).reshape(shape)


def magnitude(matrix: Ball) -> Matrix:
    """Return upper bounds of the absolute values of the entries."""
    shape = matrix.nrows(), matrix.ncols()
    return np.array([float(entry.abs_upper()) for entry in matrix.entries()]).reshape(shape)


def symmetric(matrix: Ball) -> Ball:
    """Return the mean of a matrix and its transpose."""
    return (matrix + matrix.transpose()) * flint.arb(0.5)


def scaled(matrix: Ball, rows: Vector, columns: Vector) -> Ball:
    """Multiply rows and columns by powers of two, which rounds nothing.

    A product with a diagonal matrix takes as long as one with any other: of 400 states five times
    as long as this.
    """
    if not (matrix.nrows() and matrix.ncols()):
        return matrix
    left, right = ([flint.arb(float(factor)) for factor in each] for each in (rows, columns))
    table = zip(left, matrix.tolist(), strict=True)
    return flint.arb_mat(
        [[entry * r * c for entry, c in zip(row, right, strict=True)] for r, row in table]
    )


def is_positive_definite(matrix: Ball) -> bool:
    """Prove that every symmetric matrix enclosed by `matrix` is positive definite.

    M > 0 follows from G M G' > 0 for any square G, whatever it is. G is made of the eigenvectors
    of M in doubles and turns M into a matrix near the identity, up to directions that are too weak
    beside the others for doubles; in these it is repeated. A matrix whose distance from the
    identity has a row-sum norm below one is positive definite.

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
    # Powers of two bring the diagonal to about one without rounding.
    scale = np.exp2(-np.round(np.log2(diagonal) / 2))
    turned = scaled(matrix, scale, scale)
    for _ in range(flint.ctx.prec // _BITS_PER_PASS + 1):
        check_deadline()
        centre = midpoint(turned)
        if not np.isfinite(centre).all():
            return False
        values, vectors = np.linalg.eigh((centre + centre.T) / 2)
        if values[0] < -100 * _WEAK * values[-1]:
            return False
        G = ball((vectors / np.sqrt(np.maximum(values, _WEAK * values[-1]))).T)
        turned = G * turned * G.transpose()
        rest = magnitude(identity(n) - turned)
        # The factor covers the rounding errors of the sums, which are taken in doubles.
        if np.isfinite(rest).all() and (rest.sum(axis=1) * (1 + 1e-12)).max() < 1:
            return True
    return False


# Which columns of a matrix in ball arithmetic depend on the others, by elimination.


def columns_of(M: Ball, rows: slice = slice(None), columns: slice = slice(None)) -> Ball:
    """Return the block of some rows and columns."""
    table = [row[columns] for row in M.tolist()][rows]
    width = len(range(*columns.indices(M.ncols())))
    return flint.arb_mat(len(table), width, [entry for row in table for entry in row])


def independent_first(M: Ball) -> tuple[Ball, int]:
    """Combine columns such that the first ones are independent and the others vanish.

    What a ball arithmetic with enough digits cannot tell from zero is zero: numbers that come
    from doubles in a few steps are zero or larger by far than the radius.

    Parameters
    ----------
    M : flint.arb_mat
        Exact, or enclosed with radii from rounding only.

    Returns
    -------
    T : flint.arb_mat
        Invertible; M T has columns that are independent, and then columns that vanish.
    rank : int
        How many are independent.
    """
    n = M.ncols()
    columns: list[list[Any]] = [list(column) for column in M.transpose().tolist()]
    turns = [[flint.arb(int(i == j)) for j in range(n)] for i in range(n)]
    rank = 0
    while rank < n:
        sizes = [
            (entry.abs_lower(), i, j)
            for i in range(rank, n)
            for j, entry in enumerate(columns[i])
            if not entry.contains(0)
        ]
        if not sizes:
            break
        # The largest entry there is: the others are then combined with factors of at most one.
        _, i, j = max(sizes, key=lambda size: float(size[0].mid().log()))
        for table in (columns, turns):
            table[rank], table[i] = table[i], table[rank]
        for k in range(rank + 1, n):
            factor = columns[k][j] / columns[rank][j]
            for table in (columns, turns):
                table[k] = [x - factor * y for x, y in zip(table[k], table[rank], strict=True)]
            columns[k][j] = flint.arb(0)
        rank += 1
    T = flint.arb_mat(n, n, [entry for column in turns for entry in column]).transpose()
    return T, rank
