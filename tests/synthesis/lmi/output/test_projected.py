"""The projected inequalities reach published optima, and rebalanced states keep the plant."""

import numpy as np
import pytest
from hard_plants import random_plant
from published_plants import scherer_1997

from robustpolish.long_calls import Budget
from robustpolish.synthesis.lmi.output.projected import rebalanced, solve_projected
from robustpolish.synthesis.lmi.semidefinite import ProgramSolver
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.riccati.infimum import lower_bound


def solver(work=np.inf):
    return ProgramSolver("cvxpy", None, Budget(work))


def test_a_published_optimum():
    found = solve_projected(PlantMatrices.of(scherer_1997()), solver())
    assert found is not None
    assert found.gamma == pytest.approx(9.51, rel=5e-4)


def test_the_optimum_of_riccati_equations_with_feedthrough():
    plant = PlantMatrices.of(random_plant(4, 2, singular=False)).without_d22()
    found, bound = solve_projected(plant, solver()), lower_bound(plant, 1e-6, Budget())
    assert found is not None
    assert bound is not None
    assert found.gamma == pytest.approx(bound.value, rel=1e-4)


def test_no_work_no_answer():
    assert solve_projected(PlantMatrices.of(scherer_1997()), solver(0.0)) is None


def test_rebalanced_states_make_both_solutions_equal_and_diagonal():
    plant = PlantMatrices.of(random_plant(4, 0))
    rng = np.random.default_rng(0)
    R, S = (Q @ Q.T + np.eye(4) for Q in rng.standard_normal((2, 4, 4)))
    new = rebalanced(plant, R, S)
    assert new is not None
    into = np.hstack([new.B1, new.B2]) @ np.linalg.pinv(np.hstack([plant.B1, plant.B2]))
    back = np.linalg.pinv(np.vstack([plant.C1, plant.C2])) @ np.vstack([new.C1, new.C2])
    np.testing.assert_allclose(into @ back, np.eye(4), atol=1e-10)
    np.testing.assert_allclose(into @ plant.A @ back, new.A, atol=1e-10)
    balanced = into @ R @ into.T
    np.testing.assert_allclose(back.T @ S @ back, balanced, atol=1e-10)
    np.testing.assert_allclose(balanced, np.diag(np.diag(balanced)), atol=1e-10)
    assert rebalanced(plant, R, S - 2 * np.linalg.eigvalsh(S)[0] * np.eye(4)) is None
