"""The longest period, where it can be worked out by hand."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.implementation.certify_sampled import longest_period


def lag(a=1.0):
    return rp.GeneralizedPlant.from_matrices([[a]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])


def gain(k):
    return control.ss([], [], [], [[k]])


def test_an_unstable_lag_with_a_gain():
    # x+ = (e - 3 (e - 1)) x is stable while e < 2.
    assert longest_period(lag(), gain(-3.0)) == pytest.approx(np.log(2), rel=1e-6)
    # One period of delay: z^2 - e z + 3 (e - 1), stable while 3 (e - 1) < 1.
    found = longest_period(lag(), gain(-3.0), delay_periods=1.0)
    assert found == pytest.approx(np.log(4 / 3), rel=1e-6)


def test_units_of_time_only_scale_it():
    found = longest_period(lag(1e6), gain(-3e6))
    assert found == pytest.approx(np.log(2) * 1e-6, rel=1e-6)


def test_a_fixed_delay_is_part_of_every_period():
    # x' = x - 3 x(t - d) is unstable from d = acos(1/3)/sqrt(8) on, however fast one samples.
    critical = np.arccos(1 / 3) / np.sqrt(8)
    assert longest_period(lag(), gain(-3.0), delay=critical * 1.05) == 0.0
    assert 0 < longest_period(lag(), gain(-3.0), delay=critical * 0.9) < 0.2


def test_no_limit_is_infinite():
    assert longest_period(lag(-1.0), gain(-0.5)) == np.inf
