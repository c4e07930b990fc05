"""Which columns of a matrix in ball arithmetic depend on the others, by elimination."""

from __future__ import annotations

from typing import Any

import flint

from robustpolish.exact.balls import Ball


def part(M: Ball, rows: slice = slice(None), columns: slice = slice(None)) -> Ball:
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
