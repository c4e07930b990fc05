"""Frequency responses of large loops."""

import numpy as np
import pytest

from robustpolish.synthesis.proofs.frequency_response import responses


@pytest.mark.parametrize(("n", "m", "p"), [(1, 1, 1), (2, 3, 1), (60, 2, 4)])
def test_they_are_those_of_a_solved_system(n, m, p):
    rng = np.random.default_rng(n)
    A, B, C, D = (rng.standard_normal(shape) for shape in ((n, n), (n, m), (p, n), (p, m)))
    frequencies = np.array([0.0, 0.3, -7.0, 1e4])
    expected = [D + C @ np.linalg.solve(1j * x * np.eye(n) - A, B) for x in frequencies]
    np.testing.assert_allclose(responses(A, B, C, D, frequencies), expected, rtol=1e-9)


def test_rows_are_exchanged_where_the_pivot_vanishes():
    A = np.array([[0.0, 1.0], [-1.0, -0.1]])  # at zero frequency the first pivot is zero
    found = responses(A, np.eye(2), np.eye(2), np.zeros((2, 2)), np.zeros(1))
    np.testing.assert_allclose(found[0], np.linalg.inv(-A), atol=1e-12)


def test_a_pole_that_is_hit_has_no_finite_response():
    A = np.array([[0.0, 1.0], [-1.0, 0.0]])
    found = responses(A, np.eye(2), np.eye(2), np.zeros((2, 2)), np.array([1.0, 2.0]))
    assert not np.isfinite(found[0]).all()
    assert np.isfinite(found[1]).all()
