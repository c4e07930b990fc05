"""The count of unstable roots where it gives up, and where the Pade model misleads."""

from dataclasses import replace

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.linear.delays.stability import WINDING_POLICY as POLICY
from robustpolish.linear.delays.stability import count_unstable


def loop(order=1, T=1.0, gain=1.0):
    ports = control.ss([[0.0]], [[-gain]], [[1.0]], 0)
    return rp.simulation.DelayedSystem(ports, (rp.simulation.DelayLine("y", T, order),))


@pytest.mark.parametrize("order", [1, 2, 5])
@pytest.mark.parametrize("T", [1.5, 1.6, 1.9, 2.1, 9.0])
def test_the_count_does_not_depend_on_the_pade_model(T, order):
    # Of order 1 it is stable up to T = 2; the truth is pi / 2.
    expected = 2 * int(np.ceil((T - np.pi / 2) / (2 * np.pi))) if np.pi / 2 < T else 0
    assert count_unstable(loop(order, T)).unstable == expected


def test_a_pade_model_on_the_axis_is_replaced():
    assert count_unstable(loop(1, 2.0)).unstable == 2


def test_it_gives_up_where_it_would_take_too_long():
    counted = count_unstable(loop(1, 9.0), replace(POLICY, most_points=10))
    assert (counted.unstable, counted.reason) == (None, "too many frequencies would be needed")


def test_a_root_on_the_axis_is_not_counted():
    counted = count_unstable(loop(3, np.pi / 2))
    assert counted.unstable is None
    assert counted.highest == pytest.approx(1 / 0.8, rel=0.1)
