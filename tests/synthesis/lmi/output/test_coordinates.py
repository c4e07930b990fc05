"""States in which the Riccati solutions are balanced, and the plant is the same."""

import numpy as np
import pytest
from hard_plants import random_plant

from robustpolish.base.budget import Budget
from robustpolish.synthesis.lmi.output_feedback import balanced_states
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.riccati.gamma import lower_bound, normalise


def test_both_solutions_are_equal_and_diagonal_in_the_new_states():
    plant = PlantMatrices.of(random_plant(4, 2, singular=False)).without_d22()
    bound = lower_bound(plant, 1e-4, Budget())
    assert bound is not None
    gamma = 1.1 * bound.value
    solution = normalise(plant).halves.attempt(gamma)
    new = balanced_states(plant, solution.X, solution.Y, gamma, (1e-12, 1e-12))
    assert new is not None
    again = normalise(new).halves.attempt(gamma)
    scale = np.linalg.norm(again.X, 2)
    np.testing.assert_allclose(again.X, again.Y, atol=1e-6 * scale)
    np.testing.assert_allclose(again.X, np.diag(np.diag(again.X)), atol=1e-6 * scale)
    for s in (0.0, 1j, 2.0):
        old, now = (P.C1 @ np.linalg.solve(s * np.eye(4) - P.A, P.B1) for P in (plant, new))
        np.testing.assert_allclose(now, old, atol=1e-9 * np.abs(old).max())


def test_singular_solutions_are_filled_up_and_nothing_is_refused():
    plant = PlantMatrices.of(random_plant(3, 0)).without_d22()
    X, Y = np.diag([1.0, 1e-12, 1e6]), np.zeros((3, 3))
    new = balanced_states(plant, X, Y, 2.0, (1e-2, 1e-2))
    assert new is not None
    values = np.sort(np.linalg.eigvals(plant.A))
    np.testing.assert_allclose(np.sort(np.linalg.eigvals(new.A)), values, rtol=1e-6)
    assert balanced_states(plant, np.zeros((3, 3)), Y, 2.0, (1e-2, 1e-2)) is None


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_numbers_that_do_not_allow_it(bad):
    plant = PlantMatrices.of(random_plant(3, 0)).without_d22()
    X = np.diag([1.0, 1.0, 1.0])
    X[0, 1] = X[1, 0] = bad
    with np.errstate(invalid="ignore"):
        assert balanced_states(plant, X, np.eye(3), 2.0, (1e-2, 1e-2)) is None
