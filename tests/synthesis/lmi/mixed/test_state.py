"""Several specifications of a state feedback under one Lyapunov matrix: a near start."""

import numpy as np
import pytest
from small_plants import oscillator

from robustpolish.base.budget import Budget
from robustpolish.synthesis.lmi.mixed import Specification, mixed_state_start
from robustpolish.synthesis.lmi.program import ProgramSolver
from robustpolish.synthesis.problem.matrices import PlantMatrices, state_gain_norm
from robustpolish.synthesis.problem.pole_regions import HalfPlane
from robustpolish.synthesis.state_feedback.riccati import RiccatiStateEngine, lqr_gain

BACK_OFF = 1.02
MATRICES = PlantMatrices.of(oscillator())


def start(*specifications, regions=(), work=np.inf):
    named = [Specification(oscillator(), norm, bound) for norm, bound in specifications]
    solver = ProgramSolver("cvxpy", None, Budget(work), accuracy=1e-8)
    return mixed_state_start(named, regions, solver, BACK_OFF)


def optimum(norm):
    if norm == "h2":
        return state_gain_norm(MATRICES, lqr_gain(MATRICES), "h2")
    found = RiccatiStateEngine("hinf").search(MATRICES, Budget(1e4))
    assert found is not None
    return found.achieved


@pytest.mark.parametrize("norm", ["hinf", "h2"])
def test_one_norm_alone_comes_within_the_back_off(norm):
    achieved = state_gain_norm(MATRICES, start((norm, None)), norm)
    assert 1 - 1e-4 <= achieved / optimum(norm) <= BACK_OFF + 1e-4


def test_a_bound_on_the_other_norm_is_kept():
    free, least = start(("h2", None)), optimum("hinf")
    assert state_gain_norm(MATRICES, free, "hinf") > 1.1 * least
    held = start(("h2", None), ("hinf", 1.1 * least))
    assert state_gain_norm(MATRICES, held, "hinf") <= 1.1 * least
    assert state_gain_norm(MATRICES, held, "h2") > optimum("h2")


def test_poles_lie_in_the_region():
    region, free = HalfPlane(-2.5), start(("hinf", None))
    held = start(("hinf", None), regions=(region,))
    for F, inside in ((free, False), (held, True)):
        assert F is not None
        assert region.contains(np.linalg.eigvals(MATRICES.A + MATRICES.B2 @ F)) == inside


def test_what_cannot_be_met_and_the_end_of_the_work_give_no_start():
    assert start(("h2", None), ("hinf", 0.9 * optimum("hinf"))) is None
    assert start(("h2", None), work=0.0) is None
