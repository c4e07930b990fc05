"""Maps from free numbers to gains: adjoints, subspaces, ways back."""

import numpy as np
import pytest
from random_loops import random_loop

from robustpolish.synthesis.nonsmooth.descent import (
    MaskedGain,
    ObserverGain,
    PositiveElements,
)

RNG = np.random.default_rng(5)
MASK = np.array([[True, False, True], [True, True, False]])
FIRST_ROW, COLUMN = np.array([[1.0, 0.0]]), np.array([[1.0], [5.0], [2.0]])


def observer():
    loop = random_loop(np.random.default_rng(5), d22=0.2)
    return ObserverGain(loop.A, loop.B2, loop.C2, loop.D22)


def on_a_plane():
    """Free entries with k11 + 5 k12 + 2 k13 = 3, of which k12 is none."""
    found = MaskedGain(MASK).restricted(FIRST_ROW, COLUMN, np.array([[3.0]]))
    assert found is not None
    return found


@pytest.mark.parametrize(
    "free",
    [observer(), MaskedGain(MASK), on_a_plane(), PositiveElements(RNG.normal(size=(4, 2, 3)))],
    ids=lambda free: type(free).__name__,
)
def test_gradients_travel_back_by_the_adjoint(free):
    theta, change = RNG.normal(size=(2, free.size))
    G = RNG.normal(size=free.gain(theta).shape)
    slope = free.gain(theta + 1e-6 * change) - free.gain(theta - 1e-6 * change)
    assert (slope * G).sum() / 2e-6 == pytest.approx(free.back(theta, G) @ change, rel=1e-6)


def test_a_restricted_gain_stays_on_its_plane():
    plane = on_a_plane()
    assert plane.size == 3
    for theta in RNG.normal(size=(5, 3)):
        K = plane.gain(theta)
        assert not K[~MASK].any()
        assert (FIRST_ROW @ K @ COLUMN).item() == pytest.approx(3.0)
        assert plane.coordinates(K) == pytest.approx(theta)
    # Of a gain beside the plane the nearest point is kept: what is missing is normal to it.
    K = np.where(MASK, RNG.normal(size=MASK.shape), 0.0)
    apart = K - plane.gain(plane.coordinates(K))
    assert apart[0, 2] == pytest.approx(2 * apart[0, 0])
    assert apart[1] == pytest.approx(np.zeros(3), abs=1e-12)


def test_an_observer_is_taken_apart_into_feedback_and_observer_gain():
    free = observer()
    F, L = RNG.normal(size=(2, 4)), RNG.normal(size=(4, 2))
    again = free.split(free.join(F, L))
    assert np.array_equal(again[0], F)
    assert np.array_equal(again[1], L)
    # xhat' = A xhat + B u + L (y - C xhat - D u) with u = F xhat.
    K = free.gain(free.join(F, L))
    xhat, y = RNG.normal(size=4), RNG.normal(size=2)
    u = F @ xhat
    expected = free.A @ xhat + free.B @ u + L @ (y - free.C @ xhat - free.D @ u)
    assert K @ np.concatenate([xhat, y]) == pytest.approx(np.concatenate([expected, u]))
