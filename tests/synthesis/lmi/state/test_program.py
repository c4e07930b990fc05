"""One program does what it is asked, and its gain is judged by the loop."""

import math

import numpy as np
import pytest
from small_plants import oscillator

from robustpolish.base.budget import Budget
from robustpolish.synthesis.certificate import Norm
from robustpolish.synthesis.problem.matrices import (
    PlantMatrices,
    state_gain_norm,
    with_measured_states,
)
from robustpolish.synthesis.problem.pole_regions import HalfPlane
from robustpolish.synthesis.state_feedback.lmi import (
    Coordinates,
    Demand,
    LmiStateEngine,
    StatePrograms,
)
from robustpolish.synthesis.state_feedback.riccati import RiccatiStateEngine, lqr_gain

PLANT = with_measured_states(PlantMatrices.of(oscillator()))
PLAIN = Coordinates.plain(PLANT, 1.0)


def programs(norm: Norm = "hinf", regions=(), work=math.inf):
    return StatePrograms(PLANT, LmiStateEngine(norm, regions=regions), Budget(work), [])


def optimum():
    found = RiccatiStateEngine("hinf").search(PLANT, Budget())
    assert found is not None
    return found


@pytest.mark.parametrize("norm", ["hinf", "h2"])
def test_a_fixed_gain_gets_its_own_norm(norm):
    F, search = np.array([[-1.0, -2.0]]), programs(norm)
    solved = search.solve(PLAIN, Demand(fixed=F), "fixed")
    assert solved is not None
    np.testing.assert_allclose(solved.gain.F, F, rtol=1e-6)
    assert solved.gain.achieved == pytest.approx(state_gain_norm(PLANT, F, norm), rel=1e-6)
    assert solved.gain.claimed == pytest.approx(solved.gain.achieved, rel=1e-3)
    (entry,) = search.history
    assert (entry["step"], entry["achieved"]) == ("fixed", solved.gain.achieved)


def test_the_best_gain_and_its_next_coordinates():
    best = optimum()
    solved = programs().solve(PLAIN, Demand(), "best")
    assert solved is not None
    assert solved.gain.achieved == pytest.approx(best.achieved, rel=2e-3)
    assert solved.next.unit == solved.gain.achieved
    # Y is that of the plant's own states, and the identity in the next ones.
    T = solved.next.T
    np.testing.assert_allclose(T @ T.T, solved.Y, rtol=1e-6)


def test_a_limit_on_the_norm_is_spent_on_a_smaller_gain():
    best, limit = optimum(), 1.3 * optimum().achieved
    for demand in (Demand(limit=limit), Demand(limit=limit, gain=float(np.linalg.norm(best.F)))):
        solved = programs().solve(PLAIN, demand, "small")
        assert solved is not None
        assert solved.gain.claimed == pytest.approx(limit)
        assert solved.gain.achieved <= limit * (1 + 1e-6)
        assert np.linalg.norm(solved.gain.F) < 0.5 * np.linalg.norm(best.F)


def test_a_gain_is_held_below_one():
    free, held = lqr_gain(PLANT), Demand(held=(2 * np.eye(1), np.eye(2)))
    assert free is not None
    assert np.linalg.norm(free, 2) > 0.5
    solved = programs("h2").solve(PLAIN, held, "held")
    assert solved is not None
    assert np.linalg.norm(2 * solved.gain.F, 2) <= 1 + 1e-6
    assert solved.gain.achieved > state_gain_norm(PLANT, free, "h2")


def test_poles_are_asked_into_the_regions():
    region = HalfPlane(-3.0)
    free, held = (
        programs(regions=regions).solve(PLAIN, Demand(), "poles") for regions in ((), (region,))
    )
    for solved, inside in ((free, False), (held, True)):
        assert solved is not None
        poles = np.linalg.eigvals(PLANT.A + PLANT.B2 @ solved.gain.F)
        assert region.contains(poles) == inside


def test_loops_outside_the_regions_or_unstable_are_infinitely_bad():
    F, unstable = np.array([[0.0, -1.0]]), np.array([[0.0, 1.0]])
    assert programs().loop_norm_of(F) == pytest.approx(state_gain_norm(PLANT, F, "hinf"))
    assert programs(regions=(HalfPlane(-3.0),)).loop_norm_of(F) == math.inf
    assert programs().loop_norm_of(unstable) == math.inf


def test_without_work_there_is_no_answer():
    search = programs(work=0.0)
    assert search.solve(PLAIN, Demand(), "late") is None
    assert search.history[0]["solver_status"] == "no work left"
