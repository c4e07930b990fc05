"""Rank and dependence of columns in ball arithmetic."""

import numpy as np
import pytest

from robustpolish.linear.arithmetic.balls import (
    ball,
    independent_first,
    midpoint,
    part,
    precision,
)


@pytest.mark.parametrize("rank", [0, 1, 2, 3])
def test_dependent_columns_vanish(rank):
    rng = np.random.default_rng(rank)
    # Whole numbers: the product is exact.
    M = rng.integers(-9, 10, (5, rank)).astype(float) @ rng.integers(-9, 10, (rank, 3))
    with precision(300):
        turn, found = independent_first(ball(M))
        turned = ball(M) * turn
        assert found == rank
        assert np.linalg.matrix_rank(midpoint(turned)[:, :rank], tol=1e-9) == rank
        assert all(entry.contains(0) for entry in part(turned, columns=slice(rank, None)).entries())
        assert np.linalg.matrix_rank(midpoint(turn)) == 3


def test_what_doubles_call_nothing_counts():
    with precision(300):
        _, rank = independent_first(ball(np.array([[1.0, 1.0], [0.0, 1e-60]])))
    assert rank == 2


def test_a_part_may_be_empty():
    with precision(100):
        M = ball(np.arange(6.0).reshape(2, 3))
        none = part(M, columns=slice(3, None))
        assert (none.nrows(), none.ncols()) == (2, 0)
        assert midpoint(part(M, rows=slice(1, None), columns=slice(0, 2))).tolist() == [[3.0, 4.0]]
