"""Exact responses of linear systems, and of systems that move between given ones."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.linear.response import linear_response, varying_response

# The exact response against closed forms and against itself on a finer grid.


def test_oscillator_under_a_ramp():
    """From rest, x'' + w^2 x = t gives x = (t - sin(w t) / w) / w^2."""
    w = 37.0
    system = control.ss([[0, 1], [-(w**2), 0]], [[0], [1]], [[1, 0]], 0)
    time = np.linspace(0, 2, 401)
    outputs, _ = linear_response(system, time, time[:, None])
    np.testing.assert_allclose(outputs[:, 0], (time - np.sin(w * time) / w) / w**2, atol=1e-13)


def test_free_decay():
    system = control.ss([[-3.0]], np.zeros((1, 1)), [[2.0]], 0)
    time = np.linspace(0, 1, 11)
    outputs, states = linear_response(system, time, np.zeros((11, 1)), [5.0])
    np.testing.assert_allclose(states[:, 0], 5 * np.exp(-3 * time), rtol=1e-13)
    np.testing.assert_allclose(outputs, 2 * states)


@pytest.mark.parametrize("dissipation", [0.0, 0.001])
def test_the_air_bearing_is_exact_at_20_khz(dissipation):
    """A four times finer grid with the same piecewise linear load gives the same answer."""
    system = rp.air_bearing(dissipation=dissipation).open_loop
    coarse, fine = np.arange(20001) / 20e3, np.arange(80001) / 80e3
    load = np.random.default_rng(0).standard_normal((coarse.size, 4))
    fine_load = np.stack([np.interp(fine, coarse, column) for column in load.T], axis=1)
    expected, _ = linear_response(system, fine, fine_load)
    outputs, _ = linear_response(system, coarse, load)
    error = np.max(np.abs(outputs - expected[::4]), axis=0) / np.max(np.abs(outputs), axis=0)
    assert np.max(error) < 1e-8


def test_discrete_time_steps():
    system = control.ss([[0.5]], [[1.0]], [[1.0]], [[2.0]], 0.1)
    outputs, states = linear_response(system, [0, 0.1, 0.2], [[1], [0], [0]])
    np.testing.assert_allclose(states[:, 0], [0, 1, 0.5])
    np.testing.assert_allclose(outputs[:, 0], [2, 1, 0.5])
    with pytest.raises(InvalidInputError, match=r"time: got a step of 0\.2"):
        linear_response(system, [0, 0.2], [[1], [0]])


def test_static_system():
    system = control.ss([], [], [], [[2.0, 1.0]])
    outputs, _ = linear_response(system, [0, 1], [[1, 0], [1, 1]])
    np.testing.assert_allclose(outputs[:, 0], [2, 3])


@pytest.mark.parametrize(
    ("change", "argument"),
    [
        ({"time": [0, 1, 3]}, "time"),
        ({"time": [2, 1, 0]}, "time"),
        ({"inputs": [[1.0], [2.0]]}, "inputs"),
        ({"inputs": [[1.0], [np.nan], [0]]}, "inputs"),
        ({"initial_state": [1, 2]}, "initial_state"),
        ({"system": 3}, "system"),
    ],
)
def test_bad_input_is_named(change, argument):
    good = {"system": control.ss(-1, 1, 1, 0), "time": [0, 1, 2], "inputs": [[1.0], [2.0], [3.0]]}
    with pytest.raises(InvalidInputError, match=f"^{argument}"):
        linear_response(**(good | change))


# Systems that move between given ones.


T = np.linspace(0, 4, 401)
LAGS = [tuple(np.array([[v]]) for v in (-rate, 1.0, 1.0, 0.5)) for rate in (1.0, 3.0)]


def test_at_rest_it_is_the_linear_response():
    u = np.sin(3 * T)[:, None]
    shares = np.tile([0.25, 0.75], (T.size, 1))
    own = varying_response(LAGS, shares, 0.01, u)
    still = linear_response(control.ss([[-2.5]], [[1.0]], [[1.0]], [[0.5]]), T, u)
    assert own.outputs == pytest.approx(still.outputs, abs=1e-13)


def test_a_moving_lag_converges_with_the_square_of_the_step():
    # x' = -(2 + sin t) x + 1 against a fine solution of its integral.
    def end(samples):
        t = np.linspace(0, 4, samples)
        high = (1 + np.sin(t)) / 2
        shares = np.stack([1 - high, high], axis=1)
        return varying_response(LAGS, shares, t[1], np.ones((samples, 1))).states[-1, 0]

    fine = np.linspace(0, 4, 200_001)
    decay = np.exp(2 * (fine - 4) + np.cos(4) - np.cos(fine))
    true = np.trapezoid(decay, fine)
    errors = [abs(end(samples) - true) for samples in (101, 201)]
    assert errors[0] < 1e-3
    assert errors[1] == pytest.approx(errors[0] / 4, rel=0.1)


def test_shapes_are_checked():
    with pytest.raises(rp.InvalidInputError, match="shares"):
        varying_response(LAGS, np.ones((3, 2)), 0.1, np.ones((4, 1)))
    with pytest.raises(rp.InvalidInputError, match="step"):
        varying_response(LAGS, np.ones((3, 2)), 0.0, np.ones((3, 1)))
