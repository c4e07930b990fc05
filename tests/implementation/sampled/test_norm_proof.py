"""Proofs: true bounds are proven, false ones are not."""

import numpy as np

from robustpolish.implementation.sampled.induced_norm import bracket, check_gain, period_section
from robustpolish.implementation.sampled.proof import period_balls, prove_above, prove_below
from robustpolish.linear.arithmetic import balls
from tests.implementation.sampled.test_induced_norm import loop


def test_both_ends_are_proven_and_nothing_beyond_them():
    own = loop()
    low, high = bracket(own, 1.0)
    bound, storage = prove_below(own, high.gamma)
    assert high.gamma < bound < high.gamma * (1 + 1e-5)
    assert np.linalg.eigvalsh(storage).min() > 0
    assert prove_above(own, check_gain(own, low.gamma * (1 - 1e-5)))
    assert prove_below(own, low.gamma * 0.99) is None
    assert not prove_above(own, high)


def test_balls_hold_what_doubles_found():
    own = loop()
    gamma = 2.0
    with balls.precision(200):
        section, sound = period_balls(own, gamma)
    assert sound
    expected = period_section(own, gamma)
    for mine, theirs in zip(section, expected, strict=True):
        np.testing.assert_allclose(balls.midpoint(mine), theirs, rtol=1e-8, atol=1e-11)
        assert all(float(entry.rad()) < 1e-30 for entry in mine.entries())
