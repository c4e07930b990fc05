"""Coordinates that suit doubles: powers of two, and nothing else changed."""

import numpy as np

from robustpolish.implementation.sampled.lifting import border_scale, period_map, scaled
from tests.implementation.designs import sampled_servo, servo


def test_factors_are_powers_of_two_and_the_poles_stay():
    found = period_map(servo(), sampled_servo().controller, 0.05, 0.02)
    loop = scaled(found)
    for factors in (loop.flow, loop.sample):
        np.testing.assert_array_equal(np.log2(factors), np.round(np.log2(factors)))
    poles = np.sort(np.abs(np.linalg.eigvals(loop.transition())))
    expected = np.sort(np.abs(sampled_servo().certificate.poles))
    np.testing.assert_allclose(poles, expected, rtol=1e-8)


def test_rows_and_columns_become_alike():
    size = np.array([[1.0, 1e12], [1e-12, 1.0]])
    T = border_scale(size, np.array([1e6, 1e-6]), np.array([1e-6, 1e6]))
    even = size * T / T[:, None]
    assert even.max() < 1e2
    assert border_scale(np.array([[np.inf]]), np.ones(1), np.ones(1)).tolist() == [1.0]
