"""Lower bounds on the norms of state feedbacks: below every norm, and near where it matters."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.synthesis.problem.matrices import (
    PlantMatrices,
    state_gain_norm,
    with_measured_states,
)
from robustpolish.synthesis.state_feedback.riccati import RiccatiStateEngine, state_norm_lower_bound

# x' = x + w + u, z = (x, u).
SCALAR = PlantMatrices.of(
    rp.GeneralizedPlant.from_matrices(
        [[1.0]], [[1.0]], [[1.0]], [[1.0], [0.0]], [[1.0]], D12=[[0.0], [1.0]]
    )
)


def random_plant(seed, discrete=False, feedthrough=False):
    rng = np.random.default_rng(seed)
    nx, nw, nu, nz = 5, 2, 2, 3
    A = rng.normal(size=(nx, nx))
    if discrete:
        A *= 1.2 / np.abs(np.linalg.eigvals(A)).max()
    plant = rp.GeneralizedPlant.from_matrices(
        A,
        rng.normal(size=(nx, nw)),
        rng.normal(size=(nx, nu)),
        np.vstack([rng.normal(size=(nz, nx)), np.zeros((nu, nx))]),
        np.eye(nx),
        np.vstack([0.3 * rng.normal(size=(nz, nw)) * feedthrough, np.zeros((nu, nw))]),
        np.vstack([rng.normal(size=(nz, nu)), 0.5 * np.eye(nu)]),
        dt=0.1 if discrete else 0,
    )
    return with_measured_states(PlantMatrices.of(plant))


@pytest.mark.parametrize("norm", ["hinf", "h2"])
@pytest.mark.parametrize("discrete", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_no_gain_near_the_best_is_below_the_bound(seed, discrete, norm):
    plant = random_plant(seed, discrete, feedthrough=norm == "hinf")
    budget = Budget(1e5)
    best = RiccatiStateEngine(norm).search(plant, budget)
    assert best is not None
    bound = state_norm_lower_bound(plant, norm, best.achieved, 1e-4, budget)
    assert best.achieved * 0.99 < bound <= best.achieved
    rng = np.random.default_rng(seed)
    for size in np.logspace(-6, 0, 60):
        F = best.F * (1 + size * rng.normal(size=best.F.shape))
        assert state_gain_norm(plant, F, norm) >= bound * (1 - 1e-9)


def test_a_bound_is_found_where_the_infimum_is_a_limit_of_gains():
    # With u = F x the norm sqrt(1 + F^2) / |1 + F| falls towards 1 as F goes to minus infinity.
    for gain in (-1e3, -1e5, -1e7):
        achieved = state_gain_norm(SCALAR, np.array([[gain]]), "hinf")
        bound = state_norm_lower_bound(SCALAR, "hinf", achieved, 1e-4, Budget(1e5))
        assert bound < 1
        assert bound > 1 - 3e-3
    assert bound > 1 - 1e-4


def test_zeros_on_the_axis_prove_nothing():
    # An undamped mode that neither u nor w moves and z sees not: no gamma has a solution.
    plant = rp.GeneralizedPlant.from_matrices(
        [[-1.0, 0, 0], [0, 0, 1], [0, -1, 0]],
        [[1.0], [0], [0]],
        [[1.0], [0], [0]],
        [[1.0, 0, 0], [0, 0, 0]],
        np.eye(3),
        D12=[[0.0], [1.0]],
    )
    assert state_norm_lower_bound(PlantMatrices.of(plant), "hinf", 5.0, 1e-4, Budget(1e5)) == 0.0
