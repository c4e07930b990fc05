"""Objectives under requirements as functions of the free numbers."""

import numpy as np
import pytest

from robustpolish.synthesis.nonsmooth.descent import ActivePiece, Problem, Requirement
from robustpolish.synthesis.nonsmooth.measures import FrobeniusMeasure, GainMeasure
from robustpolish.synthesis.nonsmooth.parametrisations import MaskedGain

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
