"""Weights between two gains."""

import control
import numpy as np
import pytest

import robustpolish as rp


def gain(system, hertz, dt=0):
    s = 2j * np.pi * hertz
    return abs(complex(system(np.exp(s * dt) if dt else s)))


@pytest.mark.parametrize("order", [1, 2, 3, 7])
@pytest.mark.parametrize(("low", "high"), [(100.0, 0.5), (0.01, 20.0), (1.5, 0.0), (0.0, 3.0)])
def test_the_three_gains_are_what_was_asked_for(low, high, order):
    W = rp.weight(low, 40.0, high, order)
    assert gain(W, 0.0) == pytest.approx(low, abs=1e-12)
    assert gain(W, 40.0) == pytest.approx(1)
    assert gain(W, 1e12) == pytest.approx(high, abs=1e-6)
    assert W.nstates == order
    assert (W.poles().real < 0).all()


def test_order_one_is_makeweight():
    # (high s + low p) / (s + p) with |W(i w)| = 1
    low, w, high = 100.0, 2 * np.pi * 3, 0.25
    p = w * np.sqrt((1 - high**2) / (low**2 - 1))
    W = rp.weight(low, 3.0, high)
    for s in (0.1j, 5j, 100j):
        assert complex(W(s)) == pytest.approx((high * s + low * p) / (s + p))


def test_the_slope_is_that_of_the_order():
    W = rp.weight(1e12, 1.0, 1e-12, order=3)
    assert gain(W, 0.1) / gain(W, 1.0) == pytest.approx(1e3, rel=1e-3)


def test_an_inverse():
    W, bound = rp.weight(1e-3, 5.0, 2.0, inverse=True), rp.weight(1e-3, 5.0, 2.0)
    for hertz in (0.0, 0.3, 5.0, 1e3):
        assert gain(W, hertz) * gain(bound, hertz) == pytest.approx(1)
        assert gain(rp.weight(1e3, 5.0, 0.5), hertz) == pytest.approx(gain(W, hertz))


def test_an_integrator():
    W = rp.weight(np.inf, 2.0, 0.3)
    assert W.poles() == pytest.approx([0])
    assert gain(W, 2.0) == pytest.approx(1)
    assert gain(W, 2e-6) == pytest.approx(1e6 * np.sqrt(1 - 0.3**2), rel=1e-6)


@pytest.mark.parametrize("order", [1, 2])
def test_in_discrete_time_the_gains_hold_at_rest_crossover_and_nyquist(order):
    W = rp.weight(50.0, 12.0, 0.1, order, dt=0.01)
    assert W.dt == 0.01
    for hertz, expected in ((0.0, 50.0), (12.0, 1.0), (50.0, 0.1)):
        assert gain(W, hertz, 0.01) == pytest.approx(expected)


def test_it_is_a_system_of_python_control():
    W = rp.weight(10.0, 1.0, 0.1)
    assert isinstance(W, control.StateSpace)
    assert complex((W * W)(2j)) == pytest.approx(complex(W(2j)) ** 2)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ((10.0, 1.0, 2.0), "low: got gains 10 and 2, expected one above and one below 1"),
        ((0.1, 1.0, 0.5), "low: got gains 0.1 and 0.5"),
        ((1.0, 1.0, 0.5), "low: got gains 1 and 0.5"),
        ((-1.0, 1.0, 2.0), "low: got -1.0, expected a gain of at least 0"),
        (("40 dB", 1.0, 0.5), "low: got '40 dB'"),
        ((10.0, 0.0, 0.5), "crossover_hz: got 0.0"),
        ((10.0, 1.0, np.nan), "high: got nan"),
        ((0.1, 1.0, np.inf), "high: got an infinite gain"),
        ((10.0, 1.0, 0.1, 0), "order: got 0"),
        ((10.0, 1.0, 0.1, 1.5), "order: got 1.5"),
    ],
)
def test_bad_weights_are_named(given, told):
    with pytest.raises(rp.InvalidInputError, match=told):
        rp.weight(*given)


def test_bad_keywords_are_named():
    with pytest.raises(rp.InvalidInputError, match=r"low: got 0\.0, expected a gain above 0"):
        rp.weight(0.0, 1.0, 2.0, inverse=True)
    with pytest.raises(rp.InvalidInputError, match="frequency: got 60 Hz, expected less than the"):
        rp.weight(10.0, 60.0, 0.1, dt=0.01)
    with pytest.raises(rp.InvalidInputError, match="inverse: got 'yes'"):
        rp.weight(10.0, 60.0, 0.1, inverse="yes")
    with pytest.raises(rp.InvalidInputError, match="dt: got -1"):
        rp.weight(10.0, 60.0, 0.1, dt=-1)
