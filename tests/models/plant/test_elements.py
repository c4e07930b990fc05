"""Lags of actuators and sensors."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.plants.wired import bilinear, lag, single_filter

HERTZ = 2000.0


@pytest.mark.parametrize("dt", [0, 1e-4])
@pytest.mark.parametrize(
    ("order", "damping"), [(None, None), (1, None), (2, None), (2, 0.3), (None, 1.5), (5, None)]
)
def test_the_gain_is_one_at_rest_and_3_db_less_at_the_bandwidth(order, damping, dt):
    system = lag(HERTZ, order, damping, dt)
    point = 2j * np.pi * HERTZ
    point = np.exp(point * dt) if dt else point
    assert abs(complex(system(point))) == pytest.approx(np.sqrt(0.5))
    assert complex(system(1.0 if dt else 0.0)) == pytest.approx(1.0)
    assert system.nstates == (order or (2 if damping else 1))


def test_the_damping_is_what_was_asked_for():
    poles = lag(HERTZ, 2, 0.3, 0).poles()
    np.testing.assert_allclose(-poles.real / np.abs(poles), 0.3)


def test_higher_orders_are_those_of_butterworth():
    for factor in (0.5, 3.0):
        gain = abs(complex(lag(1.0, 4, None, 0)(2j * np.pi * factor)))
        assert gain == pytest.approx(1 / np.sqrt(1 + factor**8))


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ((0.0, None, None, 0), "bandwidth_hz: got 0.0"),
        (("fast", None, None, 0), "bandwidth_hz: got 'fast'"),
        ((1.0, 0, None, 0), "order: got 0"),
        ((1.0, 2.0, None, 0), "order: got 2.0"),
        ((1.0, 9, None, 0), "order: got 9"),
        ((1.0, 2, -0.1, 0), "damping: got -0.1"),
        ((1.0, 3, 0.5, 0), "damping: got a damping for order 3"),
        ((6.0, 1, None, 0.1), "frequency: got 6 Hz, expected less than the Nyquist frequency 5 Hz"),
    ],
)
def test_bad_lags_are_named(given, told):
    with pytest.raises(rp.InvalidInputError, match=told):
        lag(*given)


def test_the_bilinear_image_is_right_at_its_frequency():
    A, B, C, D = (np.array([[v]]) for v in (-1.0, 1.0, 2.0, 0.5))
    system, rate, dt = bilinear(A, B, C, D, 0.01, 30.0), 30.0, 0.01
    assert complex(system(np.exp(1j * rate * dt))) == pytest.approx(0.5 + 2 / (1 + 1j))
    assert bilinear(A, B, C, D, True, 1.0).dt is True


def test_filters_have_one_input_and_one_output_and_the_time_of_the_plant():
    assert single_filter("W", 2.0, 0.1).dt == 0.1
    assert single_filter("W", control.tf([1], [1, 1]), 0).nstates == 1
    with pytest.raises(rp.InvalidInputError, match=r"W: got sampling time 0, expected 0\.1"):
        single_filter("W", control.tf([1], [1, 1]), 0.1)
    with pytest.raises(rp.InvalidInputError, match="W: got 2 inputs and 2 outputs"):
        single_filter("W", np.eye(2), 0)
