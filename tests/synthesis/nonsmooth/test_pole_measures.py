"""Distances of poles from regions, their gradients, and the worst of several measures."""

import numpy as np
import pytest
from random_loops import assert_gradient, random_gain, random_loop, scalar_loop

from robustpolish.synthesis.nonsmooth.measures import (
    FrobeniusMeasure,
    GainMeasure,
    HinfMeasure,
    MaxMeasure,
    RegionMeasure,
    StabilityMeasure,
)
from robustpolish.synthesis.problem.matrices import PlantMatrices, augmented


@pytest.mark.parametrize("discrete", [False, True])
@pytest.mark.parametrize("d22", [0.0, 0.3])
@pytest.mark.parametrize("order", [0, 1])
def test_gradient_agrees_with_differences(discrete, d22, order):
    rng = np.random.default_rng(7)
    measure = StabilityMeasure.of(augmented(random_loop(rng, discrete, d22), order))
    assert_gradient(measure, random_gain(rng, order, discrete), rng)


def test_gradient_of_the_distance_from_a_disk():
    rng = np.random.default_rng(1)
    disk = RegionMeasure(random_loop(rng), lambda p: (abs(p + 1), (p + 1) / abs(p + 1)))
    assert_gradient(disk, random_gain(rng, 0, False), rng)


def with_poles(A, discrete=False):
    """The loop with these dynamics, each state with a control and a measurement of its own."""
    A = np.array(A, float)
    eye, zero = np.eye(len(A)), np.zeros_like(A)
    return PlantMatrices(A, eye, eye, eye, eye, zero, zero, zero, zero, discrete)


def test_poles_near_the_worst_are_pieces_and_pairs_count_once():
    # A pair at -1 +- 2j, and single poles at -1.1 and -5.
    A = np.zeros((4, 4))
    A[:2, :2], A[2, 2], A[3, 3] = [[-1, 2], [-2, -1]], -1.1, -5
    measure, K = StabilityMeasure.of(with_poles(A), scale=2.0), np.zeros((4, 4))
    (worst,) = measure.pieces(K, 0.0, ())
    assert worst.value == pytest.approx(-0.5)
    assert [p.value for p in measure.pieces(K, 0.1, ())] == pytest.approx([-0.5, -0.55])
    # The real part of the pair is half the trace of its block.
    assert worst.gradient == pytest.approx(np.diag([0.25, 0.25, 0.0, 0.0]), abs=1e-12)


def test_in_discrete_time_the_radius_counts():
    measure = StabilityMeasure.of(with_poles(np.diag([0.5, -1.25]), discrete=True))
    (piece,) = measure.pieces(np.zeros((2, 2)), 0.0, ())
    assert piece.value == pytest.approx(0.25)
    assert piece.gradient == pytest.approx(np.diag([0.0, -1.0]))


def test_a_defective_double_pole_still_has_a_piece():
    measure = StabilityMeasure.of(with_poles([[-1.0, 1.0], [0.0, -1.0]]))
    pieces = measure.pieces(np.zeros((2, 2)), 0.0, ())
    assert pieces[0].value == pytest.approx(-1.0)
    assert np.isfinite(pieces[0].gradient).all()


def test_the_worst_of_several_measures_leads_and_one_infinity_is_enough():
    loop, K = scalar_loop(), np.array([[-2.0]])
    size, norm = GainMeasure(np.eye(1), np.eye(1)), HinfMeasure(loop)
    worst = MaxMeasure((norm, size, FrobeniusMeasure()))
    assert [p.value for p in worst.pieces(K, 0.0, ())] == pytest.approx([2.0, 2.0, 0.5])
    assert worst.work == pytest.approx(norm.work + 0.2)
    assert worst.pieces(-K, 0.0, ()) == []
