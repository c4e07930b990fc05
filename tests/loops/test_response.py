"""Responses, levels and phases at exact frequencies, at poles and at the ends of the axis."""

import control
import numpy as np
import pytest

from robustpolish.loops.response import SystemResponse, roots
from tests.loops.loops_for_tests import TEXTBOOK, random_loop, s


def test_values_are_those_of_python_control():
    system = random_loop(0)[1]
    omega = np.array([0.0, 0.3, 5.0])
    expected = np.moveaxis(control.frequency_response(system, omega).complex, 2, 0)
    np.testing.assert_allclose(SystemResponse(system).at(omega), expected, rtol=1e-10)


def test_many_states_give_the_same_values():
    rng = np.random.default_rng(0)
    blocks = [
        control.ss([[0, w], [-w, -0.02 * w]], rng.random((2, 2)), rng.random((2, 2)), 0)
        for w in np.geomspace(0.1, 100, 15)
    ]
    whole = sum(blocks[1:], blocks[0])
    omega = np.geomspace(0.01, 1e3, 37)
    expected = np.moveaxis(control.frequency_response(whole, omega).complex, 2, 0)
    np.testing.assert_allclose(SystemResponse(whole).at(omega), expected, rtol=1e-9, atol=1e-13)


def test_infinity_and_poles_on_the_axis():
    response = SystemResponse(control.ss(1 / s) + 2)
    assert response.scalar(np.inf)[0] == 2
    assert np.isinf(response.sizes(0.0)[0, 0])
    both = SystemResponse(control.ss(1 / s)).sizes(np.array([0.0, 2.0]))
    np.testing.assert_allclose(both[:, 0], [np.inf, 0.5])


def test_levels():
    assert SystemResponse(control.ss(TEXTBOOK)).level_crossings(1.0) == pytest.approx(
        [0.74936827582]
    )
    oscillator = SystemResponse(control.ss(1 / (s**2 + 1e-6 * s + 1)))
    low, high = oscillator.level_crossings(1e5)
    assert (high - low) == pytest.approx(np.sqrt(1e-10 - 1e-12), rel=1e-4)
    assert SystemResponse(control.ss([], [], [], [[3.0]])).level_crossings(1.0) == []


def test_a_level_that_is_that_of_the_feedthrough():
    allpass = SystemResponse(control.ss((s - 1) / (s + 1)))
    assert len(allpass.level_crossings(1.0)) == 2  # the ends of a gain that is 1 everywhere
    lead = SystemResponse(control.ss((s + 2) / (s + 1)))
    assert lead.level_crossings(1.5) == pytest.approx([np.sqrt(1.75 / 1.25)])


def test_phases():
    assert SystemResponse(control.ss(TEXTBOOK)).phase_crossings() == pytest.approx([np.sqrt(2)])
    # An undamped mode turns the phase at its pole, where nothing crosses the negative axis.
    assert SystemResponse(control.ss(s / (s**2 + 1))).phase_crossings() == []


def test_discrete_time_ends_at_nyquist():
    response = SystemResponse(control.ss(control.tf([0.5], [1, -1], 0.1)))
    assert response.highest == pytest.approx(np.pi / 0.1)
    assert response.grid.max() <= response.highest * (1 + 1e-12)
    assert response.level_crossings(1.0) == pytest.approx([2 * np.arcsin(0.25) / 0.1])


def test_roots_cross_touch_and_stay():
    points = [np.array([0.5, 1.0, 2.0, 4.0])]
    assert roots(lambda w: np.atleast_1d(w) - 1.7, points) == pytest.approx([1.7])
    assert roots(lambda w: (np.atleast_1d(w) - 2.0) ** 2, points) == [2.0]
    assert roots(lambda w: np.atleast_1d(w) + 1, points) == []
    assert roots(lambda w: np.atleast_1d(w) - 0.5, points) == pytest.approx([0.5])
