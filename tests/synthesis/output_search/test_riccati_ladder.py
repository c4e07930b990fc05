"""H-infinity output feedback by Riccati equations on regularised plants."""

import numpy as np
import pytest
from hard_plants import flexible_structure
from output_tasks import LAG_HINF, settings, task, unstable_lag
from published_plants import scherer_1997

from robustpolish.base.budget import Budget
from robustpolish.synthesis.engine import POLICY
from robustpolish.synthesis.output_feedback.riccati import RegularisedRiccati


def search(problem, budget=None):
    return RegularisedRiccati(settings(tolerance=problem.tolerance)).search(
        problem, budget or Budget()
    )


@pytest.mark.parametrize(
    ("plant", "optimum"), [(unstable_lag(), LAG_HINF), (scherer_1997(), 9.508)]
)
def test_known_optima_are_reached_by_honest_candidates(plant, optimum):
    found = search(task(plant))
    assert optimum * (1 - 1e-4) < found.best <= optimum * 1.004
    assert all(c.keeps_claim for c in found.candidates)
    assert not found.falling
    assert found.history[0]["epsilon"] == 0.0  # a regular plant is solved as it is, first


def test_gamma_falls_down_the_ladder_and_bounds_the_true_norm():
    # A price on u but no noise on y: the optimum is that of state feedback, sqrt(2) at most.
    found = search(task(unstable_lag(noise=0.0, a=-1.0)))
    rungs = [entry for entry in found.history if entry["epsilon"] > 0]
    gammas = [entry["gamma"] for entry in rungs]
    assert len(rungs) > 2
    assert gammas == sorted(gammas, reverse=True)
    # u = F x: (1 + F^2) / (w^2 + (1 - F)^2) at rest is least for F = -1, where it is 1/2.
    assert np.sqrt(0.5) <= found.best <= np.sqrt(0.5) * 1.01
    for entry in rungs:
        assert entry["achieved"] <= entry["gamma"] * 1.04


def test_an_infimum_of_zero_is_told_by_a_norm_that_falls_on():
    found = search(task(unstable_lag(price=0.0, noise=0.0)))
    assert found.falling
    assert found.best < 1e-2
    assert max(c.gain for c in found.candidates) > 1e2


def test_it_ends_near_the_bound_or_where_the_norm_has_settled():
    plant = unstable_lag(noise=0.0, a=-1.0)
    aimed, blind = search(task(plant, tolerance=0.05)), search(task(plant, bounded=False))
    assert len(aimed.history) < len(blind.history) < len(POLICY.epsilons)
    assert aimed.best <= np.sqrt(0.5) * 1.05
    assert blind.best == pytest.approx(np.sqrt(0.5), rel=4e-3)


def test_it_ends_with_its_work():
    plant = task(unstable_lag(price=0.0, noise=0.0))
    whole = Budget(1e6)
    full = search(plant, whole)
    short = Budget(0.2 * whole.spent)
    found = search(plant, short)
    assert short.exhausted
    assert len(found.history) < len(full.history)
    assert short.spent < 0.4 * whole.spent


def test_what_the_lower_bound_has_tried_is_not_tried_again():
    bounded, blind = task(scherer_1997()), task(scherer_1997(), bounded=False)
    known = bounded.bound.bracket
    first, other = search(bounded).history[0], search(blind).history[0]
    assert first["gamma"] == known.upper != other["gamma"]
    assert other["gamma"] == pytest.approx(known.upper, rel=1e-3)


def test_the_optimal_gamma_is_found_near_by_where_the_axis_is_moved():
    plant = flexible_structure(12)  # lightly damped: no controller of the plant itself is near
    found = search(task(plant, tolerance=1e-3))
    gammas = [entry["gamma"] for entry in found.history if "shift" in entry]
    assert gammas
    assert gammas[0] >= found.history[0]["gamma"]
