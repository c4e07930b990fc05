"""State feedback by inequalities against Riccati equations, which share nothing with them."""

import numpy as np
import pytest
from hard_plants import random_plant
from small_plants import oscillator

from robustpolish.base.budget import Budget
from robustpolish.synthesis.problem.matrices import (
    PlantMatrices,
    state_gain_norm,
    with_measured_states,
)
from robustpolish.synthesis.problem.pole_regions import HalfPlane, Sector
from robustpolish.synthesis.state_feedback.lmi import LmiStateEngine
from robustpolish.synthesis.state_feedback.riccati import lqr_gain, state_norm_lower_bound

OSCILLATOR = with_measured_states(PlantMatrices.of(oscillator()))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("norm", ["hinf", "h2"])
def test_the_norm_is_within_the_slack_of_a_lower_bound(norm, seed):
    plant = with_measured_states(PlantMatrices.of(random_plant(4, seed, singular=False)))
    if norm == "h2":
        plant = plant.replace(D11=np.zeros_like(plant.D11))
    engine, budget = LmiStateEngine(norm, tolerance=1e-3), Budget(1e5)
    found = engine.search(plant, budget)
    assert found is not None
    assert found.achieved == state_gain_norm(plant, found.F, norm)
    assert found.achieved <= found.claimed
    bound = state_norm_lower_bound(plant, norm, found.achieved, 1e-4, budget)
    assert found.achieved <= bound * (1 + engine.tolerance)


def test_states_that_no_disturbance_reaches_are_still_stabilised():
    plant = OSCILLATOR.replace(
        A=np.diag([1.0, -1.0]),
        B1=np.array([[0.0, 0.0], [1.0, 0.0]]),
        B2=np.ones((2, 1)),
        C1=np.array([[1.0, 1.0], [0.0, 0.0]]),
    )
    found = LmiStateEngine("h2").search(plant, Budget(1e4))
    assert found is not None
    least = state_gain_norm(plant, lqr_gain(plant), "h2")
    assert found.achieved == pytest.approx(least, rel=1e-3)


def test_regions_are_kept_and_cost():
    regions = HalfPlane(-3.0), Sector(0.9)
    free = LmiStateEngine("hinf").search(OSCILLATOR, Budget(1e4))
    held = LmiStateEngine("hinf", regions=regions).search(OSCILLATOR, Budget(1e4))
    assert free is not None
    assert held is not None
    poles = np.linalg.eigvals(OSCILLATOR.A + OSCILLATOR.B2 @ held.F)
    assert all(region.contains(poles) for region in regions)
    assert held.achieved > free.achieved


def test_more_slack_is_spent_on_a_smaller_gain():
    fine, coarse = (
        LmiStateEngine("hinf", tolerance=tolerance).search(OSCILLATOR, Budget(1e4))
        for tolerance in (1e-4, 0.5)
    )
    assert fine is not None
    assert coarse is not None
    assert coarse.achieved <= coarse.claimed <= fine.achieved * 1.5
    assert np.linalg.norm(coarse.F) < 0.8 * np.linalg.norm(fine.F)


def test_inequalities_end_with_their_work():
    whole = Budget(1e4)
    full = LmiStateEngine("hinf").search(OSCILLATOR, whole)
    short = Budget(0.3 * whole.spent)
    stopped = LmiStateEngine("hinf").search(OSCILLATOR, short)
    assert full is not None
    assert stopped is not None
    assert len(stopped.history) < len(full.history)
    assert short.exhausted
    assert not short.late


def test_a_mode_that_no_gain_moves_gives_no_answer():
    stuck = OSCILLATOR.replace(A=np.diag([1.0, -1.0]), B2=np.array([[0.0], [1.0]]))
    assert LmiStateEngine("h2").search(stuck, Budget(1e4)) is None
