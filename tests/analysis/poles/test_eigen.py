"""Eigenvalues with their errors and the share of each state."""

import numpy as np

from robustpolish.linear.eigen import EPS, eigensystem


def test_errors_cover_what_rounding_does():
    rng = np.random.default_rng(0)
    for _ in range(20):
        lower = np.tril(rng.integers(-3, 4, (5, 5)), -1) + np.eye(5)
        exact = np.arange(1.0, 6.0)
        found = eigensystem(lower @ np.diag(exact) @ np.linalg.inv(lower))
        order = np.argsort(found.values.real)
        assert (abs(found.values[order] - exact) <= found.errors[order]).all()
        assert found.errors.max() < 1e-8


def test_nearly_multiple_eigenvalues_are_uncertain():
    defective = eigensystem(np.array([[1.0, 1.0], [0.0, 1.0]]))
    assert defective.errors.min() > 1e3 * EPS


def test_shares_do_not_depend_on_units():
    A = np.array([[-1.0, 2.0], [0.5, -3.0]])
    units = np.array([1e-9, 1e6])
    one, other = eigensystem(A), eigensystem(A * units / units[:, None])
    order = np.argsort(one.values), np.argsort(other.values)
    np.testing.assert_allclose(one.shares[:, order[0]], other.shares[:, order[1]], atol=2e-3)
    np.testing.assert_allclose(one.shares.sum(axis=0), 1.0, atol=2e-3)
    np.testing.assert_array_equal(eigensystem(np.diag([1.0, 2.0])).shares, np.eye(2))


def test_no_states():
    assert eigensystem(np.zeros((0, 0))).values.size == 0
