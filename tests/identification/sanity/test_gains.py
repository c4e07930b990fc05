"""Gains line by line: what follows from the inputs, and nothing else."""

import numpy as np
import pytest

from robustpolish.identification.sanity import coherent_gain

RANDOM = np.random.default_rng(0)
NOISE = RANDOM.standard_normal(6000)


@pytest.mark.parametrize("gain", [1.0, -0.2, 1e3, -1e-6])
def test_size_and_sign_of_a_gain(gain):
    other = gain * np.std(NOISE) * 0.3 * RANDOM.standard_normal(6000)
    found = coherent_gain(NOISE, gain * NOISE + other, 0.01)
    assert found.enough
    assert found.size == pytest.approx(abs(gain), rel=0.05)
    assert found.scatter < 1.2
    assert found.reversed == (1.0 if gain < 0 else 0.0)


def test_an_offset_a_trend_and_a_decay_from_the_start_change_nothing():
    time = np.arange(6000) * 0.01
    own = 50 * np.exp(-2 * time) * np.cos(9 * time) + 3 * time + 7
    found = coherent_gain(NOISE, 2 * NOISE + own, 0.01)
    assert found.size == pytest.approx(2.0, rel=0.05)


def test_what_has_nothing_in_common_says_nothing():
    assert not coherent_gain(NOISE, RANDOM.standard_normal(6000), 0.01).enough


def test_one_line_does_not_speak_for_all():
    sine = np.sin(2 * np.pi * 5 * np.arange(6000) * 0.01)
    assert not coherent_gain(sine, -sine + 1e-3 * NOISE, 0.01).enough


def test_distance_is_zero_where_the_model_is_right():
    assert coherent_gain(NOISE, NOISE, 0.01).distance == pytest.approx(0, abs=1e-9)
    assert coherent_gain(NOISE, 1.1 * NOISE, 0.01).distance == pytest.approx(np.log(1.1))
