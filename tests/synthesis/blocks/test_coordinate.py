"""Coordinates of numbers: there and back, slopes, limits."""

import math

import pytest

from robustpolish.synthesis.structured.block_parts import LEAST, ParameterTransform

INF = math.inf
CASES = [
    (ParameterTransform(2.0, -INF, INF), -3.0),
    (ParameterTransform(2.0, 0.0, INF, "positive"), 0.7),
    (ParameterTransform(2.0, -INF, INF, "integral"), -0.3),
    (ParameterTransform(2.0, -INF, 0.0, "integral"), -0.3),
]


@pytest.mark.parametrize(("coordinate", "value"), CASES)
def test_there_and_back(coordinate, value):
    theta = coordinate.theta(value)
    assert coordinate.value(theta) == pytest.approx(value, rel=1e-12)
    step = 1e-6
    slope = (coordinate.value(theta + step) - coordinate.value(theta - step)) / (2 * step)
    assert coordinate.slope(theta) == pytest.approx(slope, rel=1e-8)


def test_an_integral_gain_keeps_away_from_zero_on_either_side():
    free = CASES[2][0]
    assert free.value(0.0) == pytest.approx(2.0 * LEAST)
    assert free.value(-1e-9) == pytest.approx(-2.0 * LEAST)
    assert free.idle(0.1)
    assert not free.idle(free.theta(1.0))
    negative = CASES[3][0]
    assert negative.value(0.0) < 0
    assert negative.bounds(-1.0) == (-INF, 0.0)


def test_limits_are_kept_in_spite_of_rounding():
    coordinate = ParameterTransform(0.3, 0.1, 0.7, "positive")
    low, high = coordinate.bounds(0.0)
    assert 0.1 <= coordinate.value(low) <= 0.1 * (1 + 1e-12)
    assert 0.7 * (1 - 1e-12) <= coordinate.value(high) <= 0.7


def test_a_start_far_away_has_room_around_it():
    low, high = CASES[1][0].bounds(40.0)
    assert low < 0 < 40.0 < high
