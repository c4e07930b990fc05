"""Motions and candidate forces."""

import numpy as np
import pytest

from robustpolish.machines.effects.kind import Motion, Scan, Shape

TIME = np.arange(1000) * 1e-3
MOTION = Motion(TIME, np.linspace(-2.0, 2.0, 1000)[None], np.full((1, 1000), -3.0))


def test_sizes_are_those_that_a_single_peak_does_not_move():
    assert MOTION.amplitude == pytest.approx(1.9, abs=0.01)
    assert MOTION.speed == 3.0
    spiked = MOTION.q.copy()
    spiked[0, 500] = 1e6
    assert Motion(TIME, spiked, MOTION.v).amplitude == pytest.approx(1.9, abs=0.01)


def test_slips_shorter_than_half_a_sample_s_travel_are_left_out():
    least = 0.5 * 3.0 * 1e-3 / MOTION.amplitude
    found = Scan("stiffness", "per slip", (0.9 * least, 1.1 * least, 0.5)).values(MOTION)
    slips = np.array([1.1 * least * MOTION.amplitude, 0.5 * MOTION.amplitude])
    np.testing.assert_allclose(found, 1 / slips)


def test_a_scan_follows_the_size_of_the_motion():
    assert Scan("width", "speed", (0.02, 0.1)).values(MOTION) == pytest.approx([0.06, 0.3])
    assert Scan("exponent", "1", (1.0, 2.0)).values(MOTION) == [1.0, 2.0]
    assert Scan("gap", "percentile", (75,)).values(MOTION) == pytest.approx([1.0, -1.0])
    still = Motion(TIME, 0 * MOTION.q, 0 * MOTION.v)
    assert Scan("gap", "amplitude", (0.5,)).values(still) == []


def test_a_scan_may_follow_powers_of_amplitude_and_speed():
    time = np.linspace(0.0, 1.0, 101)
    motion = Motion(time, np.full((1, 101), 2.0), np.full((1, 101), 6.0))
    assert Scan("rate", (-1, 1), (0.5, 1.0)).values(motion) == [1.5, 3.0]
    assert Scan("curve", (-2.0, 0.0), (1.0,)).values(motion) == [0.25]
    resting = Motion(time, np.full((1, 101), 2.0), np.zeros((1, 101)))
    assert Scan("rate", (-1, 1), (0.5, 1.0)).values(resting) == []


def test_a_scan_finds_the_lines_of_the_force():
    lines = Scan("frequency", "line of the force", (0, 1))
    assert lines.values(MOTION) == []
    force = np.cos(2 * np.pi * 50 * TIME) + 3 * np.cos(2 * np.pi * 120.25 * TIME)
    motion = Motion(TIME, MOTION.q, MOTION.v, force=force[None])
    assert lines.values(motion) == pytest.approx([120.25, 50.0], abs=0.3)


def test_a_line_is_what_stands_out_and_not_what_drifts():
    """A force smoothed from an accelerometer: a wander far larger than the line on it."""
    drift = np.cumsum(np.random.default_rng(0).standard_normal(TIME.size))
    force = np.cos(2 * np.pi * 120.25 * TIME) + 10 * (drift - drift.mean()) / drift.std()
    motion = Motion(TIME, MOTION.q, MOTION.v, force=force[None])
    found = Scan("frequency", "line of the force", (0,)).values(motion)
    assert found == pytest.approx([120.25], abs=0.3)


def test_a_shape_may_say_where_it_holds():
    shape = Shape(np.zeros((1, 1, 2)), lambda c: {"a": c[0]}, (1,), lambda c: c[0] < 1)
    assert shape.valid(np.array([0.5]))
    assert not shape.valid(np.array([2.0]))
