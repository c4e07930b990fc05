"""Matrices that carry proven bounds on their rounding errors."""

import flint
import numpy as np
import pytest

from robustpolish.linear.arithmetic.balls import (
    ball,
    block,
    identity,
    magnitude,
    midpoint,
    precision,
    scaled,
    symmetric,
    zeros,
)
from robustpolish.linear.proofs.definite import is_definite


def test_doubles_are_enclosed_exactly():
    M = np.array([[0.1, -3.0], [1e300, 2.0**-1074]])
    np.testing.assert_array_equal(midpoint(ball(M)), M)
    assert all(entry.is_exact() for entry in ball(M).entries())


def test_the_precision_is_restored_even_by_an_error():
    before = flint.ctx.prec
    with pytest.raises(ZeroDivisionError), precision(999):
        assert flint.ctx.prec == 999
        raise ZeroDivisionError
    assert flint.ctx.prec == before


def test_a_sum_in_balls_holds_the_exact_one():
    """(1 + 2^-80) - 1 is lost in doubles and kept, or covered by the radius, in balls."""
    for bits in (53, 200):
        with precision(bits):
            tiny = ball([[2.0**-80]])
            rest = identity(1) + tiny - identity(1)
            assert rest[0, 0].contains(flint.arb(2) ** -80)
            assert magnitude(rest)[0, 0] >= 2.0**-80


def test_blocks_are_put_together():
    corner = ball([[1.0, 2.0]])
    whole = block([[identity(2), corner.transpose()], [corner, zeros(1, 1)]])
    np.testing.assert_array_equal(midpoint(whole), [[1, 0, 1], [0, 1, 2], [1, 2, 0]])
    empty = block([[zeros(2, 0), identity(2)]])
    np.testing.assert_array_equal(midpoint(empty), np.eye(2))
    assert midpoint(block([[zeros(2, 0)]])).shape == (2, 0)


def test_parts():
    M = ball([[1.0, 4.0], [2.0, -3.0]])
    np.testing.assert_array_equal(midpoint(symmetric(M)), [[1.0, 3.0], [3.0, -3.0]])
    np.testing.assert_array_equal(magnitude(M), [[1.0, 4.0], [2.0, 3.0]])


def test_definiteness_is_proven_far_beyond_doubles():
    """The least eigenvalue of the Hilbert matrix of order 12 is between 1e-16 and 2e-16."""
    with precision(300):
        n, small = 12, flint.arb(10) ** -16
        hilbert = flint.arb_mat([[1 / flint.arb(i + j + 1) for j in range(n)] for i in range(n)])
        assert is_definite(hilbert - identity(n) * small)
        assert not is_definite(hilbert - identity(n) * (2 * small))


def test_an_enclosure_that_holds_an_indefinite_matrix_is_not_proven():
    wide = flint.arb(1, 2)  # between -1 and 3
    assert not is_definite(flint.arb_mat([[wide]]))
    assert not is_definite(ball([[1.0, 2.0], [2.0, 1.0]]))
    assert is_definite(zeros(0, 0))


def test_rows_and_columns_are_scaled_without_rounding():
    M = ball(np.array([[1.0, 3.0], [0.1, -7.0], [1e300, 5e-324]]))
    rows, columns = np.array([2.0**900, 0.5, 1.0]), np.array([2.0**900, 2.0**-10])
    found = scaled(M, rows, columns)
    product = ball(np.diag(rows)) * M * ball(np.diag(columns))
    assert all(entry.is_exact() for entry in found.entries())
    assert all(a == b for a, b in zip(found.entries(), product.entries(), strict=True))


@pytest.mark.parametrize("shape", [(0, 2), (2, 0), (0, 0)])
def test_nothing_is_scaled_to_nothing(shape):
    found = scaled(zeros(*shape), np.ones(shape[0]), np.ones(shape[1]))
    assert (found.nrows(), found.ncols()) == shape
