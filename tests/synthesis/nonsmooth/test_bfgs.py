"""BFGS on functions whose minimum is known."""

import time

import numpy as np
import pytest

from robustpolish.base.budget import Budget
from robustpolish.synthesis.nonsmooth.descent import bfgs


def test_it_walks_along_a_kink():
    def function(x):
        # The nonsmooth Rosenbrock function of Lewis and Overton (2013), minimum 0 at (1, 1).
        kink = x[1] - x[0] ** 2
        gradient = 8 * np.sign(kink) * np.array([-2 * x[0], 1.0]) + [2 * (x[0] - 1), 0]
        return 8 * abs(kink) + (x[0] - 1) ** 2, gradient

    ended = bfgs(function, np.array([-1.2, 1.0]), Budget(), iterations=500, tolerance=1e-12)
    assert ended.value < 1e-5


def logarithmic_barrier(x):
    """X - log x, infinite for x <= 0: minimum 1 at 1."""
    if x[0] <= 0:
        return np.inf, np.zeros(1)
    return x[0] - np.log(x[0]), 1 - 1 / x


@pytest.mark.parametrize("start", [1e-3, 10.0])
def test_steps_into_infinity_are_shortened(start):
    ended = bfgs(logarithmic_barrier, np.array([start]), Budget(), tolerance=1e-12)
    assert ended.point == pytest.approx([1.0], abs=1e-5)
    assert ended.value == pytest.approx(1.0, abs=1e-10)


def many_slopes(x):
    return float(np.sum(np.abs(x) ** 1.5)), 1.5 * np.sign(x) * np.sqrt(np.abs(x))


def test_it_stops_at_a_target_and_at_a_flat_place():
    start = np.linspace(1.0, 2.0, 20)
    ended, whole = (bfgs(many_slopes, start, Budget(), target=goal) for goal in (5.0, -np.inf))
    assert ended.reason == "target"
    assert whole.value < ended.value < 5.0
    assert ended.iterations < whole.iterations
    ended = bfgs(logarithmic_barrier, np.array([1.0]), Budget())
    assert (ended.reason, ended.iterations) == ("stationary", 1)


def test_it_ends_when_its_work_is_spent():
    def descent(budget):
        return bfgs(many_slopes, np.linspace(1.0, 2.0, 20), budget, work=2.0, tolerance=0.0)

    ended = descent(Budget(20.0))
    assert ended.reason == "work"
    budget = Budget(60.0)
    longer = descent(budget)
    assert longer.value < ended.value
    # A line search looks at the budget after each evaluation.
    assert 60.0 <= budget.spent <= 62.0


def test_it_obeys_the_safety_net():
    def slow(x):
        time.sleep(0.01)
        return many_slopes(x)

    began = time.monotonic()
    ended = bfgs(
        slow, np.linspace(1.0, 2.0, 20), Budget(seconds=0.1), iterations=10_000, tolerance=0.0
    )
    assert ended.reason == "time"
    assert time.monotonic() - began < 1.0
