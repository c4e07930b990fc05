"""Bounds by folding: values, slopes, and a minimum at a bound."""

import numpy as np
import pytest

from robustpolish.base.budget import Budget
from robustpolish.synthesis.nonsmooth.descent import ReflectedParametrisation, bfgs
from robustpolish.synthesis.nonsmooth.parametrisations import MaskedGain

BOUNDS = (np.array([-1.0, 0.0, -np.inf, -np.inf]), np.array([2.0, np.inf, 3.0, np.inf]))
FOLDED = ReflectedParametrisation(MaskedGain(np.ones((2, 2), bool)), BOUNDS)


@pytest.mark.parametrize(
    ("theta", "point", "slope"),
    [
        ([0.5, 1.0, 1.0, 7.0], [0.5, 1.0, 1.0, 7.0], [1, 1, 1, 1]),
        ([2.5, -1.0, 4.0, -7.0], [1.5, 1.0, 2.0, -7.0], [-1, -1, -1, 1]),
        ([-1.5, 0.0, 3.0, 0.0], [-0.5, 0.0, 3.0, 0.0], [-1, 1, 1, 1]),
        ([5.5, 0.0, 3.0, 0.0], [-0.5, 0.0, 3.0, 0.0], [1, 1, 1, 1]),
    ],
)
def test_turns_back_at_bounds(theta, point, slope):
    theta = np.array(theta)
    assert FOLDED.point(theta) == pytest.approx(np.array(point))
    assert FOLDED.gain(theta).ravel() == pytest.approx(np.array(point))
    assert FOLDED.back(theta, np.ones((2, 2))) == pytest.approx(np.array(slope))


def test_bfgs_finds_a_minimum_at_a_bound_and_one_inside():
    goal = np.array([5.0, 1.0, 1.0, -2.0])

    def function(theta):
        error = FOLDED.gain(theta).ravel() - goal
        return float(error @ error), FOLDED.back(theta, 2 * error.reshape(2, 2))

    ended = bfgs(function, np.zeros(4), Budget())
    assert FOLDED.point(ended.point) == pytest.approx([2.0, 1.0, 1.0, -2.0], abs=1e-3)
