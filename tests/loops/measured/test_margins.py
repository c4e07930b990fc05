"""Crossings between lines."""

import math

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.loops.measured import (
    MeasuredLoop,
    measured_margins,
    measured_simultaneous_margins,
)

s = control.tf("s")


def loop(system, gain, unstable=0, lines=None):
    lines = np.logspace(-2, 3, 400) if lines is None else lines
    plant = rp.GeneralizedPlant(control.frd(control.ss(system), lines), 1, 1)
    return MeasuredLoop.of(plant, [[gain]], unstable)


def test_crossings_lie_between_the_lines():
    found = measured_margins(loop(10 / (s * (s + 1) * (0.1 * s + 1)), -1.0), "input", 0)
    assert found.phase_crossovers[0].frequency_hz == pytest.approx(
        np.sqrt(10) / 2 / np.pi, rel=1e-4
    )
    assert found.phase_crossovers[0].gain == pytest.approx(1.1, rel=1e-3)
    assert len(found.gain_crossovers) == 1


def test_a_crossing_at_rest_is_seen_at_the_first_line():
    # L = 3 / (s - 1) is -3 at rest: a third of the gain is not enough.
    found = measured_margins(loop(1 / (s - 1), -3.0, 1), "output", 0)
    assert found.gain_down == pytest.approx(1 / 3, rel=1e-3)
    assert found.gain_up == math.inf


def test_delays_in_any_combination_are_no_more_than_one_that_is_known():
    found = loop(1 / (s - 1), -3.0, 1)
    at_once = measured_simultaneous_margins(found, "inputs")
    assert at_once.any_delay_s <= at_once.common_delay_s
    assert (
        measured_simultaneous_margins(loop(0.1 / (s + 1), -1.0), "inputs").any_delay_s == math.inf
    )
