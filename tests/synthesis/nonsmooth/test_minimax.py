"""The bundle method on functions whose minimum is known."""

import numpy as np
import pytest

from robustpolish.base.budget import Budget
from robustpolish.synthesis.nonsmooth.descent import ActivePiece, Problem, Requirement, minimax
from robustpolish.synthesis.nonsmooth.measures import GainMeasure
from robustpolish.synthesis.nonsmooth.parametrisations import MaskedGain

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


def test_a_requirement_that_no_point_meets_leaves_the_value_infinite():
    # The smallest circle has 1 + 5/3, more than what is asked for.
    asked = Requirement(Distances(), 2.0)
    ended = minimax(Problem(ONE_ROW, Distances(), (asked,)), np.array([0.0, 1.0]), Budget())
    assert ended.value == np.inf


def test_it_starts_nowhere_from_an_infinite_objective():
    problem = Problem(ONE_ROW, Distances(), ceiling=1.0)
    ended = minimax(problem, np.array([5.0, -4.0]), Budget())
    assert (ended.value, ended.iterations, ended.reason) == (np.inf, 0, "stalled")


def test_it_ends_at_its_target_or_with_its_work():
    problem, start = Problem(ONE_ROW, Distances()), np.array([5.0, -4.0])
    ended = minimax(problem, start, Budget(), target=np.log(4.0))
    assert ended.reason == "target"
    assert 1 + 5 / 3 < np.exp(ended.value) < 4.0
    assert minimax(problem, start, Budget(10.0)).reason == "work"
