"""The H2 norm of a sampled loop."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.implementation.sampled.lifting import period_map, scaled
from robustpolish.implementation.sampled.proof import average_power


def test_without_control_it_is_that_of_the_plant():
    plant = rp.GeneralizedPlant.from_matrices(
        [[0, 1], [-1, -0.2]], [[0], [1]], [[0], [1]], [[1, 0]], [[1, 0]]
    )
    loop = scaled(period_map(plant, control.ss([], [], [], [[0.0]], 0.3), 0.3, 0.1))
    low, high = average_power(loop)
    true = rp.h2_norm(plant.open_loop).value
    assert low <= true * (1 + 1e-12)
    assert true <= high * (1 + 1e-12)
    assert high / low - 1 < 1e-9


def test_a_held_integrator_by_hand():
    # x' = w + u, u = -x(kh)/h: x(kh + t) = (1 - t/h) x(kh) + noise over t; deadbeat at samples.
    h = 0.5
    plant = rp.GeneralizedPlant.from_matrices([[0.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    loop = scaled(period_map(plant, control.ss([], [], [], [[-1 / h]], h), h, 0.0))
    low, high = average_power(loop)
    # E x(kh)^2 = h; mean of (1 - t/h)^2 h + t over a period is h/3 + h/2.
    assert low == pytest.approx(np.sqrt(h / 3 + h / 2), rel=1e-9)
    assert high == pytest.approx(low, rel=1e-6)


def test_an_unstable_loop_has_none():
    plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    loop = scaled(period_map(plant, control.ss([], [], [], [[0.0]], 0.3), 0.3, 0.0))
    assert average_power(loop) is None
