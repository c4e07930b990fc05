"""Weights, and plants of mixed sensitivity."""

import warnings

import control
import numpy as np
import pytest

import robustpolish as rp

# Weights between two gains.


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


# Mixed sensitivity: responses by hand, python-control's gamma, numbers of textbooks.


OMEGA = np.array([0.0, 0.07, 1.3, 40.0])


def two_by_two():
    A = [[-1.0, 2.0, 0.0], [0.0, -3.0, 1.0], [0.0, 0.0, 0.5]]
    B, C = [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]], [[1.0, 0.0, 1.0], [0.0, 1.0, 0.0]]
    D = [[0.0, 0.0], [0.1, 0.0]]
    return control.ss(A, B, C, D, inputs=["F", "M"], outputs=["x", "phi"])


W1 = rp.weight(50.0, 0.05, 0.5)
W2 = control.tf([1.0, 1.0], [0.1, 10.0])
W3 = rp.weight(0.2, 2.0, 30.0)


def loop_by_hand(G, K, w1, w2, w3, s):
    """Return [W1 S; W2 K S; W3 G K S] with S = (I - G K)^-1."""
    g, k = np.atleast_2d(G(s)), np.atleast_2d(K(s))
    S = np.linalg.inv(np.eye(len(g)) - g @ k)
    return np.vstack([w1 @ S, w2 @ k @ S, w3 @ g @ k @ S])


def test_every_block_is_what_it_says():
    G, rng = two_by_two(), np.random.default_rng(0)
    K = control.ss([[-2.0]], rng.standard_normal((1, 2)), rng.standard_normal((2, 1)), -np.eye(2))
    plant = rp.mixed_sensitivity(G, performance=W1, effort=[W2, 0.3], robustness=W3)
    loop = plant.closed_loop(K)
    for w in OMEGA:
        s, one = 1j * w, np.eye(2)
        effort = np.diag([complex(W2(s)), 0.3])
        expected = loop_by_hand(G, K, W1(s) * one, effort, W3(s) * one, s)
        np.testing.assert_allclose(loop(s), expected, rtol=1e-9, atol=1e-12)


def test_channels_left_out_and_matrix_weights():
    G = two_by_two()
    full = control.ss(-np.eye(2), [[1.0, 2.0], [0.0, 1.0]], np.eye(2), [[0.0, 0.0], [0.5, 0.0]])
    plant = rp.mixed_sensitivity(G, performance=[W1, None], effort=full)
    assert plant.performance_names == ("performance_x", "effort_F", "effort_M")
    K = -np.array([[1.0, 0.2], [0.0, 0.7]])
    loop, gain = plant.closed_loop(K), control.ss([], [], [], K)
    for w in OMEGA:
        s = 1j * w
        by_hand = loop_by_hand(G, gain, W1(s) * np.eye(2), full(s), np.zeros((0, 2)), s)
        np.testing.assert_allclose(loop(s), by_hand[[0, 2, 3]], rtol=1e-9, atol=1e-12)


def test_names_and_units():
    G = rp.GeneralizedPlant(two_by_two(), 2, 2, units={"F": "N", "M": "N m", "x": "m"})
    plant = rp.mixed_sensitivity(G, 1.0, 2.0, [W3, None])
    assert plant.disturbance_names == ("reference_x", "reference_phi")
    assert plant.performance_names == (
        "performance_x", "performance_phi", "effort_F", "effort_M", "robustness_x",
    )  # fmt: skip
    assert (plant.control_names, plant.measurement_names) == (("F", "M"), ("x", "phi"))
    assert plant.units["reference_x"] == plant.units["robustness_x"] == plant.units["x"] == "m"
    assert plant.units["effort_M"] == "N m"
    assert "performance_phi" not in plant.units


