"""Work is counted, seconds only catch what goes wrong."""

import math

from robustpolish.budget import Budget, step_cost


def test_work_ends_a_search_whatever_the_time():
    budget = Budget(3.0)
    count = 0
    while not budget.over:
        budget.spend()
        count += 1
    assert count == 3
    assert budget.exhausted
    assert not budget.late


def test_a_share_spends_from_the_whole():
    budget = Budget(100.0)
    budget.spend(20.0)
    share = budget.share(0.25)
    assert share.work_left == 20.0
    share.spend(15.0)
    assert budget.work_left == 65.0
    budget.spend(65.0)
    assert share.exhausted  # the whole is, though the share has work left


def test_the_safety_net_is_remembered_and_passed_on():
    budget = Budget(math.inf, seconds=0.0)
    share = budget.share(1.0)
    assert share.late
    assert share.over
    assert budget.late
    assert not share.exhausted


def test_large_matrices_cost_more():
    costs = [step_cost(n) for n in (2, 20, 200)]
    assert costs == sorted(costs)
    assert costs[2] > 100 * costs[1]
