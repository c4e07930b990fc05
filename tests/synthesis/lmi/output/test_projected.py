"""The projected inequalities have solutions down to published optima, in states of any kind."""

import numpy as np
from hard_plants import random_plant
from published_plants import scherer_1997
from scipy import linalg

from robustpolish.base.budget import Budget
from robustpolish.synthesis.lmi.output_feedback import rebalanced, solve_projected
from robustpolish.synthesis.lmi.program import ProgramSolver
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.riccati.gamma import lower_bound


def solver(work=np.inf):
    return ProgramSolver("cvxpy", None, Budget(work))


def slack(plant, point):
    """Return the largest eigenvalues of both inequalities and the smallest of the coupling."""
    P, (R, S, gamma) = plant, point
    left = linalg.block_diag(linalg.null_space(np.hstack([P.B2.T, P.D12.T])), np.eye(P.nw))
    right = linalg.block_diag(linalg.null_space(np.hstack([P.C2, P.D21])), np.eye(P.nz))
    z, w = gamma * np.eye(P.nz), gamma * np.eye(P.nw)
    control = np.block(
        [[P.A @ R + R @ P.A.T, R @ P.C1.T, P.B1], [P.C1 @ R, -z, P.D11], [P.B1.T, P.D11.T, -w]]
    )
    estimate = np.block(
        [[P.A.T @ S + S @ P.A, S @ P.B1, P.C1.T], [P.B1.T @ S, -w, P.D11.T], [P.C1, P.D11, -z]]
    )
    coupled = np.block([[R, np.eye(P.nx)], [np.eye(P.nx), S]])
    return (
        np.linalg.eigvalsh(left.T @ control @ left).max(),
        np.linalg.eigvalsh(right.T @ estimate @ right).max(),
        np.linalg.eigvalsh(coupled).min(),
    )


def test_points_exist_above_a_published_optimum_and_not_below():
    plant = PlantMatrices.of(scherer_1997())
    above = solve_projected(plant, 1.01 * 9.508, solver())
    assert above is not None
    control, estimate, coupled = slack(plant, above)
    assert max(control, estimate) < 1e-6
    assert coupled > 0
    below = solve_projected(plant, 0.99 * 9.508, solver())
    assert below is None or max(slack(plant, below)[:2]) > 0 or slack(plant, below)[2] < 0


def test_the_optimum_of_riccati_equations_with_feedthrough():
    plant = PlantMatrices.of(random_plant(4, 2, singular=False)).without_d22()
    bound = lower_bound(plant, 1e-6, Budget())
    assert bound is not None
    near = solve_projected(plant, 1.01 * bound.value, solver())
    assert near is not None
    # A known point is the unit of the next program, which asks for a little more.
    found = solve_projected(plant, 1.002 * bound.value, solver(), near)
    assert found is not None
    control, estimate, coupled = slack(plant, found)
    assert max(control, estimate) < 1e-6
    assert coupled > 0


def test_no_work_no_answer():
    assert solve_projected(PlantMatrices.of(scherer_1997()), 9.6, solver(0.0)) is None


def test_rebalanced_states_make_both_solutions_equal_and_diagonal():
    plant = PlantMatrices.of(random_plant(4, 0))
    rng = np.random.default_rng(0)
    R, S = (Q @ Q.T + np.eye(4) for Q in rng.standard_normal((2, 4, 4)))
    found = rebalanced(plant, R, S)
    assert found is not None
    new, sizes = found
    into = np.hstack([new.B1, new.B2]) @ np.linalg.pinv(np.hstack([plant.B1, plant.B2]))
    back = np.linalg.pinv(np.vstack([plant.C1, plant.C2])) @ np.vstack([new.C1, new.C2])
    np.testing.assert_allclose(into @ back, np.eye(4), atol=1e-10)
    np.testing.assert_allclose(into @ plant.A @ back, new.A, atol=1e-10)
    balanced = into @ R @ into.T
    np.testing.assert_allclose(back.T @ S @ back, balanced, atol=1e-10)
    np.testing.assert_allclose(balanced, np.diag(sizes), atol=1e-10)
    assert rebalanced(plant, R, S - 2 * np.linalg.eigvalsh(S)[0] * np.eye(4)) is None
