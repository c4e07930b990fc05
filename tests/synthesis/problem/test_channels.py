"""Channels keep the named signals, in the order asked for, and everything else."""

import numpy as np
import pytest
from small_plants import oscillator

import robustpolish as rp
from robustpolish.synthesis.problem.matrices import channel


def test_signals_come_in_the_order_asked_for():
    plant = oscillator().replace(D11=[[1.0, 2.0], [3.0, 4.0]])
    turned = channel(plant, ["noise", "force"], ["price", "x"])
    np.testing.assert_array_equal(turned.D11, [[4.0, 3.0], [2.0, 1.0]])
    np.testing.assert_array_equal(turned.D21, [[0.2, 0.0]])
    np.testing.assert_array_equal(turned.D12, [[0.5], [0.0]])
    assert turned.disturbance_names == ("noise", "force")


def test_one_name_is_a_channel_of_the_same_loop():
    plant = oscillator()
    part = channel(plant, "force", "x")
    assert (part.nw, part.nz) == (1, 1)
    for name in ("A", "B2", "C2", "D22"):
        np.testing.assert_array_equal(getattr(part, name), getattr(plant, name))
    whole, loop = (p.closed_loop([[-0.5]])(2j) for p in (plant, part))
    assert loop == pytest.approx(whole[0, 0])


@pytest.mark.parametrize(
    ("disturbances", "performance", "argument"),
    [
        ("wind", "x", "disturbances"),
        (["force", "force"], "x", "disturbances"),
        ("force", ["x", "y"], "performance"),
        ("force", [], "performance"),
    ],
)
def test_unknown_repeated_or_missing_names_are_refused(disturbances, performance, argument):
    known = "force, noise" if argument == "disturbances" else "x, price"
    with pytest.raises(rp.InvalidInputError, match=f"^{argument}: got .* names out of {known}"):
        channel(oscillator(), disturbances, performance)
