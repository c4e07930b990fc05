"""Bare controllers are refused with the way to make designs of them."""

import control
import pytest

import robustpolish as rp


@pytest.mark.parametrize(
    "use",
    [
        lambda K: rp.compare_controllers({"PD": K}, rp.simulate_brush(duration=0.02)),
        lambda K: rp.simulation.check_robustness(K, None),
        lambda K: rp.monte_carlo(K, {}),
        lambda K: rp.synthesis.largest_period(K),
    ],
)
def test_a_transfer_function_is_not_a_design_yet(use):
    with pytest.raises(rp.InvalidInputError, match=r"got TransferFunction.*given_controller"):
        use(control.tf([-1.0, -3.0], [0.01, 1.0]))
