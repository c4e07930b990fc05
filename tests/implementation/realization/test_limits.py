"""Limits and anti-windup."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.implementation.realization import anti_windup, control_limits


def test_limits_in_every_form():
    names = ("F", "M")
    for given in (2.0, (-2, 2), [2.0, (-2.0, 2.0)], {"F": 2.0, "M": (-2, 2)}):
        low, high = control_limits(given, names)
        np.testing.assert_array_equal(low, [-2, -2])
        np.testing.assert_array_equal(high, [2, 2])
    low, high = control_limits({"M": 1.0}, names)
    assert low[0] == -np.inf
    assert high.tolist() == [np.inf, 1.0]
    assert control_limits(None, names) is None


@pytest.mark.parametrize("bad", [0.0, -1.0, "x", (2, 1), [1.0], {"G": 1}, (1, 2, 3), np.nan])
def test_wrong_limits_are_refused(bad):
    with pytest.raises(rp.InvalidInputError, match="limits"):
        control_limits(bad, ("F", "M"))


def test_a_conditioned_pi_controller_forgets_at_once():
    # u = 2 e + sum of 0.1 e: conditioned, the state is what makes u just reach the limit.
    K = control.ss([[1.0]], [[0.1]], [[1.0]], [[2.0]], 0.1)
    found = anti_windup(K)
    assert found.form == "conditioned"
    assert found.L[0, 0] == pytest.approx(0.05)


def test_a_strictly_proper_controller_gets_an_observer():
    K = control.ss([[1.0, 0.1], [0, 0.5]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], 0.1)
    found = anti_windup(K)
    assert found.form == "observer"
    assert np.abs(np.linalg.eigvals(K.A - found.L @ K.C)).max() < 0.99
    with pytest.raises(rp.InvalidInputError, match="conditioned"):
        anti_windup(K, "conditioned")
    assert not anti_windup(K, "none").L.any()
    with pytest.raises(rp.InvalidInputError, match="anti_windup"):
        anti_windup(K, "hanus?")
