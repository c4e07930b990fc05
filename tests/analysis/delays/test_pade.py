"""The Pade approximation of a delay."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.linear.delays.systems import MOST_ORDER, pade


def response(seconds, order, omega):
    A, B, C, D = pade(seconds, order)
    return np.array([(C @ np.linalg.solve(1j * w * np.eye(order) - A, B) + D)[0, 0] for w in omega])


@pytest.mark.parametrize("order", [1, 2, 3, 6, 11, MOST_ORDER])
def test_it_is_the_rational_function_of_python_control(order):
    omega = np.geomspace(1, 1e5, 40)
    num, den = control.pade(1e-3, order)
    expected = np.polyval(num, 1j * omega) / np.polyval(den, 1j * omega)
    np.testing.assert_allclose(response(1e-3, order, omega), expected, rtol=1e-10)


@pytest.mark.parametrize("order", [1, 2, 3, 4, 7, 15])
def test_gain_one_everywhere_and_the_right_phase_up_to_its_order(order):
    omega = np.linspace(0.1, order, 30) / 2e-4
    found = response(2e-4, order, omega)
    np.testing.assert_allclose(np.abs(found), 1, rtol=1e-12)
    assert np.abs(found - np.exp(-2e-4j * omega)).max() < 0.08


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ((0.0, 2), "seconds: got 0.0"),
        ((1.0, 0), "order: got 0"),
        ((1.0, 21), "order: got 21"),
        ((1.0, "3"), "order: got '3'"),
    ],
)
def test_bad_delays_are_named(given, told):
    with pytest.raises(rp.InvalidInputError, match=told):
        pade(*given)
