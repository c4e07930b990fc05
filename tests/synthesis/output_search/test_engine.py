"""What engines are given and return: goals, honest candidates, loops that are checked."""

import numpy as np
import pytest
from output_tasks import settings, task, unstable_lag

from robustpolish.base.budget import Budget
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.engine import (
    Candidate,
    EngineResult,
    Task,
    check_candidate,
)
from robustpolish.synthesis.output_feedback.riccati import RegularisedRiccati
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices
from robustpolish.synthesis.riccati.gamma import LowerBound

LAG = task(unstable_lag(), bounded=False)


def static(gain):
    none = np.zeros
    return Controller(none((0, 0)), none((0, 1)), none((1, 0)), np.array([[float(gain)]]))


def test_static_loops_have_the_norms_of_their_closed_forms():
    # u = -3 (x + w2): x' = -2 x + w1 - 3 w2 and z = (x, -3 x - 3 w2).
    found = check_candidate(LAG, static(-3), 5.0, "by hand", Budget())
    assert found is not None
    # At rest the gain matrix is [[1, -3], [-3, 3]] / 2: s^2 - 7 s + 9/4 = 0 for its square; at
    # infinity only 3 w2 is left, which is more.
    assert np.sqrt((7 + np.sqrt(49 - 9)) / 2) < 3
    assert found.achieved == pytest.approx(3.0, rel=1e-6)
    assert (found.claimed, found.origin, found.order, found.gain) == (5.0, "by hand", 0, 3.0)
    # The noise passes straight to u: no H2 norm. Without noise and price it is 1/sqrt(2 * 2).
    noisy, plain = (task(unstable_lag(1.0 * n, n), "h2", bounded=False) for n in (1.0, 0.0))
    assert check_candidate(noisy, static(-3), np.inf, "", Budget()) is None
    quiet = check_candidate(plain, static(-3), np.inf, "", Budget())
    assert quiet is not None
    assert quiet.achieved == pytest.approx(0.5, rel=1e-3)


def test_what_does_not_stabilise_or_is_no_number_is_no_candidate():
    budget = Budget()
    assert check_candidate(LAG, static(-0.5), 1.0, "", budget) is None
    assert check_candidate(LAG, static(-1.0), 1.0, "", budget) is None  # on the axis
    assert check_candidate(LAG, static(np.nan), 1.0, "", budget) is None
    assert budget.spent == pytest.approx(2.0, rel=1e-3)


def test_a_candidate_has_balanced_states_and_the_same_loop():
    K = Controller(*(np.array([[x]]) for x in (-3.0, 2.0**20, -(2.0**-18), -2.0)))
    found = check_candidate(LAG, K, np.inf, "", Budget())
    assert found is not None
    assert found.controller.B.item() * found.controller.C.item() == K.B.item() * K.C.item()
    assert found.gain <= 4.0
    assert found.promise == found.achieved  # nothing was claimed


@pytest.mark.parametrize(("norm", "expected"), [("hinf", 4.0), ("h2", np.sqrt(16 / 7))])
def test_discrete_loops_are_judged_by_the_unit_circle(norm, expected):
    # x+ = 2 x + w + u with u = -5/4 x: z = x has 1/(1 - 3/4) and 1/(1 - 9/16).
    ones = [[1.0]]
    plant = GeneralizedPlant.from_matrices([[2.0]], ones, ones, ones, ones, dt=1.0)
    problem = Task(PlantMatrices.of(plant), norm, False, 4e-3, None)
    found = check_candidate(problem, static(-1.25), np.inf, "", Budget())
    assert found is not None
    assert found.achieved == pytest.approx(expected, rel=1e-3)
    assert check_candidate(problem, static(-3.0), np.inf, "", Budget()) is None


def test_promises_are_kept_up_to_a_thousandth():
    kept, broken = (Candidate(static(-3), a, 1.0, "") for a in (1.0009, 1.0011))
    assert kept.keeps_claim
    assert not broken.keeps_claim
    with_inner_feedback = broken.with_inner_feedback(np.array([[0.5]]))
    assert with_inner_feedback.controller.D.item() == -2.5
    assert with_inner_feedback.achieved == broken.achieved


def test_goals_lie_above_the_bound_by_shares_of_the_tolerance():
    unknown = Task(LAG.plant, "hinf", True, 0.1, None)
    assert (unknown.goal, unknown.near) == (0.0, 0.0)
    known = Task(LAG.plant, "hinf", True, 0.1, LowerBound(2.0, ""))
    assert 2.0 < known.near < known.goal < 2.2


def test_the_best_of_nothing_is_infinite_and_searches_add_by_default():
    found = EngineResult("riccati", "scipy")
    assert found.best == np.inf
    found.candidates += [Candidate(static(-3), a, 9.0, "") for a in (3.0, 2.0)]
    assert found.best == 2.0
    assert RegularisedRiccati(settings()).is_useful(LAG, [found])
