"""A period of a sampled loop, against the same loop put together by hand."""

import control
import numpy as np
import pytest
from scipy.linalg import expm

import robustpolish as rp
from robustpolish.implementation.sampled.lifting import period_map, scaled, split_delay


@pytest.mark.parametrize("delay", [0.0, 0.03, 0.1, 0.27, 0.3])
def test_the_transition_is_that_of_the_loop_stepped_by_hand(delay):
    rng = np.random.default_rng(2)
    A, B, C = rng.normal(size=(3, 3)), rng.normal(size=(3, 1)), rng.normal(size=(1, 3))
    plant = rp.GeneralizedPlant.from_matrices(A, B, B, C, C)
    K = control.ss([[0.4]], [[1.0]], [[-0.5]], [[-0.3]], 0.1)
    map_ = scaled(period_map(plant, K, 0.1, delay))
    transition = map_.transition()

    def step(length, u, x):
        big = expm(np.block([[A, B], [np.zeros((1, 4))]]) * length)
        return big[:3, :3] @ x + big[:3, 3:] @ u

    whole, rest = split_delay(0.1, delay)
    held = whole + (rest > 0)
    x, past, xk = rng.normal(size=3), [rng.normal(size=1) for _ in range(held)], rng.normal(size=1)
    s = np.concatenate([x, *past, xk]) / map_.sample
    for _ in range(5):
        s = transition @ s
        y = C @ x
        queue = [K.C @ xk + K.D @ y, *past]
        xk = K.A @ xk + K.B @ y
        if rest:
            x = step(rest, queue[whole + 1], x)
        x = step(0.1 - rest, queue[whole], x)
        past = queue[:held]
    np.testing.assert_allclose(s * map_.sample, np.concatenate([x, *past, xk]), rtol=1e-9)


def test_delays_next_to_a_sample_are_at_it():
    assert split_delay(0.1, 0.1 * 3) == (3, 0.0)
    assert split_delay(0.1, 0.1 - 1e-13) == (1, 0.0)
    whole, rest = split_delay(1e-6, 1.25e-6)
    assert (whole, rest) == (1, pytest.approx(2.5e-7))
