"""Motions and candidate forces."""

import numpy as np
import pytest

from robustpolish.effects.shapes import Motion, Shape, single

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
    found = MOTION.slips((0.9 * least, 1.1 * least, 0.5))
    np.testing.assert_allclose(found, [1.1 * least * MOTION.amplitude, 0.5 * MOTION.amplitude])


def test_a_shape_of_one_coefficient():
    shape = single(np.arange(5.0), "force", sign=-1, width=0.1)
    assert shape.columns.shape == (1, 1, 5)
    assert shape.values(np.array([2.0])) == {"force": 2.0, "width": 0.1}
    assert shape.signs == (-1,)
    assert shape.valid(np.array([1e9]))


def test_a_shape_may_say_where_it_holds():
    shape = Shape(np.zeros((1, 1, 2)), lambda c: {"a": c[0]}, (1,), lambda c: c[0] < 1)
    assert shape.valid(np.array([0.5]))
    assert not shape.valid(np.array([2.0]))
