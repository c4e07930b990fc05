"""The smallest gain that keeps a norm: against closed forms, with and without a start."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.synthesis.certificate import Norm
from robustpolish.synthesis.problem.matrices import PlantMatrices, state_gain_norm
from robustpolish.synthesis.state_feedback.engine import StateGain
from robustpolish.synthesis.state_feedback.riccati import RiccatiStateEngine
from robustpolish.synthesis.state_feedback.search import SmallestGain
from tests.synthesis.state_search.test_part_search import lag


def search(plant, norm: Norm = "hinf", unit=1.0):
    p = PlantMatrices.of(plant)
    engine = RiccatiStateEngine(norm)
    one = np.eye(1)
    best = engine.search(p, Budget())
    assert best is not None
    return SmallestGain(engine, p, unit * one, one, Budget()), best


def test_it_is_the_smallest_that_keeps_the_norm_of_a_lag():
    # sqrt(1 + k^2) / (k - 1) = 4 for x' = x + w + u, z = (x, u).
    kit, best = search(lag(a=1.0))
    found = kit.within(4.0, best)
    least = (16 + np.sqrt(31)) / 15
    assert kit.size(found.F) == pytest.approx(least, rel=1e-3)
    assert state_gain_norm(kit.plant, found.F, "hinf") <= 4.0
    assert found.history[-1]["step"] == "descent on the gain"


def test_the_h2_norm_too():
    # The squared norm of x' = x + w + u, z = (x, u) with u = -k x is (1 + k^2) / (2 (k - 1)).
    kit, best = search(lag(a=1.0), "h2")
    found = kit.within(2.0, best)
    assert kit.size(found.F) == pytest.approx(4 - np.sqrt(7), rel=1e-3)


def test_sizes_are_in_the_units_of_the_plant():
    kit, best = search(lag(a=1.0), unit=1e3)
    assert kit.size(best.F) == pytest.approx(1e3 * abs(best.F.item()))


def test_no_control_is_the_smallest_of_all():
    kit, best = search(lag())
    found = kit.within(1.1, best)
    assert not found.F.any()
    assert found.status == "suboptimal"


def test_a_found_gain_is_returned_where_nothing_is_smaller():
    kit, best = search(lag(a=1.0))
    assert kit.within(best.achieved * (1 + 1e-9), best).achieved <= best.achieved * (1 + 1e-9)


def test_a_norm_of_zero_is_kept_without_a_descent():
    unseen = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[0.0]], [[1.0]])
    plant, one = PlantMatrices.of(unseen), np.eye(1)
    kit = SmallestGain(RiccatiStateEngine("hinf"), plant, one, one, Budget())
    found = kit.within(0.0, StateGain(np.array([[-5.0]]), 0.0, 0.0))
    assert found.achieved == 0.0
    assert found.F.item() < -1.0
