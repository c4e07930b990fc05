"""Step control as MATLAB's ode45 has it."""

import numpy as np
import pytest

from robustpolish.polishing.integrator import ERROR, STAGES
from robustpolish.polishing.thesis import listing as ode45

TOLERANCE = 1e-3


def test_the_first_step_follows_the_slope():
    at_rest = ode45.first_step(np.zeros(2), np.ones(2), 0.1, TOLERANCE)
    assert at_rest == 0.1
    moving = ode45.first_step(np.array([50.0, 0.0]), np.array([2.0, 0.0]), 0.1, TOLERANCE)
    assert moving == pytest.approx(0.8 * TOLERANCE**0.2 * 2.0 / 50.0)


def test_errors_count_beside_the_state_or_the_absolute_tolerance():
    slopes, scale = np.zeros((STAGES, 2)), np.zeros(2)
    slopes[0] = 1.0
    start, end = np.array([-4.0, 0.0]), np.array([3.0, 0.0])
    error = ode45.relative_error(slopes, 0.5, start, end, TOLERANCE, scale)
    np.testing.assert_allclose(scale, [4.0, ode45.ABSOLUTE / TOLERANCE])
    assert error == pytest.approx(0.5 * ERROR[0] / scale[1])


def test_refused_steps_shrink_by_the_fifth_root():
    assert ode45.rejected_step(1.0, 32 * TOLERANCE, TOLERANCE, False) == pytest.approx(0.4)
    assert ode45.rejected_step(1.0, 1e30, TOLERANCE, False) == 0.1
    assert ode45.rejected_step(1.0, 32 * TOLERANCE, TOLERANCE, True) == 0.5
    assert ode45.rejected_step(1.0, np.inf, TOLERANCE, False) == 0.5


def test_accepted_steps_grow_at_most_fivefold():
    assert ode45.accepted_step(1.0, 0.0, TOLERANCE) == 5.0
    assert ode45.accepted_step(1.0, TOLERANCE, TOLERANCE) == pytest.approx(0.8)
    assert ode45.accepted_step(1.0, TOLERANCE / 32, TOLERANCE) == pytest.approx(1.6)


def test_no_step_is_lost_in_the_rounding_of_time():
    assert ode45.smallest_step(1.0) == 16 * np.finfo(float).eps
    assert 3.0 + ode45.smallest_step(3.0) > 3.0
