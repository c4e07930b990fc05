"""Sensors that count in steps."""

import numpy as np
import pytest

from robustpolish.identification.observer.kalman import rounding

TIME = np.arange(4000) * 1e-2
SWING = np.exp(-0.1 * TIME) * np.sin(8 * TIME)


@pytest.mark.parametrize("step", [2 * np.pi / 2000, 1e-4, 0.01])
def test_steps_of_a_sensor_are_seen(step):
    counted = step * np.round(SWING / step)
    assert rounding(counted) == pytest.approx(step / 12**0.5, rel=1e-6)
    assert rounding(0.3 + counted) == pytest.approx(step / 12**0.5, rel=1e-6)
    # written with six digits
    assert rounding(np.round(counted, 6)) == pytest.approx(step / 12**0.5, rel=1e-3)


def test_values_on_no_grid_have_no_steps():
    noisy = SWING + 1e-3 * np.random.default_rng(0).standard_normal(SWING.size)
    for y in (noisy, SWING, np.zeros(100), np.ones(1)):
        assert rounding(y) == 0.0


def test_a_switch_is_no_sensor():
    assert rounding(np.sign(SWING)) == 0.0
