"""State feedback of an estimate: separation of poles, the way back, Riccati designs as starts."""

from itertools import islice

import numpy as np
import pytest
from hard_plants import rescaled
from output_tasks import LAG_H2, LAG_HINF, unstable_lag
from small_plants import regular_plant

from robustpolish.base.budget import Budget
from robustpolish.errors import InfeasibleError, InvalidInputError
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.polishing.air_bearing import air_bearing
from robustpolish.synthesis.problem.scaling import decoupled_parts, whole_plant
from robustpolish.synthesis.structured.observer import (
    ObserverStructure,
    RiccatiStarts,
    observer_controller,
)
from robustpolish.synthesis.structured.search import POLICY, Norm, PartDesign, PartProblem


def stated(plant, norm: Norm = "hinf"):
    problem = ObserverStructure(norm).problem(whole_plant(plant))
    assert problem is not None
    return problem


def test_poles_separate():
    plant = air_bearing(actuation="force", measured="displacement")
    rng = np.random.default_rng(0)
    F, L = rng.normal(size=(6, 12)), rng.normal(size=(12, 6))
    loop = plant.closed_loop(observer_controller(plant, F, L))
    poles = [np.linalg.eigvals(plant.A + plant.B2 @ F), np.linalg.eigvals(plant.A - L @ plant.C2)]
    expected = np.concatenate(poles).astype(complex)
    found = np.sort_complex(np.asarray(loop.poles(), complex))
    # The thesis's order: plant and estimate as in (10.70).
    assert found == pytest.approx(np.sort_complex(expected), rel=1e-5, abs=1e-5)


def test_the_gains_of_an_observer_have_to_fit_the_plant():
    with pytest.raises(InvalidInputError, match=r"^L: "):
        observer_controller(unstable_lag(), [[1.0]], [[1.0, 2.0]])


def designed(problem, seed):
    """A design of one part with random F and L."""
    theta = np.random.default_rng(seed).normal(size=problem.parametrisation.size)
    K = problem.controller(problem.parametrisation.gain(theta))
    return PartDesign(problem.scaled, K, theta, 1.0, "starts", 1, 1, False, ())


def test_the_observer_of_the_whole_is_that_of_its_parts_in_the_units_of_the_plant():
    plant = rescaled(regular_plant(3, seed=1, d22=0.4), seed=5)[0]
    structure, (part,) = ObserverStructure("hinf"), decoupled_parts(plant)
    design = designed(stated(plant), 0)
    whole, told = structure.join(plant, (part,), [design])
    for s in (0.2j, 1.0 + 3j):
        assert whole(s) == pytest.approx(design.controller(s), rel=1e-6)
    F, L = told["state_feedback"], told["observer_gain"]
    assert whole(1j) == pytest.approx(observer_controller(plant, F, L)(1j))
    feedback = np.linalg.eigvals(plant.A + plant.B2 @ F)
    assert np.sort_complex(told["feedback_poles"]) == pytest.approx(np.sort_complex(feedback))
    poles = [*told["feedback_poles"], *told["observer_poles"]]
    loop = np.sort_complex(plant.closed_loop(whole).poles())
    assert loop == pytest.approx(np.sort_complex(np.array(poles)), rel=1e-5)


def test_parts_that_were_left_alone_have_no_gain():
    eye = np.eye(2)
    plant = GeneralizedPlant.from_matrices(np.diag([-1.0, -2.0]), eye, eye, eye, eye)
    parts = decoupled_parts(plant)
    problem = ObserverStructure("hinf").problem(parts[1])
    assert isinstance(problem, PartProblem)
    _, told = ObserverStructure("hinf").join(plant, parts, [None, designed(problem, 1)])
    assert told["state_feedback"][1, 1] != 0
    assert np.count_nonzero(told["state_feedback"]) == 1
    assert np.count_nonzero(told["observer_gain"]) == 1
    assert told["observer_poles"].real.max() == pytest.approx(-1.0)


def test_what_no_observer_does_is_refused():
    direct = GeneralizedPlant.from_matrices(
        [[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]], D11=[[1.0]]
    )
    with pytest.raises(InfeasibleError, match="D11 passes the disturbance straight to z"):
        ObserverStructure("h2").problem(whole_plant(direct))
    assert ObserverStructure("hinf").problem(whole_plant(direct)) is not None
    nothing = direct.part(
        states=[0], disturbances=[0], controls=[], performance=[0], measurements=[0]
    )
    assert ObserverStructure("hinf").problem(whole_plant(nothing)) is None


@pytest.mark.parametrize(("norm", "optimum"), [("hinf", LAG_HINF), ("h2", LAG_H2)])
def test_riccati_designs_are_proposed_the_best_first(norm, optimum):
    problem = stated(unstable_lag(), norm)
    starts = problem.starts[0]
    assert isinstance(starts, RiccatiStarts)
    points = list(starts.propose((), Budget(1e5), np.random.default_rng(0)))
    norms = []
    for point in points:
        (piece,) = problem.objective.pieces(problem.parametrisation.gain(point), 0.0, ())
        norms.append(problem.scaled.norm(piece.value, norm))
    assert 1 < len(norms) <= POLICY.proposals
    assert norms == sorted(norms)
    assert optimum * (1 - 1e-6) <= norms[0] <= optimum * 1.01


def test_without_work_there_is_still_one_start():
    spent = Budget(1.0)
    spent.spend(1.0)
    problem = stated(unstable_lag())
    points = list(islice(problem.starts[0].propose((), spent, np.random.default_rng(0)), 20))
    assert 1 <= len(points) <= POLICY.proposals
    assert all(np.isfinite(point).all() for point in points)
