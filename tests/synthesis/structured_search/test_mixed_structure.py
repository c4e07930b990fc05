"""Several specifications in one search: demands in the plant's units, regions, starts."""

from dataclasses import replace

import numpy as np
import pytest
from hard_plants import rescaled
from small_plants import oscillator

from robustpolish.base.budget import Budget
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.problem.matrices import channel
from robustpolish.synthesis.problem.pole_regions import Disk, HalfPlane, Sector
from robustpolish.synthesis.problem.scaling import whole_plant
from robustpolish.synthesis.structured.search import POLICY
from robustpolish.synthesis.structured.structures import InequalityStart, MixedStructure

PLANT = rescaled(oscillator(), seed=8, decades=2)[0]


def structure(plant, **changes):
    plain = MixedStructure("hinf", plant, False, None, None, (), None, "cvxpy", None)
    return replace(plain, **changes)


def stated(plant, **changes):
    problem = structure(plant, **changes).problem(whole_plant(plant))
    assert problem is not None
    return problem


def some_gain(problem):
    """A stable full-order controller that leaves the scaled loop stable."""
    n = problem.order
    K = np.zeros((n + 1, n + 1))
    K[:n, :n] = -np.eye(n)
    K[:n, n:], K[n:, :n] = 0.3, -0.1
    return K


def test_the_other_norm_is_bounded_on_its_channel_in_the_units_of_the_plant():
    names = PLANT.disturbance_names, PLANT.performance_names
    side = channel(PLANT, names[0][0], names[1][0])
    K = some_gain(stated(PLANT))
    truth = float(h2_norm(side.closed_loop(stated(PLANT).controller(K))))
    for share, kept in ((1.001, True), (0.999, False)):
        (demand,) = stated(PLANT, side=side, side_bound=share * truth).requirements
        assert (demand.pieces(K, 0.0, ())[0].value <= 0) == kept


def test_the_norm_that_is_minimised_is_that_of_its_channel():
    goal = channel(PLANT, PLANT.disturbance_names[0], PLANT.performance_names[1])
    problem = stated(PLANT, goal=goal)
    K = some_gain(problem)
    truth = float(hinf_norm(goal.closed_loop(problem.controller(K))))
    seen = problem.objective.pieces(K, 0.0, ())[0].value
    assert problem.scaled.norm(seen) == pytest.approx(truth, rel=1e-5)


@pytest.mark.parametrize(
    "make",
    [
        lambda poles, share: HalfPlane(share * poles.real.max()),
        lambda poles, share: Disk(-1.0, np.abs(poles + 1).max() / share),
        lambda poles, share: Sector(share * (-poles.real / np.abs(poles)).min()),
    ],
    ids=["half plane", "disk", "sector"],
)
def test_demands_on_poles_say_the_same_as_their_regions(make):
    problem = stated(PLANT)
    K = some_gain(problem)
    poles = np.asarray(PLANT.closed_loop(problem.controller(K)).poles())
    for share in (0.999, 1.001):
        region = make(poles, share)
        (demand,) = stated(PLANT, regions=(region,)).requirements
        value = demand.pieces(K, 0.0, ())[0].value
        assert (value <= 0) == region.contains(poles) == (share < 1)


def test_gradients_of_regions_agree_with_differences():
    regions = (HalfPlane(-0.1), Disk(-2.0, 1.5), Sector(0.7))
    plant = oscillator()
    problem = stated(plant, regions=regions)
    K, rng = some_gain(problem), np.random.default_rng(0)
    change = rng.normal(size=K.shape)
    for demand in problem.requirements:
        up, down = (demand.pieces(K + s * 1e-6 * change, 0.0, ())[0].value for s in (1, -1))
        slope = (demand.pieces(K, 0.0, ())[0].gradient * change).sum()
        assert slope == pytest.approx((up - down) / 2e-6, rel=1e-4)


def starts(plant, **changes):
    return [type(start).__name__ for start in stated(plant, **changes).starts]


def test_inequalities_start_only_what_they_are_written_for():
    plant = oscillator()
    assert starts(plant)[0] == "InequalityStart"
    assert starts(plant, static=True)[0] != "InequalityStart"  # y is not x
    assert starts(plant.with_full_state(), static=True)[0] == "InequalityStart"
    sampled = GeneralizedPlant.from_matrices(
        0.5 * np.eye(2), plant.B1, plant.B2, plant.C1, plant.C2, dt=0.1
    )
    assert "InequalityStart" not in starts(sampled)
    n = POLICY.shared_states + 1
    long = GeneralizedPlant.from_matrices(
        -np.eye(n), np.ones((n, 1)), np.ones((n, 1)), np.ones((1, n)), np.ones((1, n))
    )
    assert "InequalityStart" not in starts(long)


@pytest.mark.parametrize("static", [False, True])
def test_the_start_of_the_inequalities_meets_all_demands(static):
    plant = oscillator()
    plant = plant.with_full_state() if static else plant
    problem = stated(plant, static=static, side=plant, side_bound=3.0, regions=(HalfPlane(-0.1),))
    start = problem.starts[0]
    assert isinstance(start, InequalityStart)
    (theta,) = start.propose((), Budget(1e4), np.random.default_rng(0))
    K = problem.parametrisation.gain(theta)
    assert len(problem.requirements) == 2
    for demand in problem.requirements:
        assert demand.pieces(K, 0.0, ())[0].value <= 0


def test_demands_are_named_and_nothing_to_choose_is_said():
    assert stated(PLANT).demands == ""
    assert stated(PLANT, gain_bound=1.0).demands == "all specifications"
    assert stated(PLANT, static=True).what == "static gain"
    idle = PLANT.part(
        states=[0, 1], disturbances=[0], controls=[], performance=[0], measurements=[0]
    )
    assert structure(idle).problem(whole_plant(idle)) is None
    first = PLANT.disturbance_names[0]
    goal = channel(PLANT, first, PLANT.performance_names)
    assert stated(PLANT).key != stated(PLANT, goal=goal).key
