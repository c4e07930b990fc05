"""Output feedback by linear matrix inequalities against optima in closed form."""

from dataclasses import replace

import control
import numpy as np
import pytest
from output_tasks import LAG_HINF, settings, task, unstable_lag
from small_plants import regular_plant

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.synthesis.certificate import NormTarget
from robustpolish.synthesis.engine import POLICY, EngineResult
from robustpolish.synthesis.output_feedback.lmi import LmiHinf


def test_the_hinf_optimum_is_reached_within_the_tolerance():
    found = LmiHinf(settings()).search(task(unstable_lag()), Budget())
    best = min((c for c in found.candidates if c.keeps_claim), key=lambda c: c.achieved)
    assert LAG_HINF * (1 - 1e-6) <= best.achieved <= 1.004 * LAG_HINF
    # The claim of a candidate is the gamma that its inequalities were solved for.
    assert best.claimed == pytest.approx(1.004 * LAG_HINF, rel=1e-3)
    assert found.history[-1]["gamma"] == best.claimed
    assert not found.falling


def test_large_norms_are_solved_in_a_unit_of_their_own():
    factor = 1e6
    plant = unstable_lag()
    large = plant.replace(C1=factor * plant.C1, D12=factor * plant.D12)
    found = LmiHinf(settings()).search(task(large), Budget())
    assert LAG_HINF * factor * (1 - 1e-6) <= found.best <= 1.004 * LAG_HINF * factor
    assert any(c.keeps_claim for c in found.candidates)


def test_without_a_lower_bound_plants_regularised_less_and_less_are_followed():
    found = LmiHinf(settings()).search(task(unstable_lag(), bounded=False), Budget())
    assert LAG_HINF * (1 - 1e-6) <= found.best <= 1.03 * LAG_HINF
    epsilons = [note["epsilon"] for note in found.history]
    assert epsilons == sorted(epsilons, reverse=True)
    assert len(set(epsilons)) > 2


def test_the_norm_that_was_asked_for_will_do():
    asked = replace(task(unstable_lag()), wanted=NormTarget(4.0, 4.0))
    found = LmiHinf(settings()).search(asked, Budget())
    assert len(found.candidates) == 1
    assert found.best <= 4.0


def test_zeros_on_the_axis_and_weights_over_six_decades():
    servo = control.StateSpace([[0, 1], [0, -1]], [[0], [1]], [[1, 0]], [[0]])
    plant = rp.mixed_sensitivity(
        servo, performance=rp.weight(1e3, 0.2, 0.5), effort=rp.weight(0.01, 10, 100)
    )
    designs = [rp.output_feedback(plant, method=method) for method in ("riccati", "lmi")]
    for design in designs:
        assert design.status == "optimal"
        # What the same plant has with its pole at -1e-4 and 1e-4 instead of 0.
        assert design.certificate.achieved == pytest.approx(0.8471, rel=5e-3)


def test_without_work_nothing_is_found():
    budget = Budget(1.0)
    budget.spend(1.0)
    found = LmiHinf(settings()).search(task(unstable_lag()), budget)
    assert found.candidates == []
    assert found.best == np.inf


def test_inequalities_help_small_plants_whose_norm_no_limit_of_the_gain_explains():
    engine, small = LmiHinf(settings()), task(unstable_lag(), bounded=False)
    large = task(regular_plant(POLICY.lmi_states + 1), bounded=False)
    missed, falling = (
        EngineResult("riccati", "scipy"),
        EngineResult("riccati", "scipy", falling=True),
    )
    assert engine.is_useful(small, [missed])
    assert not engine.is_useful(small, [missed, falling])
    assert not engine.is_useful(large, [missed])
    assert engine.is_useful(large, [])  # it was asked for alone
