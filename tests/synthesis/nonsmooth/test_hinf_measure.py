"""The H-infinity norm of a loop with its peaks, against closed forms and the analysis room."""

import control
import numpy as np
import pytest
from random_loops import assert_gradient, random_gain, random_loop, scalar_loop

from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.synthesis.nonsmooth.measures import HinfMeasure
from robustpolish.synthesis.problem.matrices import PlantMatrices, augmented, controller_loop

NO_GAIN = np.zeros((1, 1))


@pytest.mark.parametrize("discrete", [False, True])
@pytest.mark.parametrize("d22", [0.0, 0.3])
@pytest.mark.parametrize("order", [0, 1])
def test_gradient_agrees_with_differences(discrete, d22, order):
    rng = np.random.default_rng(7)
    measure = HinfMeasure(augmented(random_loop(rng, discrete, d22), order))
    assert_gradient(measure, random_gain(rng, order, discrete), rng)


def test_gradient_of_the_norm_of_a_controller_itself():
    rng = np.random.default_rng(1)
    measure = HinfMeasure(controller_loop(1, np.eye(2), np.eye(2), False))
    assert_gradient(measure, random_gain(rng, 1, False), rng)


@pytest.mark.parametrize("discrete", [False, True])
@pytest.mark.parametrize("n", [1, 3, 6, 10])
def test_the_norm_agrees_with_the_analysis_room(discrete, n):
    loop = random_loop(np.random.default_rng(n), discrete, n=n)
    found = HinfMeasure(loop).pieces(np.zeros((2, 2)), 0.0, ())[0].value
    system = control.StateSpace(loop.A, loop.B1, loop.C1, loop.D11, discrete)
    assert found == pytest.approx(float(hinf_norm(system)), rel=1e-6)


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


def test_a_lag_in_closed_form():
    # x' = k x + w: the norm is -1/k at rest, its slope 1/k^2.
    (piece,) = HinfMeasure(scalar_loop()).pieces(np.array([[-2.0]]), 0.0, ())
    assert (piece.value, piece.frequency) == (pytest.approx(0.5), 0.0)
    assert piece.gradient.item() == pytest.approx(0.25)
    # x+ = -x/2 + w shakes at half the sampling rate: 1 / |-1 + 1/2|.
    (piece,) = HinfMeasure(scalar_loop(A=-0.5, discrete=True)).pieces(NO_GAIN, 0.0, ())
    assert piece.value == pytest.approx(2.0)
    assert piece.frequency == pytest.approx(np.pi)


def test_a_feedthrough_is_a_peak_at_infinity():
    # z = u + 2 w - x with u = k w: |1 - k| at rest, 2 + k at infinity.
    loop = scalar_loop(A=-1.0, B2=0.0, C1=-1.0, D11=2.0, D12=1.0, D21=1.0)
    loop = loop.replace(C2=np.zeros((1, 1)))
    (piece,) = HinfMeasure(loop).pieces(np.array([[0.5]]), 0.0, ())
    assert (piece.value, piece.frequency) == (2.5, np.inf)
    assert piece.gradient.item() == pytest.approx(1.0)


def test_unstable_loops_have_no_norm_and_silent_ones_none_to_lower():
    assert HinfMeasure(scalar_loop(A=1.0)).pieces(NO_GAIN, 0.0, ()) == []
    assert HinfMeasure(scalar_loop(A=1.5, discrete=True)).pieces(NO_GAIN, 0.0, ()) == []
    (piece,) = HinfMeasure(scalar_loop(A=-1.0, C1=0.0)).pieces(NO_GAIN, 0.0, ())
    assert piece.value == 0.0
    assert not piece.gradient.any()
