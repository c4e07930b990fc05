import numpy as np
import pytest

from robustpolish.synthesis.uncertain.dk_iteration import (
    Filter,
    fitted,
    repeated_filters,
    scaled_norms,
)

OMEGA = np.array([0.0, *np.geomspace(1e-3, 1e3, 60), np.inf])


def _gain(K, omega):
    if np.isinf(omega):
        return abs(K.D[0, 0])
    return abs(K.D + K.C @ np.linalg.solve(1j * omega * np.eye(len(K.A)) - K.A, K.B))[0, 0]


def test_filter_has_the_sizes_that_it_tells_and_a_stable_inverse():
    one = Filter(2.0, np.array([0.5, 30.0]), np.array([3.0, 7.0]))
    for f in (one, one.inverse):
        K = f.matrices
        assert np.linalg.eigvals(K.A).real.max() < 0
        assert np.log([_gain(K, w) for w in OMEGA]) == pytest.approx(f.sizes(OMEGA), abs=1e-10)
    assert one.sizes(OMEGA) + one.inverse.sizes(OMEGA) == pytest.approx(
        np.zeros(len(OMEGA)), abs=1e-12
    )


def test_sizes_of_a_filter_are_fitted_by_one_of_its_order():
    true = Filter(0.3, np.array([0.2, 8.0]), np.array([1.0, 1.5]))
    found = fitted(OMEGA, true.sizes(OMEGA), np.ones(len(OMEGA)), 2)
    assert [len(f.poles) for f in found] == [0, 1, 2]
    errors = [np.abs(f.sizes(OMEGA) - true.sizes(OMEGA)).max() for f in found]
    assert errors[2] < 0.01 < errors[0]


def test_filters_stand_beside_each_other():
    both = repeated_filters(
        [Filter(2.0, np.array([1.0]), np.array([3.0])), Filter(5.0, *np.zeros((2, 0)))], [2, 1]
    )
    assert pytest.approx(np.diag([6.0, 6.0, 5.0])) == both.D
    assert both.A.shape == (2, 2)


def test_norms_are_those_of_the_scaled_matrices():
    M = np.ones((1, 2, 2), complex)
    scales = np.array([[2.0, 1.0]])
    expected = np.linalg.norm([[1, 2], [0.5, 1]], 2)
    assert scaled_norms(M, scales, scales) == pytest.approx([expected])
