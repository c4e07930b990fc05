"""Output feedback by linear matrix inequalities against optima in closed form."""

import numpy as np
import pytest
from output_tasks import LAG_H2, LAG_HINF, settings, task, unstable_lag
from small_plants import regular_plant

from robustpolish.long_calls import Budget
from robustpolish.synthesis.output_search.engine import Found
from robustpolish.synthesis.output_search.lmi import LmiH2, LmiHinf
from robustpolish.synthesis.output_search.policy import POLICY


def test_the_hinf_optimum_is_reached_but_for_what_is_backed_off():
    found = LmiHinf(settings()).search(task(unstable_lag()), Budget())
    honest = [c for c in found.candidates if c.honest]
    assert honest
    assert min(c.achieved for c in honest) <= 1.006 * LAG_HINF
    assert found.history[0]["gamma"] == pytest.approx(LAG_HINF, rel=1e-3)
    # The claim of a candidate is the bound that it was asked to keep.
    assert {round(c.claimed / found.history[0]["gamma"], 3) for c in honest} == {1.006}
    assert not found.falling


def test_large_norms_are_solved_in_a_unit_of_their_own():
    factor = 1e6
    plant = unstable_lag()
    large = plant.replace(C1=factor * plant.C1, D12=factor * plant.D12)
    found = LmiHinf(settings()).search(task(large), Budget())
    assert LAG_HINF * factor * (1 - 1e-6) <= found.best <= 1.006 * LAG_HINF * factor
    assert any(c.honest for c in found.candidates)
    assert found.history[-1]["gamma"] == pytest.approx(LAG_HINF * factor, rel=1e-3)


def test_the_h2_optimum_is_reached():
    found = LmiH2(settings("h2")).search(task(unstable_lag(), "h2"), Budget())
    assert LAG_H2 * (1 - 1e-6) <= found.best <= 1.001 * LAG_H2
    assert found.history[-1]["claim"] == pytest.approx(LAG_H2, rel=1e-4)


@pytest.mark.parametrize("engine", [LmiHinf, LmiH2])
def test_without_work_nothing_is_found(engine):
    norm = "hinf" if engine is LmiHinf else "h2"
    budget = Budget(1.0)
    budget.spend(1.0)
    found = engine(settings(norm)).search(task(unstable_lag(), norm), budget)
    assert found.candidates == []
    assert found.best == np.inf


def test_inequalities_help_small_plants_whose_norm_no_limit_of_the_gain_explains():
    engine, small = LmiHinf(settings()), task(unstable_lag(), bounded=False)
    large = task(regular_plant(POLICY.lmi_states + 1), bounded=False)
    missed, falling = Found("riccati", "scipy"), Found("riccati", "scipy", falling=True)
    assert engine.adds(small, [missed])
    assert not engine.adds(small, [missed, falling])
    assert not engine.adds(large, [missed])
    assert engine.adds(large, [])  # it was asked for alone
