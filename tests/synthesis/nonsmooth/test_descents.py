"""Both descents on functions whose minimum is known."""

import time

import numpy as np
import pytest

from robustpolish.long_calls import Budget
from robustpolish.synthesis.nonsmooth import (
    ActivePiece,
    GainMeasure,
    MaskedGain,
    Problem,
    Requirement,
    bfgs,
    minimax,
)


def far():
    return Budget(seconds=30.0)


def test_bfgs_walks_along_a_kink():
    def function(x):
        # The nonsmooth Rosenbrock function of Lewis and Overton (2013), minimum 0 at (1, 1).
        kink = x[1] - x[0] ** 2
        gradient = 8 * np.sign(kink) * np.array([-2 * x[0], 1.0]) + [2 * (x[0] - 1), 0]
        return 8 * abs(kink) + (x[0] - 1) ** 2, gradient

    ended = bfgs(function, np.array([-1.2, 1.0]), far(), iterations=500, tolerance=1e-12)
    assert ended.value < 1e-5


class Distances:
    """Largest distance of K = (k1, k2) from three points, plus one."""

    work = 1.0
    points = np.array([[0.0, 0.0], [2.0, 0.0], [1.0, 3.0]])

    def pieces(self, K, width, frequencies):
        found = []
        for i, p in enumerate(self.points):
            apart = K.ravel() - p
            size = np.linalg.norm(apart)
            found.append(
                ActivePiece(1 + size, (apart / max(size, 1e-12)).reshape(K.shape), float(i))
            )
        return sorted(found, key=lambda piece: -piece.value)


def test_minimax_finds_the_smallest_circle_around_points():
    problem = Problem(MaskedGain(np.ones((1, 2), bool)), Distances())
    ended = minimax(problem, np.array([5.0, -4.0]), far())
    # The circumcircle of the triangle: centre (1, 4/3), radius 5/3.
    assert ended.point == pytest.approx([1.0, 4 / 3], abs=1e-4)
    assert np.exp(ended.value) == pytest.approx(1 + 5 / 3, rel=1e-7)
    assert ended.reason == "stationary"


def test_minimax_keeps_requirements_and_bounds():
    one_row = MaskedGain(np.ones((1, 2), bool))
    small = Requirement(GainMeasure(np.eye(1), np.eye(2)), 1.0)
    ended = minimax(Problem(one_row, Distances(), (small,)), np.array([3.0, 3.0]), far())
    assert np.linalg.norm(ended.point) == pytest.approx(1.0, rel=1e-6)
    bounds = (np.array([-9.0, -9.0]), np.array([9.0, 1.0]))
    ended = minimax(Problem(one_row, Distances()), np.array([3.0, 0.0]), far(), bounds=bounds)
    assert ended.point[1] == pytest.approx(1.0, abs=1e-6)


def many_slopes(x):
    return float(np.sum(np.abs(x) ** 1.5)), 1.5 * np.sign(x) * np.sqrt(np.abs(x))


def test_descents_obey_the_safety_net():
    def slow(x):
        time.sleep(0.01)
        return many_slopes(x)

    began = time.monotonic()
    ended = bfgs(
        slow, np.linspace(1.0, 2.0, 20), Budget(seconds=0.1), iterations=10_000, tolerance=0.0
    )
    assert ended.reason == "time"
    assert time.monotonic() - began < 1.0


def test_descents_end_when_their_work_is_spent():
    def bowl(budget):
        return bfgs(many_slopes, np.linspace(1.0, 2.0, 20), budget, work=2.0, tolerance=0.0)

    ended = bowl(Budget(20.0))
    assert ended.reason == "work"
    budget = Budget(60.0)
    longer = bowl(budget)
    assert longer.value < ended.value
    # A line search looks at the budget after each evaluation.
    assert 60.0 <= budget.spent <= 62.0
    problem = Problem(MaskedGain(np.ones((1, 2), bool)), Distances())
    assert minimax(problem, np.array([5.0, -4.0]), Budget(10.0)).reason == "work"
