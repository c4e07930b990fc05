"""Inputs between their samples: each line does to a mass what the signal does."""

import control
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from robustpolish.machines.simulation.run import (
    HELD,
    LINEAR,
    SMOOTH,
    intersample_signal,
    linear_interpolation,
)

STEP, FINE = 0.01, 400
RECORD = np.random.default_rng(3).standard_normal(60)


def signal(order, position):
    """A record at numbers of samples that have passed, written out."""
    position = np.clip(position, 0, RECORD.size - 1)
    if order == HELD:
        return RECORD[np.floor(position).astype(int)]
    if order == LINEAR:
        return np.interp(position, np.arange(RECORD.size), RECORD)
    return CubicSpline(np.arange(RECORD.size), RECORD)(position)


@pytest.mark.parametrize("order", [HELD, LINEAR, SMOOTH])
@pytest.mark.parametrize("late", [0.0, 0.3, 1.0, 2.75])
def test_mean_and_first_moment_of_every_step_are_those_of_the_signal(order, late):
    at, begin, end = intersample_signal(RECORD, STEP, order, late * STEP)
    x = (np.arange(FINE) + 0.5) / FINE
    values = signal(order, np.arange(RECORD.size - 1)[:, None] + x - late)
    np.testing.assert_allclose((begin + end)[:-1] / 2, values.mean(axis=1), atol=2e-3)
    tilt = ((x - 0.5) * values).mean(axis=1)
    np.testing.assert_allclose((end - begin)[:-1] / 12, tilt, atol=2e-3)
    np.testing.assert_allclose(at, signal(order, np.arange(RECORD.size) - late))


def test_what_is_linear_stays_as_it_is():
    at, begin, end = intersample_signal(RECORD, STEP, LINEAR, 0.0)
    lines = linear_interpolation(RECORD[:, None])
    np.testing.assert_allclose(at, RECORD)
    np.testing.assert_allclose(begin[:-1], lines.begin[:-1, 0], atol=1e-12)
    np.testing.assert_allclose(end[:-1], lines.end[:-1, 0], atol=1e-12)


@pytest.mark.parametrize("late", [0.0, 0.4, 1.7])
def test_an_oscillator_ends_every_step_where_a_late_held_force_leaves_it(late):
    """Beside the exact response to the steps, with three swings in 20 samples."""
    omega = 2 * np.pi * 0.15 / STEP
    A, B = np.array([[0.0, 1.0], [-(omega**2), -0.02 * omega]]), np.array([[0.0], [1.0]])
    _, begin, end = intersample_signal(RECORD, STEP, HELD, late * STEP)
    fine = control.c2d(control.ss(A, B, np.eye(2), 0), STEP / FINE, "zoh")
    t = np.arange(FINE * (RECORD.size - 1) + 1) * STEP / FINE
    held = signal(HELD, np.floor(t / STEP * FINE + 0.5) / FINE - late + 1e-9)
    exact = control.forced_response(fine, t, held).outputs[:, ::FINE]
    lines = np.concatenate([
        begin[:-1, None] + (end - begin)[:-1, None] * (np.arange(FINE) + 0.5) / FINE
    ]).ravel()  # fmt: skip
    found = control.forced_response(fine, t, np.append(lines, 0.0)).outputs[:, ::FINE]
    error = np.std(found - exact, axis=1) / np.std(exact, axis=1)
    assert np.all(error < (1e-3 if late == 0.0 else 2e-2)), error


def test_a_delay_of_whole_samples_is_one_in_spite_of_rounding():
    at, begin, _ = intersample_signal(RECORD, 0.1, HELD, 0.1 + 0.2)
    np.testing.assert_allclose(at[3:], RECORD[:-3])
    np.testing.assert_allclose(begin[3:], RECORD[:-3])
