"""The rightmost roots and their confirmation."""

import numpy as np
import pytest
from scipy.special import lambertw

from robustpolish.linear.delays.stability import rightmost_roots


def first_order(a, b):
    return tuple(np.array([[v]]) for v in (a, b, 1.0, 0.0))


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize(("a", "b", "T"), [(-1.0, -2.0, 0.3), (0.5, -1.0, 1.0), (-1.0, 0.8, 4.0)])
def test_roots_of_a_first_order_equation_are_those_of_lambert(a, b, T, unit):
    # s = a + b exp(-s T): (s - a) T = W(b T exp(-a T))
    expected = a + lambertw(b * T * np.exp(-a * T), np.arange(-8, 9)) / T
    expected = expected[np.argsort(-expected.real)][:4]
    ports = first_order(a * unit, b * unit)
    found = rightmost_roots(ports, np.array([T / unit]), 3 / T * unit)
    np.testing.assert_allclose(np.sort(found[:4].real) / unit, np.sort(expected.real), rtol=1e-9)
    largest = np.abs(expected.imag)
    np.testing.assert_allclose(np.sort(np.abs(found[:4].imag)) / unit, np.sort(largest), atol=1e-8)


def test_what_is_too_large_is_left_alone():
    assert rightmost_roots(first_order(-1.0, -2.0), np.array([1.0]), 1e6).size == 0
