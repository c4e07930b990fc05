"""The H2 norm of a loop against closed forms and the analysis room, its gradient by differences."""

import control
import numpy as np
import pytest
from random_loops import assert_gradient, random_gain, random_loop, scalar_loop

from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.synthesis.nonsmooth.measures import H2Measure
from robustpolish.synthesis.problem.matrices import augmented


@pytest.mark.parametrize("discrete", [False, True])
@pytest.mark.parametrize("d22", [0.0, 0.3])
@pytest.mark.parametrize("order", [0, 1])
def test_gradient_agrees_with_differences(discrete, d22, order):
    rng = np.random.default_rng(7)
    measure = H2Measure(augmented(random_loop(rng, discrete, d22), order))
    assert_gradient(measure, random_gain(rng, order, discrete), rng)


@pytest.mark.parametrize("discrete", [False, True])
@pytest.mark.parametrize("n", [1, 3, 6, 10])
def test_the_norm_agrees_with_the_analysis_room(discrete, n):
    loop = random_loop(np.random.default_rng(n), discrete, n=n)
    (piece,) = H2Measure(loop).pieces(np.zeros((2, 2)), 0.0, ())
    system = control.StateSpace(loop.A, loop.B1, loop.C1, loop.D11, discrete)
    assert piece.value == pytest.approx(float(h2_norm(system)), rel=1e-6)


def test_a_lag_in_closed_form():
    # x' = k x + w: the norm is (-2 k)^(-1/2), its slope (-2 k)^(-3/2).
    (piece,) = H2Measure(scalar_loop()).pieces(np.array([[-2.0]]), 0.0, ())
    assert piece.value == pytest.approx(0.5)
    assert piece.gradient.item() == pytest.approx(0.125)
    # x+ = k x + w, z = x + 3 w: the squared norm is 1 / (1 - k^2) + 9.
    (piece,) = H2Measure(scalar_loop(D11=3.0, discrete=True)).pieces(np.array([[0.5]]), 0.0, ())
    assert piece.value == pytest.approx(np.sqrt(1 / 0.75 + 9))


def test_a_feedthrough_is_infinite_unless_the_gain_cancels_it():
    # u = -y = -x - w: x' = -1.5 x + w / 2 and z = 2 x + w + u = x.
    loop = scalar_loop(A=-1.0, B2=0.5, C1=2.0, D11=1.0, D12=1.0, D21=1.0)
    assert H2Measure(loop).pieces(np.array([[-0.9]]), 0.0, ()) == []
    (piece,) = H2Measure(loop).pieces(np.array([[-1.0]]), 0.0, ())
    assert piece.value == pytest.approx(0.5 / np.sqrt(3))


def test_unstable_loops_have_no_norm():
    assert H2Measure(scalar_loop(A=1.0)).pieces(np.zeros((1, 1)), 0.0, ()) == []
    assert H2Measure(scalar_loop(A=1.5, discrete=True)).pieces(np.zeros((1, 1)), 0.0, ()) == []
