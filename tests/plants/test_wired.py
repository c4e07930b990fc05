"""Actuators, sensors, filters, delays and weights put into a plant."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.plants.wired import lag

# Actuators, sensors, filters, delays and weights against transfer functions by hand.


HERTZ = np.array([0.3, 2.0, 17.0])
S = 2j * np.pi * HERTZ
PADE3 = np.polynomial.Polynomial([120.0, -60.0, 12.0, -1.0])


def plant():
    """Two masses: force on the first, both measured, a load on the second; z shows both."""
    k, d = 400.0, 0.8
    A = [[0, 1, 0, 0], [-k, -d, k, d], [0, 0, 0, 1], [k, d, -k, -d]]
    system = control.ss(
        A,
        [[0, 0], [1, 0], [0, 0], [0, 1]],
        [[1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 1, 0], [1, 0, 0, 0]],
        [[0, 0], [0, 0], [0, 0], [0, 0]],
        inputs=["F", "load"],
        outputs=["x1", "z2", "x2", "z1"],
        states=["p1", "v1", "p2", "v2"],
    )
    units = {"F": "N", "load": "N", "x1": "m", "x2": "m", "z1": "m", "p1": "m"}
    return rp.GeneralizedPlant(system, measurements=["x1", "x2"], controls="F", units=units)


def response(wired, output, given):
    return wired.frequency_response(HERTZ).sel(output=output, input=given).values


def ratio(changed, output, given, original=None):
    return response(changed, output, given) / response(original or plant(), output, given)


def values(system):
    return np.array([complex(system(s)) for s in S])


def test_an_actuator_stands_in_the_way_of_its_control_only():
    wired = plant().with_actuator("F", bandwidth_hz=5.0, damping=0.4, limit=20.0, rate_limit=1e3)
    expected = values(lag(5.0, 2, 0.4, 0))
    for output in ("x1", "x2", "z1", "z2"):
        np.testing.assert_allclose(ratio(wired, output, "F"), expected)
        np.testing.assert_allclose(ratio(wired, output, "load"), 1)
    assert (dict(wired.limits), dict(wired.rate_limits)) == ({"F": 20.0}, {"F": 1e3})
    assert wired.states[:4] == plant().states
    assert wired.states[4:] == ("F_actuator[0]", "F_actuator[1]")
    assert wired.units == plant().units


def test_a_sensor_with_noise_behind_it():
    shape = control.tf([3e-6], [1, 50.0])
    wired = plant().with_sensor("x1", 30.0, noise=1e-6).with_sensor("x2", noise=shape)
    np.testing.assert_allclose(ratio(wired, "x1", "load"), values(lag(30.0, None, None, 0)))
    np.testing.assert_allclose(ratio(wired, "x2", "F"), 1)
    np.testing.assert_allclose(ratio(wired, "z1", "F"), 1)
    np.testing.assert_allclose(response(wired, "x1", "noise_x1"), 1e-6)
    np.testing.assert_allclose(response(wired, "x2", "noise_x2"), values(shape))
    assert not response(wired, "z2", "noise_x2").any()
    assert wired.disturbance_names == ("load", "noise_x1", "noise_x2")


def test_noise_gives_the_variance_that_it_should():
    T, gain, density = 0.1, 3.0, 2.0
    lagged = control.ss(-1 / T, 1 / T, [[1], [1]], [[0], [0]], inputs="u", outputs=["z", "y"])
    wired = rp.GeneralizedPlant(lagged, "y", "u").with_sensor("y", noise=density)
    # z = -gain density / (T s + 1 + gain) times white noise
    variance = (gain * density) ** 2 / (2 * T * (1 + gain))
    assert rp.h2_norm(wired.closed_loop([[-gain]])).value ** 2 == pytest.approx(variance)


def test_filters_find_measurements_and_disturbances():
    notch = control.tf([1, 0.1, 400], [1, 8, 400])
    wired = plant().with_filter("x1", notch).with_filter("load", 3.0)
    np.testing.assert_allclose(ratio(wired, "x1", "F"), values(notch))
    np.testing.assert_allclose(ratio(wired, "x2", "load"), 3)
    np.testing.assert_allclose(ratio(wired, "z1", "F"), 1)


def test_weights_on_performance_and_disturbances():
    W, V = rp.weight(10.0, 3.0, 0.1), control.tf([5.0], [1, 5.0])
    wired = plant().weighted({"z1": W, "load": V, "z2": 4})
    np.testing.assert_allclose(ratio(wired, "z1", "load"), values(W) * values(V))
    np.testing.assert_allclose(ratio(wired, "z1", "F"), values(W))
    np.testing.assert_allclose(ratio(wired, "z2", "F"), 4)
    np.testing.assert_allclose(ratio(wired, "x1", "load"), values(V))
    np.testing.assert_allclose(ratio(wired, "x1", "F"), 1)
    assert (wired.units, wired.performance_names) == (plant().units, plant().performance_names)


@pytest.mark.parametrize("name", ["F", "x1", "load", "z2"])
def test_a_delay_is_exact_in_responses_and_pade_in_the_system(name):
    T = 0.02
    wired = plant().with_delay(name, T)
    exact, pade = np.exp(-S * T), PADE3(S * T) / PADE3(-S * T)
    for output in ("x1", "x2", "z1", "z2"):
        for given in ("F", "load"):
            crossed = name in (output, given)
            np.testing.assert_allclose(ratio(wired, output, given), exact if crossed else 1)
            i = wired.system.output_labels.index(output)
            j = wired.system.input_labels.index(given)
            approximated = [wired.system(s)[i, j] for s in S] / response(plant(), output, given)
            np.testing.assert_allclose(approximated, pade if crossed else 1)
    assert dict(wired.delays) == {name: T}
    assert wired.nx == 7
    assert (wired.frequency_response(HERTZ)["frequency"] == HERTZ).all()


def test_whatever_is_added_before_or_behind_a_delay_keeps_it():
    first = plant().with_actuator("F", 5.0).with_delay("F", 0.01).with_delay(["x1", "F"], 0.02)
    wired = first.with_sensor("x1", 30.0).weighted({"z1": 2.0}).with_control_outputs()
    wired = wired.with_actuator("F", 50.0).replace(measurements=["a", "b"], units={"b": "m"})
    lags = values(lag(5.0, 1, None, 0)) * values(lag(50.0, 1, None, 0))
    assert dict(wired.delays) == {"F": 0.03, "a": 0.02}
    own = response(wired, "z1", "F") / response(plant(), "z1", "F")
    np.testing.assert_allclose(own, 2 * lags * np.exp(-0.03 * S))
    seen = response(wired, "a", "F") / response(plant(), "x1", "F")
    np.testing.assert_allclose(seen, lags * values(lag(30.0, 1, None, 0)) * np.exp(-0.05 * S))
    np.testing.assert_allclose(response(wired, "F", "F"), values(lag(50.0, 1, None, 0)))


def test_a_part_of_the_signals_keeps_delays_and_a_part_of_the_states_does_not():
    wired = plant().with_delay("x2", 0.01)
    part = wired.part(measurements=[1], performance=[])
    np.testing.assert_allclose(ratio(part, "x2", "F"), np.exp(-0.01 * S))
    assert not wired.part(states=range(wired.nx)).delays


def test_the_delayed_loop_is_the_loop_of_the_responses():
    wired = plant().with_delay("x1", 0.03).with_delay("F", 0.01)
    K = control.ss([[-2.0]], [[1.0, 0.3]], [[-40.0]], [[-5.0, 1.0]])
    P = wired.frequency_response(HERTZ).values
    found = wired.delayed_loop(K).response(2 * np.pi * HERTZ)
    for i, s in enumerate(S):
        k, p = K(s), P[i]
        inner = np.linalg.solve(np.eye(1) - k @ p[2:, 1:], k @ p[2:, :1])
        np.testing.assert_allclose(found[i], p[:2, :1] + p[:2, 1:] @ inner)


def test_in_discrete_time_a_delay_is_a_chain_of_states():
    system = control.ss([[0.5]], [[1.0]], [[1.0]], 0, 0.1, inputs="u", outputs="y")
    wired = rp.GeneralizedPlant(system, "y", "u").with_delay("u", 0.3)
    z = np.exp(0.1 * 2j * np.pi * 1.7)
    expected = z**-3 / (z - 0.5)
    assert complex(wired.system(z)) == pytest.approx(expected)
    assert complex(wired.frequency_response([1.7])[0, 0, 0]) == pytest.approx(expected)
    assert dict(wired.delays) == {"u": 0.3}
    with pytest.raises(rp.InvalidInputError, match=r"seconds: got 0.25, expected a whole number"):
        wired.with_delay("u", 0.25)
    assert wired.with_actuator("u", 1.0).dt == 0.1


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda p: p.with_actuator("x1", 5.0), "name: got 'x1', expected names .* controls: F"),
        (lambda p: p.with_actuator("F"), "bandwidth_hz: got None"),
        (lambda p: p.with_actuator("F", 5.0, dynamics=2.0), "dynamics: got a bandwidth"),
        (lambda p: p.with_actuator("F", order=2), "bandwidth_hz: got None"),
        (lambda p: p.with_actuator("F", limit=-1.0), "limit: got -1.0"),
        (lambda p: p.with_actuator("F", limit="1 N"), "limit: got '1 N'"),
        (lambda p: p.with_sensor("F", 5.0), "name: got 'F', expected names .* x1, x2"),
        (lambda p: p.with_sensor("x1"), "bandwidth_hz: got None"),
        (lambda p: p.with_sensor(["x1", "x1"], 5.0), "name: got x1, x1, with a name twice"),
        (lambda p: p.with_filter("q", 1.0), "name: got 'q', expected one of the signals F, x1"),
        (lambda p: p.with_filter("F", np.eye(2)), "system: got 2 inputs"),
        (lambda p: p.weighted({"q": 1.0}), "name: got 'q'"),
        (lambda p: p.weighted({"z1": "W"}), r"weights\['z1'\]: got 'W'"),
        (lambda p: p.weighted([1.0]), "weights: got list"),
        (lambda p: p.with_delay("q", 1.0), "name: got 'q'"),
        (lambda p: p.with_delay("F", -1.0), "seconds: got -1.0"),
        (lambda p: p.with_delay("F", np.nan), "seconds: got nan"),
        (lambda p: p.with_delay("F", 1.0, order=0), "order: got 0"),
        (lambda p: p.with_delay("F", 1.0, order=2.5), "order: got 2.5"),
        (lambda p: p.with_delay("F", 1.0).with_full_state(), "delays, which have infinitely many"),
        (lambda p: p.with_delay("F", 1.0).replace(A=np.eye(7)), "A: got a change of a plant with"),
        (lambda p: p.with_delay(None, 1.0), "name: got None, expected one of the signals"),
        (lambda p: p.frequency_response([np.inf]), "frequency: got an array of shape"),
        (lambda p: p.frequency_response("all"), "frequency: got 'all'"),
        (lambda p: rp.GeneralizedPlant(p.system, 2, 1, limits=5.0), "limits: got float"),
        (lambda p: rp.GeneralizedPlant(p.system, 2, 1, ["m"]), "units: got list"),
    ],
)
def test_bad_wires_are_named(call, told):
    with pytest.raises(rp.InvalidInputError, match=told):
        call(plant())


def test_a_name_of_two_signals_is_refused_where_it_does_not_say_which():
    system = control.ss([[-1.0]], [[1.0]], [[1.0]], 0, inputs="a", outputs="a")
    both = rp.GeneralizedPlant(system, "a", "a")
    assert both.with_actuator("a", 1.0).with_sensor("a", 1.0).nx == 3
    with pytest.raises(rp.InvalidInputError, match="'a', the name of a control and a measurement"):
        both.with_delay("a", 1.0)


def test_limits_of_unknown_controls_are_refused():
    with pytest.raises(rp.InvalidInputError, match="limits: got 'G', expected one of 'F'"):
        rp.GeneralizedPlant(plant().system, 2, 1, limits={"G": 1.0})
    with pytest.raises(rp.InvalidInputError, match=r"rate_limits\.F: got -1"):
        rp.GeneralizedPlant(plant().system, 2, ["F"], rate_limits={"F": -1.0})


def test_files_keep_everything(tmp_path):
    wired = plant().with_actuator("F", 5.0, limit=3.0, rate_limit=4.0).with_delay("F", 0.01)
    wired = wired.with_delay("x1", 0.02, order=5).with_sensor("x2", noise=1e-3)
    wired.save(tmp_path / "plant.json")
    again = rp.load(tmp_path / "plant.json")
    np.testing.assert_array_equal(again.system.A, wired.system.A)
    xr_same = again.frequency_response(HERTZ).equals(wired.frequency_response(HERTZ))
    assert xr_same
    for fact in ("delays", "limits", "rate_limits", "units"):
        assert dict(getattr(again, fact)) == dict(getattr(wired, fact))
    assert again.states == wired.states


# Lags of actuators and sensors.


HERTZ_ELEMENTS = 2000.0


@pytest.mark.parametrize("dt", [0, 1e-4])
@pytest.mark.parametrize(
    ("order", "damping"), [(None, None), (1, None), (2, None), (2, 0.3), (None, 1.5), (5, None)]
)
def test_the_gain_is_one_at_rest_and_3_db_less_at_the_bandwidth(order, damping, dt):
    system = lag(HERTZ_ELEMENTS, order, damping, dt)
    point = 2j * np.pi * HERTZ_ELEMENTS
    point = np.exp(point * dt) if dt else point
    assert abs(complex(system(point))) == pytest.approx(np.sqrt(0.5))
    assert complex(system(1.0 if dt else 0.0)) == pytest.approx(1.0)
    assert system.nstates == (order or (2 if damping else 1))


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
