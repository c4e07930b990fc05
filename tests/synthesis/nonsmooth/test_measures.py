"""Norms, peaks, poles and sizes of loops: closed forms, the analysis, gradients by differences."""

import control
import numpy as np
import pytest
from random_loops import assert_gradient, random_gain, random_loop, scalar_loop

import robustpolish as rp
from robustpolish.synthesis.nonsmooth.measures import (
    FrobeniusMeasure,
    GainMeasure,
    H2Measure,
    HinfMeasure,
    LoopResponse,
    MaxMeasure,
    RegionMeasure,
    StabilityMeasure,
)
from robustpolish.synthesis.problem.matrices import (
    PlantMatrices,
    augmented,
    close_static_loop,
    controller_loop,
)


@pytest.mark.parametrize("make", [HinfMeasure, H2Measure, StabilityMeasure.of])
@pytest.mark.parametrize("discrete", [False, True])
@pytest.mark.parametrize("d22", [0.0, 0.3])
@pytest.mark.parametrize("order", [0, 1])
def test_gradients_agree_with_differences(make, discrete, d22, order):
    rng = np.random.default_rng(7)
    measure = make(augmented(random_loop(rng, discrete, d22), order))
    assert_gradient(measure, random_gain(rng, order, discrete), rng)


@pytest.mark.parametrize(("make", "norm"), [(HinfMeasure, rp.hinf_norm), (H2Measure, rp.h2_norm)])
@pytest.mark.parametrize("discrete", [False, True])
@pytest.mark.parametrize("n", [1, 3, 6, 10, 24])
def test_norms_agree_with_the_analysis(make, norm, discrete, n):
    loop = random_loop(np.random.default_rng(n), discrete, n=n)
    found = make(loop).pieces(np.zeros((2, 2)), 0.0, ())[0].value
    system = control.StateSpace(loop.A, loop.B1, loop.C1, loop.D11, discrete)
    assert found == pytest.approx(float(norm(system)), rel=1e-6)


def test_a_chain_of_lags_has_parallel_eigenvectors():
    n = 16
    chain = random_loop(np.random.default_rng(1), False, n=n)
    chain = chain.replace(A=-np.eye(n) + np.diag(np.ones(n - 1), 1))
    found = HinfMeasure(chain).pieces(np.zeros((2, 2)), 0.0, ())[0].value
    system = control.StateSpace(chain.A, chain.B1, chain.C1, chain.D11)
    assert found == pytest.approx(float(rp.hinf_norm(system)), rel=1e-6)


# The H-infinity norm.

NO_GAIN = np.zeros((1, 1))


def test_gradient_of_the_norm_of_a_controller_itself():
    rng = np.random.default_rng(1)
    measure = HinfMeasure(controller_loop(1, np.eye(2), np.eye(2), False))
    assert_gradient(measure, random_gain(rng, 1, False), rng)


def resonances(omega, heights, zeta=1e-3):
    """Lightly damped resonances side by side, with peaks of the given heights."""
    n = 2 * len(omega)
    A, B, C = np.zeros((n, n)), np.zeros((n, 1)), np.zeros((1, n))
    for i, (w, height) in enumerate(zip(omega, heights, strict=True)):
        A[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0, 1], [-(w**2), -2 * zeta * w]]
        B[2 * i + 1], C[0, 2 * i] = 1.0, height * 2 * zeta * w**2
    return PlantMatrices(A, B, B, C, C, NO_GAIN, NO_GAIN, NO_GAIN, NO_GAIN)


def test_all_peaks_within_the_width_are_found():
    pieces = HinfMeasure(resonances([1.0, 3.0, 9.0], [1.0, 0.99, 0.5])).pieces(NO_GAIN, 0.05, ())
    assert sorted(p.frequency or 0.0 for p in pieces) == pytest.approx([1.0, 3.0], rel=1e-2)
    assert pieces[0].value == max(p.value for p in pieces)


def test_a_feedthrough_is_a_peak_at_infinity():
    # z = u + 2 w - x with u = k w: |1 - k| at rest, 2 + k at infinity.
    loop = scalar_loop(A=-1.0, B2=0.0, C1=-1.0, D11=2.0, D12=1.0, D21=1.0)
    loop = loop.replace(C2=np.zeros((1, 1)))
    (piece,) = HinfMeasure(loop).pieces(np.array([[0.5]]), 0.0, ())
    assert (piece.value, piece.frequency) == (2.5, np.inf)
    assert piece.gradient.item() == pytest.approx(1.0)


def test_unstable_loops_have_no_hinf_norm_and_silent_ones_none_to_lower():
    assert HinfMeasure(scalar_loop(A=1.0)).pieces(NO_GAIN, 0.0, ()) == []
    assert HinfMeasure(scalar_loop(A=1.5, discrete=True)).pieces(NO_GAIN, 0.0, ()) == []
    (piece,) = HinfMeasure(scalar_loop(A=-1.0, C1=0.0)).pieces(NO_GAIN, 0.0, ())
    assert piece.value == 0.0
    assert not piece.gradient.any()


# Responses of a loop over frequency, and their peaks.


def response(loop):
    return LoopResponse(close_static_loop(loop, np.zeros((loop.nu, loop.ny))))


def test_a_level_whose_square_is_beyond_doubles_has_no_crossings():
    """Found by a random plant: Python's powers of numbers end in errors of their own."""
    assert len(response(scalar_loop()).crossings(1e200)) == 0


# The H2 norm.


def test_a_feedthrough_is_infinite_unless_the_gain_cancels_it():
    # u = -y = -x - w: x' = -1.5 x + w / 2 and z = 2 x + w + u = x.
    loop = scalar_loop(A=-1.0, B2=0.5, C1=2.0, D11=1.0, D12=1.0, D21=1.0)
    assert H2Measure(loop).pieces(np.array([[-0.9]]), 0.0, ()) == []
    (piece,) = H2Measure(loop).pieces(np.array([[-1.0]]), 0.0, ())
    assert piece.value == pytest.approx(0.5 / np.sqrt(3))


def test_unstable_loops_have_no_h2_norm():
    assert H2Measure(scalar_loop(A=1.0)).pieces(np.zeros((1, 1)), 0.0, ()) == []
    assert H2Measure(scalar_loop(A=1.5, discrete=True)).pieces(np.zeros((1, 1)), 0.0, ()) == []


# Poles.


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


# Sizes of the gain.

RNG = np.random.default_rng(7)


@pytest.mark.parametrize(
    "measure",
    [
        GainMeasure(np.eye(3), np.eye(2)),
        GainMeasure(np.diag([1e3, 2.0, 0.1]), RNG.normal(size=(2, 4))),
        FrobeniusMeasure(),
    ],
)
def test_gradients_of_sizes_agree_with_differences(measure):
    assert_gradient(measure, RNG.normal(size=(3, 2)), RNG)


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
