"""Descents on functions whose minimum is known, and objectives under requirements."""

import numpy as np
import pytest

from robustpolish.base.budget import Budget
from robustpolish.synthesis.nonsmooth.descent import (
    ActivePiece,
    MaskedGain,
    Problem,
    ReflectedParametrisation,
    Requirement,
    bfgs,
    minimax,
)
from robustpolish.synthesis.nonsmooth.measures import FrobeniusMeasure, GainMeasure

# BFGS.


def test_it_walks_along_a_kink():
    def function(x):
        # The nonsmooth Rosenbrock function of Lewis and Overton (2013), minimum 0 at (1, 1).
        kink = x[1] - x[0] ** 2
        gradient = 8 * np.sign(kink) * np.array([-2 * x[0], 1.0]) + [2 * (x[0] - 1), 0]
        return 8 * abs(kink) + (x[0] - 1) ** 2, gradient

    ended = bfgs(function, np.array([-1.2, 1.0]), Budget(), iterations=500, tolerance=1e-12)
    assert ended.value < 1e-5


def logarithmic_barrier(x):
    """X - log x, infinite for x <= 0: minimum 1 at 1."""
    if x[0] <= 0:
        return np.inf, np.zeros(1)
    return x[0] - np.log(x[0]), 1 - 1 / x


@pytest.mark.parametrize("start", [1e-3, 10.0])
def test_steps_into_infinity_are_shortened(start):
    ended = bfgs(logarithmic_barrier, np.array([start]), Budget(), tolerance=1e-12)
    assert ended.point == pytest.approx([1.0], abs=1e-5)
    assert ended.value == pytest.approx(1.0, abs=1e-10)


# Bounds by folding.

BOUNDS = (np.array([-1.0, 0.0, -np.inf, -np.inf]), np.array([2.0, np.inf, 3.0, np.inf]))
FOLDED = ReflectedParametrisation(MaskedGain(np.ones((2, 2), bool)), BOUNDS)


def test_bfgs_finds_a_minimum_at_a_bound_and_one_inside():
    goal = np.array([5.0, 1.0, 1.0, -2.0])

    def function(theta):
        error = FOLDED.gain(theta).ravel() - goal
        return float(error @ error), FOLDED.back(theta, 2 * error.reshape(2, 2))

    ended = bfgs(function, np.zeros(4), Budget())
    assert FOLDED.point(ended.point) == pytest.approx([2.0, 1.0, 1.0, -2.0], abs=1e-3)


# The bundle method.

ONE_ROW = MaskedGain(np.ones((1, 2), bool))


class Distances:
    """Largest distance of K = (k1, k2) from three points, plus one."""

    work = 1.0
    points = np.array([[0.0, 0.0], [2.0, 0.0], [1.0, 3.0]])

    def pieces(self, K, width, frequencies):
        found = []
        for i, p in enumerate(self.points):
            apart = K.ravel() - p
            size = float(np.linalg.norm(apart))
            found.append(
                ActivePiece(1 + size, (apart / max(size, 1e-12)).reshape(K.shape), float(i))
            )
        return sorted(found, key=lambda piece: -piece.value)


def test_it_finds_the_smallest_circle_around_points():
    ended = minimax(Problem(ONE_ROW, Distances()), np.array([5.0, -4.0]), Budget())
    # The circumcircle of the triangle: centre (1, 4/3), radius 5/3.
    assert ended.point == pytest.approx([1.0, 4 / 3], abs=1e-4)
    assert np.exp(ended.value) == pytest.approx(1 + 5 / 3, rel=1e-7)
    assert ended.reason == "stationary"


def test_it_keeps_requirements_and_bounds():
    small = Requirement(GainMeasure(np.eye(1), np.eye(2)), 1.0)
    ended = minimax(Problem(ONE_ROW, Distances(), (small,)), np.array([3.0, 3.0]), Budget())
    assert np.linalg.norm(ended.point) == pytest.approx(1.0, rel=1e-6)
    bounds = (np.array([-9.0, -9.0]), np.array([9.0, 1.0]))
    ended = minimax(Problem(ONE_ROW, Distances()), np.array([3.0, 0.0]), Budget(), bounds=bounds)
    assert ended.point[1] == pytest.approx(1.0, abs=1e-6)


# Objectives and requirements as functions of the free numbers.

FREE = MaskedGain(np.array([[True, False], [True, True]]))
SIZE = FrobeniusMeasure()
LARGEST = GainMeasure(np.eye(2), np.eye(2))


def test_penalty_and_its_gradient():
    theta, weight = np.array([2.0, -1.0, 2.0]), 5.0
    problem = Problem(FREE, SIZE, (Requirement(LARGEST, 1.5), Requirement(SIZE, 1.0)))
    value, slope = problem.penalised(theta, weight)
    # The second requirement, ||K|| = 3 <= 1, is missed by more.
    assert value == pytest.approx(np.log(3.0) * (1 + weight))
    for i, unit in enumerate(np.eye(3)):
        up, down = (problem.penalised(theta + s * 1e-6 * unit, weight)[0] for s in (1, -1))
        assert slope[i] == pytest.approx((up - down) / 2e-6, rel=1e-6)
