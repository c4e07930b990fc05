"""The size of a gain in the plant's own units."""

import numpy as np
import pytest
from random_loops import assert_gradient

from robustpolish.synthesis.nonsmooth.measures import FrobeniusMeasure, GainMeasure

RNG = np.random.default_rng(7)


@pytest.mark.parametrize(
    "measure",
    [
        GainMeasure(np.eye(3), np.eye(2)),
        GainMeasure(np.diag([1e3, 2.0, 0.1]), RNG.normal(size=(2, 4))),
        FrobeniusMeasure(),
    ],
)
def test_gradient_agrees_with_differences(measure):
    assert_gradient(measure, RNG.normal(size=(3, 2)), RNG)


def test_the_gain_is_measured_in_the_units_of_the_plant():
    measure = GainMeasure(np.diag([10.0, 1.0]), np.diag([1.0, 0.5]))
    # diag(10, 1) [[1, 2], [0, 0]] diag(1, 1/2) = [[10, 10], [0, 0]].
    (piece,) = measure.pieces(np.array([[1.0, 2.0], [0.0, 0.0]]), 0.0, ())
    assert piece.value == pytest.approx(10 * np.sqrt(2))


def test_zero_rows_leave_parts_of_the_gain_out():
    left = np.array([[0.0, 0.0], [0.0, 1.0]])
    (piece,) = GainMeasure(left, np.eye(2)).pieces(np.array([[7.0, 0.0], [0.0, 2.0]]), 0.0, ())
    assert piece.value == 2.0
    assert piece.gradient == pytest.approx(np.diag([0.0, 1.0]))


def test_singular_values_near_the_largest_are_pieces_too():
    measure, K = GainMeasure(np.eye(3), np.eye(3)), np.diag([2.9, 1.0, 3.0])
    assert [p.value for p in measure.pieces(K, 0.0, ())] == [3.0]
    pieces = measure.pieces(K, 0.05, ())
    assert [p.value for p in pieces] == [3.0, 2.9]
    assert pieces[1].gradient == pytest.approx(np.diag([1.0, 0.0, 0.0]))


def test_a_vanishing_gain_has_a_slope_of_zero():
    (piece,) = FrobeniusMeasure().pieces(np.zeros((2, 2)), 0.0, ())
    assert piece.value == 0.0
    assert not piece.gradient.any()
    (piece,) = FrobeniusMeasure().pieces(np.array([[3.0, -4.0]]), 0.0, ())
    assert piece.value == pytest.approx(5.0)
