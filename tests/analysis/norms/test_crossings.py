"""Frequencies at which a singular value has a given size, without rounding."""

import control
import numpy as np
import pytest
from flint import fmpq

from robustpolish.linear.arithmetic.rational import ExactModel
from robustpolish.linear.arithmetic.realisation import realisation
from robustpolish.linear.norms.peak import gain_crossings


def model(*matrices, dt=0):
    return ExactModel.of(realisation("s", control.ss(*matrices, dt)))


def test_a_lag_crosses_once():
    """1/(1 + x^2) = 1/4 at x = sqrt(3)."""
    (found,) = gain_crossings(model(-1.0, 1.0, 1.0, 0.0), fmpq(1, 4))
    assert int(found.p) / int(found.q) == pytest.approx(np.sqrt(3), rel=1e-15)


def test_above_the_peak_there_is_none_however_close():
    lag = model(-1.0, 1.0, 1.0, 0.0)
    assert gain_crossings(lag, fmpq(1) + fmpq(1, 10**40)) == []
    touched = gain_crossings(lag, fmpq(1))
    assert [int(x.p) for x in touched] == [0]


def test_feedthrough_and_discrete_time_go_by_the_pencil():
    """(s + 3)/(s + 1): (9 + x^2)/(1 + x^2) = 4 at x^2 = 5/3."""
    (found,) = gain_crossings(model(-1.0, 1.0, 2.0, 1.0), fmpq(4))
    assert int(found.p) / int(found.q) == pytest.approx(np.sqrt(5 / 3), rel=1e-15)
    sampled = control.ss(0.5, 1.0, 1.0, 0.0, True)
    (found,) = gain_crossings(model(0.5, 1.0, 1.0, 0.0, dt=True), fmpq(1))
    angle = 2 * np.arctan(int(found.p) / int(found.q))
    assert abs(sampled(np.exp(1j * angle))) == pytest.approx(1.0, rel=1e-12)
