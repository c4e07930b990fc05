"""From candidates to one certified controller: gains preferred, modes removed, lies refused."""

from dataclasses import replace

import numpy as np
import pytest
from output_tasks import unstable_lag

from robustpolish.base.budget import Budget
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.driver import choose_controller
from robustpolish.synthesis.engine import (
    Candidate,
    EngineResult,
    Task,
    check_candidate,
)
from robustpolish.synthesis.problem.matrices import Controller
from robustpolish.synthesis.problem.scaling import SolverPlant
from robustpolish.synthesis.riccati.gamma import LowerBound


def priced_lag(price=1.0, unit=1.0):
    """X' = -x + w + u, z = unit (x, price u), y = x.

    With u = k y the H-infinity norm is sqrt(1 + (price k)^2) / (1 - k), which for a price of 1 is
    least at k = -1, where it is sqrt(1/2); without a price it falls without end.
    """
    plant = unstable_lag(price, noise=0.0, a=-1.0).part(
        states=[0], disturbances=[0], controls=[0], performance=[0, 1], measurements=[0]
    )
    return plant.replace(C1=unit * plant.C1, D12=unit * plant.D12)


def norm_of(k, price=1.0):
    return np.sqrt(1 + (price * k) ** 2) / (1 - k)


class Choice:
    """One part with hand-made candidates."""

    def __init__(self, plant, tolerance=0.01, bound=None):
        self.part = SolverPlant.of(plant, mapped=True)
        known = None if bound is None else LowerBound(bound / self.part.norm(1.0), "by hand")
        self.problem = Task(self.part.matrices, "hinf", False, tolerance, known)

    def candidate(self, k, claimed=np.inf):
        """A static gain, in the plant's units, whose loop has been checked."""
        none = np.zeros
        scaled = self.part.scaled
        D = np.array([[k]]) * scaled.measurement / scaled.control[:, None]
        K = Controller(none((0, 0)), none((0, 1)), none((1, 0)), D)
        found = check_candidate(self.problem, K, claimed, f"{k}", Budget())
        assert found is not None
        return found

    def of(self, *candidates, falling=False, enough=0.0):
        """Choose among candidates of one search."""
        found = EngineResult("by hand", "none", list(candidates), falling=falling)
        return choose_controller(self.part, self.problem, [found], enough, Budget())


def test_within_the_tolerance_the_smaller_gain_wins_in_the_units_of_the_plant():
    unit = 1e4
    choice = Choice(priced_lag(unit=unit), bound=unit * np.sqrt(0.5))
    # 0.9 % above the optimum, at it, and 5 % above it.
    gains = (-0.76, -1.0, -0.5)
    assert norm_of(-0.76) < 1.0099 * np.sqrt(0.5) < norm_of(-0.5)
    chosen, reasons = choice.of(*(choice.candidate(k) for k in gains))
    assert chosen is not None
    assert reasons == []
    assert np.asarray(chosen.controller.D).item() == pytest.approx(-0.76)
    assert chosen.status == "optimal"
    assert chosen.certificate.valid
    assert chosen.certificate.achieved == pytest.approx(unit * norm_of(-0.76), rel=1e-6)
    assert chosen.bound is not None
    assert chosen.bound.value == pytest.approx(unit * np.sqrt(0.5))


def test_the_status_says_what_is_known():
    far = Choice(priced_lag(), bound=0.5)
    chosen, _ = far.of(far.candidate(-1.0))
    assert chosen is not None
    assert chosen.status == "suboptimal"
    free = Choice(priced_lag(price=0.0))
    chosen, _ = free.of(free.candidate(-3.0), falling=True)
    assert chosen is not None
    assert (chosen.status, chosen.bound) == ("infimum_not_attained", None)


def test_a_falling_search_need_not_go_below_what_is_enough():
    choice = Choice(priced_lag(price=0.0))
    candidates = [choice.candidate(-k) for k in (9.0, 99.0, 9999.0)]  # norms 1e-1, 1e-2, 1e-4
    best, _ = choice.of(*candidates, falling=True)
    modest, _ = choice.of(*candidates, falling=True, enough=0.02)
    assert best is not None
    assert modest is not None
    assert best.certificate.achieved == pytest.approx(1e-4)
    assert modest.certificate.achieved == pytest.approx(1e-2)


def test_lies_are_found_out_and_the_honest_candidate_is_taken():
    choice = Choice(priced_lag())
    keeps_claim = choice.candidate(-1.0, claimed=0.8 / choice.part.norm(1.0))
    wild = Controller(
        *keeps_claim.controller[:3], -2.0 * keeps_claim.controller.D
    )  # k = +2 is unstable
    liar = Candidate(wild, 0.1, 0.1, "a lie")
    chosen, reasons = choice.of(liar, keeps_claim)
    assert chosen is not None
    assert np.asarray(chosen.controller.D).item() == pytest.approx(-1.0)
    assert chosen.claim == pytest.approx(0.8)
    assert reasons
    chosen, reasons = choice.of(liar)
    assert chosen is None
    assert "stable" in reasons[0]


def test_modes_that_do_nothing_are_removed():
    choice = Choice(priced_lag())
    static = choice.candidate(-1.0)
    # A fast lag that is cancelled by the feedthrough at rest, and a mode that u does not see.
    idle = Controller(
        np.diag([-1e6, -3.0]), np.array([[1e3], [1.0]]), np.array([[1.0, 0.0]]), static.controller.D
    )
    long = check_candidate(choice.problem, idle, np.inf, "long", Budget())
    assert long is not None
    chosen, _ = choice.of(long)
    assert chosen is not None
    assert chosen.controller.nstates == 0
    assert np.asarray(chosen.controller.D).item() == pytest.approx(-1.0, rel=2e-3)


def test_many_modes_are_removed_by_halves():
    n = 30
    A = -np.diag([1.0, *np.linspace(2.0, 40.0, n)])
    ones, zeros = np.ones((1, 1)), np.zeros
    plant = GeneralizedPlant.from_matrices(
        [[-1.0]], ones, ones, [[1.0], [0.0]], ones, D12=[[0.0], [1.0]]
    )
    choice = Choice(plant)
    K = Controller(A, np.ones((n + 1, 1)), np.hstack([-ones, zeros((1, n))]), zeros((1, 1)))
    long = check_candidate(choice.problem, K, np.inf, "long", Budget())
    assert long is not None
    chosen, _ = choice.of(long)
    assert chosen is not None
    assert chosen.controller.nstates <= n / 2 + 1
    assert chosen.certificate.achieved <= long.achieved * choice.part.norm(1.01)


def test_without_budget_nothing_is_shortened():
    choice = Choice(priced_lag())
    K = Controller(-3 * np.eye(1), np.eye(1), np.zeros((1, 1)), -np.eye(1))
    long = check_candidate(choice.problem, K, np.inf, "long", Budget())
    assert long is not None
    spent = Budget(1.0)
    spent.spend(1.0)
    found = EngineResult("by hand", "none", [replace(long)])
    chosen, _ = choose_controller(choice.part, choice.problem, [found], 0.0, spent)
    assert chosen is not None
    assert chosen.controller.nstates == 1
