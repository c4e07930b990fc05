"""Zeros on the stability boundary."""

import control
import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.linear.zeros import zeros_on_axis


@pytest.mark.parametrize("rate", [1e-6, 1.0, 1e6])
def test_a_notch(rate):
    A = np.array([[0, 1], [-1, -1]]) * rate
    G = control.StateSpace(A, [[0], [rate]], [[3, -1]], 1)
    (zero,) = zeros_on_axis(G)
    assert zero.frequency == pytest.approx(2 * rate)


def test_differentiators_and_integrators():
    assert zeros_on_axis(control.ss([[0, 1], [-1, -1]], [[0], [1]], [[0, 1]], 0))[0].frequency == 0
    assert zeros_on_axis(control.ss([[0, 1], [0, 0]], [[0], [1]], [[1, 0]], 0)) == ()


def test_a_zero_that_rounding_tells_from_the_origin():
    A = [[0, 1, 0], [-4, -1e-14, 0.1], [0, 0, -1]]  # at -1e-14
    (zero,) = zeros_on_axis(control.ss(A, [[1], [0], [0]], [[1, 0, 0]], 0))
    assert zero.frequency == 0


def test_more_outputs_than_inputs():
    A, B = [[0, 1, 0], [-1, -1, 0], [0, 0, -2]], [[0], [1], [1]]
    common = [[0, 1, 0], [0, 2, 0]]  # both outputs vanish at zero frequency
    assert len(zeros_on_axis(control.ss(A, B, common, [[0], [0]]))) == 1
    assert zeros_on_axis(control.ss(A, B, [[0, 1, 0], [0, 0, 1]], [[0], [0]])) == ()


def test_discrete():
    (zero,) = zeros_on_axis(control.ss([[0.5]], [[1]], [[-0.5]], 1, 0.1))  # (z - 1)/(z - 0.5)
    assert zero.frequency == 0


def test_zeros_off_the_axis_and_no_signals():
    assert zeros_on_axis(control.ss([[-1]], [[1]], [[1]], 1)) == ()
    assert zeros_on_axis(control.ss(np.eye(2), np.zeros((2, 0)), np.eye(2), np.zeros((2, 0)))) == ()
    with pytest.raises(InvalidInputError, match="tolerance"):
        zeros_on_axis(control.ss([[-1]], [[1]], [[1]], 1), tolerance=0)
