"""Robust analysis against SLICOT's AB13MD, which bounds mu of a matrix from above.

Ours proves its upper bound and gives a lower one with a witness. For a loop AB13MD is called on a
grid of frequencies; what lies between them it does not see.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from slycot import ab13md

import robustpolish as rp
from benchmarks.row import Row, milliseconds
from tests.reference.examples import carts

GRID = 500

_MATRIX = (
    "ours proves the bound in ball arithmetic and searches a lower bound with a witness; the peer "
    "gives an upper bound alone, unproven"
)
_LOOP = (
    "ours proves the margin for all frequencies and gives a destabilising machine; the peer looks "
    "at the points of the grid alone, and its peak lies below the true one"
)


def random_problem(blocks: int, seed: int) -> tuple[np.ndarray, list, np.ndarray, np.ndarray]:
    """Return a matrix, its blocks for us, and their sizes and kinds for AB13MD."""
    random = np.random.default_rng(seed)
    kinds = [("real", "complex", "full")[k % 3] for k in range(blocks)]
    sizes = [2 if kind == "full" else 1 for kind in kinds]
    n = sum(sizes)
    M = random.standard_normal((n, n)) + 1j * random.standard_normal((n, n))
    given = [("full", k) if kind == "full" else kind for kind, k in zip(kinds, sizes, strict=True)]
    return M, given, np.array(sizes), np.array([1 if kind == "real" else 2 for kind in kinds])


def rows(quick: bool) -> Iterator[Row]:
    """Time matrices with growing structures, and one loop."""
    for blocks in (3,) if quick else (3, 6, 9):
        M, given, sizes, codes = random_problem(blocks, blocks)
        mu = rp.structured_singular_value(M, given)
        ours = milliseconds(3, rp.structured_singular_value, M, given)
        theirs = milliseconds(20, ab13md, M, sizes, codes)
        said = f"{mu.lower:.6g} to {mu.upper:.6g}, peer {ab13md(M, sizes, codes)[0]:.6g}"
        yield Row(
            "robust analysis", f"mu of a matrix, {blocks} mixed blocks",
            "rp.structured_singular_value", ours, "AB13MD", theirs, said, reason=_MATRIX,
        )  # fmt: skip
    loop = carts()
    M, ones = loop.interconnection[:3, :3], np.ones(3, int)

    def on_grid() -> float:
        points = np.logspace(-2, 4, GRID)
        return max(ab13md(np.atleast_2d(M(1j * w)), ones, ones)[0] for w in points)

    margin = rp.robust_stability(loop)
    ours = milliseconds(2, lambda: rp.robust_stability(carts()))
    theirs = milliseconds(2, on_grid)
    said = f"mu {1 / margin.upper:.5f} to {1 / margin.lower:.5f}, peer {on_grid():.5f}"
    yield Row(
        "robust analysis", f"two carts, three real numbers; the peer on {GRID} frequencies",
        "rp.robust_stability", ours, "AB13MD on a grid", theirs, said, reason=_LOOP,
    )  # fmt: skip
