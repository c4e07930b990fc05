"""Descents on functions whose minimum is known, and objectives under requirements."""

import time

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


def many_slopes(x):
    return float(np.sum(np.abs(x) ** 1.5)), 1.5 * np.sign(x) * np.sqrt(np.abs(x))


def test_it_stops_at_a_target_and_at_a_flat_place():
    start = np.linspace(1.0, 2.0, 20)
    ended, whole = (bfgs(many_slopes, start, Budget(), target=goal) for goal in (5.0, -np.inf))
    assert ended.reason == "target"
    assert whole.value < ended.value < 5.0
    ended = bfgs(logarithmic_barrier, np.array([1.0]), Budget())
    assert ended.reason == "stationary"


def test_it_ends_when_its_work_is_spent():
    def descent(budget):
        return bfgs(many_slopes, np.linspace(1.0, 2.0, 20), budget, work=2.0, tolerance=0.0)

    ended = descent(Budget(20.0))
    assert ended.reason == "work"
    budget = Budget(60.0)
    longer = descent(budget)
    assert longer.value < ended.value
    # A line search looks at the budget after each evaluation.
    assert 60.0 <= budget.spent <= 62.0


def test_it_obeys_the_safety_net():
    def slow(x):
        time.sleep(0.01)
        return many_slopes(x)

    began = time.monotonic()
    ended = bfgs(
        slow, np.linspace(1.0, 2.0, 20), Budget(seconds=0.1), iterations=10_000, tolerance=0.0
    )
    assert ended.reason == "time"
    assert time.monotonic() - began < 1.0


# Bounds by folding.

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


def test_a_requirement_that_no_point_meets_leaves_the_value_infinite():
    # The smallest circle has 1 + 5/3, more than what is asked for.
    asked = Requirement(Distances(), 2.0)
    ended = minimax(Problem(ONE_ROW, Distances(), (asked,)), np.array([0.0, 1.0]), Budget())
    assert ended.value == np.inf


def test_it_starts_nowhere_from_an_infinite_objective():
    problem = Problem(ONE_ROW, Distances(), ceiling=1.0)
    ended = minimax(problem, np.array([5.0, -4.0]), Budget())
    assert (ended.value, ended.reason) == (np.inf, "stalled")


def test_it_ends_at_its_target_or_with_its_work():
    problem, start = Problem(ONE_ROW, Distances()), np.array([5.0, -4.0])
    ended = minimax(problem, start, Budget(), target=np.log(4.0))
    assert ended.reason == "target"
    assert 1 + 5 / 3 < np.exp(ended.value) < 4.0
    assert minimax(problem, start, Budget(10.0)).reason == "work"


# Objectives and requirements as functions of the free numbers.

FREE = MaskedGain(np.array([[True, False], [True, True]]))
SIZE = FrobeniusMeasure()
LARGEST = GainMeasure(np.eye(2), np.eye(2))


class Nowhere:
    """A measure that is infinite everywhere."""

    work = 7.0

    def pieces(self, K, width, frequencies):
        return []


@pytest.mark.parametrize(
    ("size", "value", "slope"),
    # r - 1 up to the bound of 2, log(r) beyond.
    [(1.0, -0.5, 0.5), (2.0, 0.0, 0.5), (2.0 * np.e, 1.0, 0.5 / np.e)],
)
def test_a_bound_becomes_a_function_that_has_to_be_at_most_zero(size, value, slope):
    (piece,) = Requirement(SIZE, 2.0).pieces(np.array([[size]]), 0.0, ())
    assert piece.value == pytest.approx(value)
    assert piece.gradient == pytest.approx(np.array([[slope]]))


def test_a_requirement_without_a_bound_is_the_measure_itself():
    (piece,) = Requirement(SIZE, None).pieces(np.array([[3.0]]), 0.0, ())
    assert piece.value == 3.0


def test_the_objective_is_the_logarithm_over_the_free_numbers():
    model = Problem(FREE, SIZE).model(np.array([2.0, 1.0, 2.0]))
    assert model is not None
    assert model.objective == pytest.approx(np.log(3.0))
    assert model.slopes[0] == pytest.approx(np.array([2.0, 1.0, 2.0]) / 9)
    assert model.violation == 0.0


def test_a_vanishing_objective_has_a_finite_logarithm():
    model = Problem(FREE, SIZE).model(np.zeros(3))
    assert model is not None
    assert -1000 < model.objective < -700  # the smallest double
    assert not model.slopes.any()


def test_penalty_and_its_gradient():
    theta, weight = np.array([2.0, -1.0, 2.0]), 5.0
    problem = Problem(FREE, SIZE, (Requirement(LARGEST, 1.5), Requirement(SIZE, 1.0)))
    value, slope = problem.penalised(theta, weight)
    # The second requirement, ||K|| = 3 <= 1, is missed by more.
    assert value == pytest.approx(np.log(3.0) * (1 + weight))
    for i, unit in enumerate(np.eye(3)):
        up, down = (problem.penalised(theta + s * 1e-6 * unit, weight)[0] for s in (1, -1))
        assert slope[i] == pytest.approx((up - down) / 2e-6, rel=1e-6)


def test_large_gains_and_infinite_measures_count_as_infinite():
    theta = np.array([2.0, 1.0, 2.0])
    assert Problem(FREE, SIZE, ceiling=1.9).model(theta) is None
    assert Problem(FREE, SIZE, ceiling=2.0).model(theta) is not None
    for problem in (Problem(FREE, Nowhere()), Problem(FREE, SIZE, (Requirement(Nowhere(), 1.0),))):
        assert problem.model(theta) is None
        assert problem.penalised(theta, 1.0)[0] == np.inf
        assert problem.work == pytest.approx(7.0, abs=0.11)


def test_frequencies_of_the_pieces_are_kept():
    class Peaks:
        work = 1.0

        def pieces(self, K, width, frequencies):
            return [ActivePiece(2.0, K, 1.5), ActivePiece(1.9, K, np.inf)]

    model = Problem(FREE, Peaks()).model(np.ones(3), 0.1)
    assert model is not None
    assert model.frequencies == (1.5, np.inf)
    assert model.values == pytest.approx(np.log([2.0, 1.9]))
