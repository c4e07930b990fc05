"""Systems that move between given ones."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.linear.response import linear_response, varying_response

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
