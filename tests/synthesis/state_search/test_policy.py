"""What follows from the thresholds of state feedback."""

import pytest

from robustpolish.synthesis.state_feedback.engine import POLICY, StatePolicy


def test_prices_fall_step_by_step_from_no_control_to_rounding_errors():
    prices = StatePolicy(price_step=10.0, price_exponents=range(1, -2, -1)).prices
    assert prices == pytest.approx((10.0, 1.0, 0.1))
    assert POLICY.prices[0] == pytest.approx(1e3)
    assert POLICY.prices[-1] == pytest.approx(1e-8)


def test_starts_under_a_bound_reach_further_on_both_sides():
    assert POLICY.starting_prices[0] > POLICY.prices[0]
    assert POLICY.starting_prices[-1] < POLICY.prices[-1]
    assert list(POLICY.starting_prices) == sorted(POLICY.starting_prices, reverse=True)


def test_work_of_a_gain_is_that_of_its_hamiltonian():
    # Small plants are all overhead; the cube counts twice the states, and 40 give 1 + 4^3.
    assert StatePolicy.gain_work(0) == 1.0
    assert StatePolicy.gain_work(40) == 65.0