def test_a_wired_plant_keeps_its_facts():
    G = rp.GeneralizedPlant(two_by_two(), 2, 2).with_actuator("F", 30.0, limit=4.0)
    G = G.with_delay("M", 0.01).with_sensor("x", noise=1e-3)
    plant = rp.mixed_sensitivity(G, performance=W1, robustness=W3)
    assert (dict(plant.limits), dict(plant.delays)) == ({"F": 4.0}, {"M": 0.01})
    inner, outer = G.frequency_response([2.0]), plant.frequency_response([2.0])
    weight = complex(W3(4j * np.pi))
    np.testing.assert_allclose(
        outer.sel(output="robustness_phi", input="M").values,
        weight * inner.sel(output="phi", input="M").values,
    )


def test_example_of_skogestad_and_postlethwaite():
    # Multivariable Feedback Control, example 2.17: gamma 1.37 for the first weight.
    s = control.tf("s")
    G = 200 / ((10 * s + 1) * (0.05 * s + 1) ** 2)
    plant = rp.mixed_sensitivity(G, performance=(s / 1.5 + 10) / (s + 10 * 1e-4), effort=1.0)
    design = rp.output_feedback(plant)
    assert design.certificate.valid
    assert design.certificate.achieved == pytest.approx(1.37, abs=0.005)
    # K of u = K y, against the book's negative feedback
    assert abs(complex((1 / (1 - control.tf(G) * control.ss(design.controller)))(1e-4j))) < 1e-3


@pytest.mark.parametrize(
    "kind", [kind if kind < 2 else pytest.param(kind, marks=pytest.mark.long) for kind in range(6)]
)
def test_gamma_is_that_of_python_control(kind):
    rng = np.random.default_rng(kind)
    np.random.seed(kind)  # noqa: NPY002, which is what control.rss draws from
    size = 1 + kind % 2
    G = control.rss(3, size, size, strictly_proper=True)
    one = np.eye(size)
    w1 = rp.weight(rng.uniform(5, 50), rng.uniform(0.02, 0.2), 0.3)
    wide = control.append(*[w1] * size)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # control.connect is deprecated, and used there
        _, _, (gamma, _) = control.mixsyn(G, wide, control.ss([], [], [], 0.2 * one), None)
    found = rp.output_feedback(rp.mixed_sensitivity(G, performance=w1, effort=0.2))
    assert found.certificate.achieved <= gamma * (1 + 5e-3)
    assert found.lower_bound >= gamma * (1 - 5e-3)


def test_discrete_time():
    G = control.ss([[0.9]], [[0.1]], [[1.0]], 0, 0.1)
    W = rp.weight(20.0, 0.3, 0.4, dt=0.1)
    design = rp.output_feedback(rp.mixed_sensitivity(G, performance=W, effort=0.1))
    assert design.certificate.valid
    with pytest.raises(rp.InvalidInputError, match=r"performance\[0\]: got sampling time 0"):
        rp.mixed_sensitivity(G, performance=rp.weight(20.0, 0.3, 0.4))


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({}, "performance: got no weight at all"),
        ({"performance": [W1]}, "performance: got 1 weights, expected 2, one per channel"),
        ({"effort": "W"}, "effort: got 'W'"),
        ({"effort": np.eye(3)}, "effort: got 3 inputs and 3 outputs, expected one of each, or 2"),
        ({"robustness": [W1, np.eye(2)]}, r"robustness\[1\]: got 2 inputs"),
        ({"robustness": control.tf([1, 0], [1])}, "robustness: got an improper"),
    ],
)
def test_bad_weights_are_named_of_mixed_sensitivity(given, told):
    with pytest.raises(rp.InvalidInputError, match=told):
        rp.mixed_sensitivity(two_by_two(), **given)


def test_bad_plants_are_named():
    with pytest.raises(rp.InvalidInputError, match="plant: got 0 controls and 2 measurements"):
        rp.mixed_sensitivity(rp.GeneralizedPlant(two_by_two(), 2, 0), 1.0)
    with pytest.raises(rp.InvalidInputError, match="plant: got 'G'"):
        rp.mixed_sensitivity("G", 1.0)
