"""Matrices in ball arithmetic: every entry carries a proven bound on its rounding error.

python-flint's ``arb_mat`` encloses each number in a ball, so a conclusion drawn from balls
holds for the exact numbers. A 120 x 120 product takes about 10 ms at 200 bits, which is why
the certificates are checked in balls throughout rather than with hand-made error bounds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import flint
import numpy as np

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import Vector

Ball = Any  # flint.arb_mat or flint.acb_mat; python-flint ships no stubs for them


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
    return flint.arb_mat(*array.shape, array.ravel().tolist())  # pyright: ignore[reportCallIssue]


def complex_ball(matrix: Matrix) -> Ball:
    """Enclose a complex matrix of doubles, exactly."""
    array = np.asarray(matrix, dtype=complex)
    return flint.acb_mat(*array.shape, array.ravel().tolist())  # pyright: ignore[reportCallIssue]


def zeros(rows: int, columns: int) -> Ball:
    """Return the zero matrix."""
    return flint.arb_mat(rows, columns)


def identity(n: int) -> Ball:
    """Return the identity matrix."""
    return ball(np.eye(n))


def block(rows: Sequence[Sequence[Any]]) -> Any:
    """Assemble a matrix of blocks: balls, real or complex, or rational numbers."""
    table, columns = joined_rows(rows), sum(part.ncols() for part in rows[0])
    entries = [entry for row in table for entry in row]
    return type(rows[0][0])(len(table), columns, entries)


def part(
    matrix: Ball,
    rows: Sequence[int] | slice = slice(None),
    columns: Sequence[int] | slice = slice(None),
) -> Ball:
    """Return the entries of some rows and columns of a real matrix."""
    i, j = (
        range(size)[chosen] if isinstance(chosen, slice) else chosen
        for size, chosen in ((matrix.nrows(), rows), (matrix.ncols(), columns))
    )
    return flint.arb_mat(len(i), len(j), [matrix[a, b] for a in i for b in j])


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


# Systems of four real matrices.


def transfer_matrix(
    A: Ball, B: Ball, C: Ball, D: Ball, s: Any, solve: Callable[[Ball, Ball], Ball] | None = None
) -> Ball:
    """Return D + C (s - A)^-1 B.

    Parameters
    ----------
    A, B, C, D : flint.arb_mat
    s : flint.acb or None
        None is infinity.
    solve : callable, optional
        Solves M X = B; flint by default, which encloses X.

    Returns
    -------
    flint.acb_mat

    Raises
    ------
    ZeroDivisionError
        If s is a pole as far as the balls can tell.
    """
    n, direct = A.nrows(), flint.acb_mat(D)
    if s is None or not n:
        return direct
    resolvent, into = -flint.acb_mat(A), flint.acb_mat(B)
    for i in range(n):
        resolvent[i, i] += s
    states = resolvent.solve(into) if solve is None else solve(resolvent, into)
    return direct + flint.acb_mat(C) * states


def cayley(A: Ball, B: Ball, C: Ball, D: Ball) -> tuple[Ball, Ball, Ball, Ball]:
    """Map a discrete system by z = (1 + s)/(1 - s), which keeps gains, stability and Gramians.

    Raises
    ------
    ZeroDivisionError
        If A + I is singular, in which case the system is not stable.
    """
    one, root = identity(A.nrows()), flint.arb(2).sqrt()
    inverse = (A + one).inv()
    return inverse * (A - one), inverse * B * root, C * inverse * root, D - C * inverse * B


# Which columns of a matrix in ball arithmetic depend on the others, by elimination.


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
