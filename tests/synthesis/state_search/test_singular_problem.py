"""Problems in which control is free: limits of gains, and norms that settle."""

import numpy as np
import pytest

from robustpolish.base.budget import Budget
from robustpolish.synthesis.certificate import Norm
from robustpolish.synthesis.problem.matrices import (
    PlantMatrices,
    state_gain_norm,
    with_measured_states,
)
from robustpolish.synthesis.state_feedback.riccati import RiccatiStateEngine
from robustpolish.synthesis.state_feedback.search import least_control_norm, solve_singular


def free_control(A, B1, B2, C1):
    """States that are measured, without a price on u."""
    A, B1, B2, C1 = (np.array(M, float) for M in (A, B1, B2, C1))
    D11, D12 = np.zeros((len(C1), B1.shape[1])), np.zeros((len(C1), B2.shape[1]))
    empty = np.zeros((0, 0))
    return with_measured_states(PlantMatrices(A, B1, B2, C1, empty, D11, D12, empty, empty))


# x' = a x + w + u, z = x: with u = -k x the norm 1/(k - a) falls without end.
LAG = free_control([[-1.0]], [[1.0]], [[1.0]], [[1.0]])
# What is disturbed and watched is a lag of its own; u has to stabilise another state.
BESIDE = free_control(np.diag([-1.0, 1.0]), [[1.0], [0.0]], [[0.0], [1.0]], [[1.0, 0.0]])
LOST = free_control(np.diag([-1.0, 1.0]), [[1.0], [1.0]], [[1.0], [0.0]], [[1.0, 1.0]])


def size(F):
    return float(np.linalg.norm(F, 2))


def solve(plant, target, norm: Norm = "hinf", budget=None):
    return solve_singular(RiccatiStateEngine(norm), plant, target, size, budget or Budget())


def test_almost_no_control_is_none_if_that_is_stable():
    assert least_control_norm(LAG, "hinf") == pytest.approx(1.0)
    assert least_control_norm(LAG, "h2") == pytest.approx(np.sqrt(0.5))


def test_almost_no_control_mirrors_an_unstable_pole():
    # The least effort that stabilises x' = 2 x + u moves the pole to -2.
    unstable = free_control([[2.0]], [[1.0]], [[1.0]], [[1.0]])
    assert least_control_norm(unstable, "hinf") == pytest.approx(0.5, rel=1e-3)
    assert least_control_norm(LOST, "hinf") == np.inf


@pytest.mark.parametrize(("norm", "needed"), [("hinf", 99.0), ("h2", 4999.0)])
def test_a_norm_that_falls_on_is_followed_to_the_target_with_a_small_gain(norm, needed):
    # 1/(1 + k) = 0.01, and 1/sqrt(2 (1 + k)) = 0.01.
    found = solve(LAG, 0.01, norm)
    assert found is not None
    assert found.status == "infimum_not_attained"
    assert found.achieved <= 0.01
    assert found.achieved == state_gain_norm(LAG, found.F, norm)
    # The last price is met to the sixteenth part of a decade.
    assert needed <= size(found.F) < 1.5 * needed
    told = [entry for entry in found.history if "price" in entry]
    assert told[-1]["achieved"] != told[0]["achieved"]


def test_a_norm_that_has_settled_is_told_apart():
    found = solve(BESIDE, 1e-6)
    assert found is not None
    assert found.status == "suboptimal"
    assert found.achieved == pytest.approx(1.0, rel=1e-4)
    assert size(found.F) == pytest.approx(2.0, rel=0.01)  # from +1 to -1, and no more


def test_a_short_budget_ends_the_descent_and_is_not_taken_for_a_limit():
    short = Budget(8.0)
    found = solve(LAG, 1e-6, budget=short)
    assert found is not None
    assert short.exhausted
    assert found.status == "suboptimal"
    assert found.achieved < 1.0 + 1e-9


def test_what_nothing_stabilises_has_no_answer():
    assert solve(LOST, 1e-6) is None
