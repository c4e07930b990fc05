from itertools import pairwise

import numpy as np
import pytest

from robustpolish.plants.uncertain.cover import bounding_weight, envelope

OMEGA = np.geomspace(1e-3, 1e5, 300)
S = 1j * OMEGA


def ratios(weight, omega, gains):
    return np.abs(weight(1j * omega).ravel()) / gains


def assert_stable_with_stable_inverse(weight):
    assert (weight.poles().real < 0).all()
    assert (weight.zeros().real < 0).all()


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e4])
def test_gain_of_a_system_is_found_again(unit):
    gains = np.abs(2 * (S + 1) / (S + 100))
    weight = bounding_weight(OMEGA * unit, 1e-5 * gains, 3)
    assert weight.nstates == 1
    assert weight.poles().real == pytest.approx([-100 * unit], rel=1e-2)
    found = ratios(weight, OMEGA * unit, 1e-5 * gains)
    assert found.min() >= 1
    assert found.max() < 1.001


@pytest.mark.parametrize("order", [0, 1, 2, 3, 5])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_weight_lies_above_rough_gains(seed, order):
    random = np.random.default_rng(seed)
    walk = np.cumsum(random.standard_normal(120)) * 0.2
    omega, gains = np.geomspace(0.1, 1e3, 120), np.exp(walk)
    weight = bounding_weight(omega, gains, order)
    assert weight.nstates <= order
    assert ratios(weight, omega, gains).min() >= 1
    assert_stable_with_stable_inverse(weight)


def test_more_states_come_no_farther_away():
    gains = np.abs(1 + 30 * S / (S**2 + 6 * S + 900) + S / (S + 3e3))
    reached = [ratios(bounding_weight(OMEGA, gains, n), OMEGA, gains).max() for n in range(5)]
    assert all(b <= a * 1.002 for a, b in pairwise(reached))
    assert reached[-1] < 1.2 < reached[0]


def test_least_ratio_is_that_of_the_best_constant():
    # Between 1 and 4 no constant is nearer than 4 above the smaller one.
    gains = np.where(OMEGA < 1, 1.0, 4.0)
    assert ratios(bounding_weight(OMEGA, gains, 0), OMEGA, gains).max() == pytest.approx(4)


def test_first_order_is_the_best_of_its_order():
    # No first-order weight that a search over zero and pole finds is nearer.
    gains = np.abs(S / (S + 10) * (S + 500) / (S + 100)) + 0.01
    best = ratios(bounding_weight(OMEGA, gains, 1), OMEGA, gains).max()
    for zero in np.geomspace(1e-3, 1e3, 60):
        for pole in np.geomspace(1e-1, 1e4, 60):
            shape = np.abs((S + zero) / (S + pole)) / gains
            assert shape.max() / shape.min() > best * 0.99


def test_dips_are_filled_and_slopes_are_not():
    gains = 2 * np.abs(np.sin(OMEGA * 0.01 / 2))
    filled = envelope(OMEGA, gains)
    assert (filled >= gains).all()
    assert filled[OMEGA > 1e3].min() > 1.5
    assert filled[50] == pytest.approx(max(gains[50], 2e-4))
