"""The inverse of the eigenvectors, and the signals in modal coordinates."""

import numpy as np
import pytest

from robustpolish.linear.eigen import eigensystem
from robustpolish.linear.norms.modal_expansion import inverse, signals


def vectors(A):
    spectrum = eigensystem(A)
    return np.ascontiguousarray(spectrum.left.T), np.ascontiguousarray(spectrum.right.T)


@pytest.mark.parametrize("states", [1, 2, 7, 40])
def test_the_gap_bounds_what_the_inverse_misses(states):
    left, right = vectors(np.random.default_rng(states).standard_normal((states, states)))
    X, off, least = inverse(left, right)
    missed = np.abs(X @ right.T - np.eye(states)).sum(axis=1).max()
    assert missed <= off < 1e-9
    assert 0 < least <= 1 + 1e-12


def test_a_rough_inverse_has_a_gap():
    left, right = vectors(np.random.default_rng(3).standard_normal((6, 6)))
    rough = left * (1 + 1e-6 * np.random.default_rng(4).standard_normal((6, 6)))
    X, off, _ = inverse(rough, right)
    missed = np.abs(X @ right.T - np.eye(6)).sum(axis=1).max()
    assert 1e-7 < missed <= off < 1.001 * missed


def test_vectors_that_span_nothing_have_no_inverse():
    left, right = vectors(np.array([[1.0, 1.0], [0.0, 1.0]]))
    assert inverse(left, right)[2] < 1e-8
    X, off, least = inverse(np.array([[1, 0j]]), np.array([[0j, 1]]))
    assert least == 0
    assert not np.isfinite(X).all()
    assert not off < 0.1  # no number, which no comparison takes for a small one


def test_signals_are_within_their_errors():
    rng = np.random.default_rng(5)
    left, right = vectors(rng.standard_normal((9, 9)))
    B, C = rng.standard_normal((9, 2)) + 0j, rng.standard_normal((3, 9)) + 0j
    X = inverse(left, right)[0]
    b, c, b_error, c_error = signals(X, right, B, C)
    wide = np.linalg.solve(right.T.astype(complex), B)
    np.testing.assert_allclose(np.linalg.norm(b - wide, axis=1), 0, atol=10 * b_error.max())
    assert (np.linalg.norm(c - C @ right.T, axis=0) <= c_error).all()
    assert b_error.max() < 1e-12
    assert c_error.max() < 1e-12
