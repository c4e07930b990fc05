"""Controllers by formulas from R and S, for plants with and without feedthrough."""

import control
import numpy as np
import pytest
from hard_plants import random_plant
from published_plants import scherer_1997

from robustpolish.base.budget import Budget
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.synthesis.lmi.output_feedback import (
    explicit_controller,
    rebalanced,
    solve_projected,
)
from robustpolish.synthesis.lmi.program import ProgramSolver
from robustpolish.synthesis.problem.matrices import PlantMatrices, close, with_penalty_and_noise
from robustpolish.synthesis.riccati.gamma import lower_bound


@pytest.mark.parametrize(
    "make",
    [
        lambda: with_penalty_and_noise(PlantMatrices.of(scherer_1997()), 1e-3),
        lambda: PlantMatrices.of(random_plant(4, 2, singular=False)).without_d22(),
        lambda: PlantMatrices.of(random_plant(5, 3, singular=False)).without_d22(),
    ],
)
def test_the_loop_keeps_the_norm(make):
    plant = make()
    bound = lower_bound(plant, 1e-4, Budget())
    assert bound is not None
    gamma = 1.05 * bound.value
    point = solve_projected(plant, gamma, ProgramSolver("cvxpy", None, Budget()))
    assert point is not None
    frame = rebalanced(plant, point.R, point.S)
    assert frame is not None
    K = explicit_controller(frame[0], gamma, frame[1])
    assert K is not None
    assert hinf_norm(control.StateSpace(*close(frame[0], K))).value <= gamma * (1 + 1e-6)


def test_a_large_feedthrough_is_lowered_by_the_controller():
    plant = PlantMatrices.of(random_plant(4, 2, singular=False)).without_d22()
    direct = plant.replace(D11=1e3 * plant.D12 @ np.ones((plant.nu, plant.ny)) @ plant.D21)
    bound = lower_bound(direct, 1e-4, Budget())
    assert bound is not None
    gamma = 1.02 * bound.value
    assert np.linalg.norm(direct.D11, 2) > 0.999 * gamma
    point = solve_projected(direct, gamma, ProgramSolver("cvxpy", None, Budget()))
    assert point is not None
    frame = rebalanced(direct, point.R, point.S)
    assert frame is not None
    K = explicit_controller(frame[0], gamma, frame[1])
    assert K is not None
    assert np.abs(K.D).max() > 0.1
    assert hinf_norm(control.StateSpace(*close(frame[0], K))).value <= gamma * (1 + 1e-6)


def test_numbers_that_do_not_allow_it():
    plant = PlantMatrices.of(scherer_1997())
    unpriced = plant.replace(D12=0 * plant.D12)
    assert explicit_controller(unpriced, 10.0, np.full(plant.nx, 2.0)) is None
