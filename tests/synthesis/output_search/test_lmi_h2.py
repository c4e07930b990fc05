"""H2 output feedback by linear matrix inequalities against an optimum in closed form."""

import numpy as np
import pytest
from output_tasks import LAG_H2, settings, task, unstable_lag

from robustpolish.base.budget import Budget
from robustpolish.synthesis.output_feedback.lmi import LmiH2


def test_the_h2_optimum_is_reached():
    found = LmiH2(settings("h2")).search(task(unstable_lag(), "h2"), Budget())
    assert LAG_H2 * (1 - 1e-6) <= found.best <= 1.001 * LAG_H2
    assert found.history[-1]["claim"] == pytest.approx(LAG_H2, rel=1e-4)


def test_without_work_nothing_is_found():
    budget = Budget(1.0)
    budget.spend(1.0)
    found = LmiH2(settings("h2")).search(task(unstable_lag(), "h2"), budget)
    assert found.candidates == []
    assert found.best == np.inf
