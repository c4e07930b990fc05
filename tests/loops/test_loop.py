"""Plant and controller as a loop: what users may give, opened, closed, over frequency."""

from typing import Any

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.loops.loop import Loop, loop_of
from robustpolish.loops.performance import sensitivities
from tests.loops.loops_for_tests import SATELLITE, TEXTBOOK, random_loop, s, textbook


def test_everything_that_is_a_plant_and_a_controller():
    design = rp.given_controller(
        rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]]), [[-3.0]]
    )
    for plant, controller in [
        (design, None),
        (design.plant, design.controller),
        (design.plant, design),
        (control.ss([[1.0]], [[1.0]], [[1.0]], 0), -3),
        (control.tf([1], [1, -1]), control.tf([-3], [1])),
        (control.tf([1], [1, -1]), [[-3.0]]),
        (control.ss([[1.0]], [[1.0]], [[1.0]], 0, None), np.array(-3.0)),
    ]:
        loop = loop_of(plant, controller)
        assert isinstance(loop, Loop)
        np.testing.assert_allclose(loop.rates, [-2.0])


@pytest.mark.parametrize(
    ("plant", "controller", "message"),
    [
        (TEXTBOOK, None, "controller: got None"),
        (3.0, -1, "plant: got float"),
        (TEXTBOOK, control.frd(TEXTBOOK, np.logspace(-1, 1, 9)), "FrequencyResponseData"),
        (s, -1, "improper"),
        (TEXTBOOK, -s, "improper"),
        (TEXTBOOK, [[1.0, 2.0]], r"shape \(1, 2\)"),
        (TEXTBOOK, np.nan, "finite"),
        (TEXTBOOK, "K", "real matrix"),
        (SATELLITE, -1, r"\(2, 2\)"),
        (SATELLITE, control.ss([[-1.0]], [[1.0]], [[1.0]], 0), "1 inputs and 1 outputs"),
        (TEXTBOOK, control.tf([1], [1, -0.5], 0.1), "discrete time with a step of 0.1 s"),
        (control.tf([1], [1, -0.5], 0.1), control.tf([1], [1, 1]), "continuous time"),
        (control.tf([1], [1, -0.5], 0.1), control.ss([[0.5]], [[1.0]], [[1.0]], 0, 0.2), "0.2 s"),
        (control.ss([], [], [], [[1.0]]), 1, "singular"),
        (rp.GeneralizedPlant(SATELLITE, measurements=0, controls=1), -1, "at least one"),
    ],
)
def test_bad_input_is_told(plant, controller, message):
    with pytest.raises(rp.InvalidInputError, match=message):
        loop_of(plant, controller)


def test_a_design_brings_its_controller_and_a_gain_of_states_is_known():
    plant = rp.GeneralizedPlant.from_matrices(
        [[0, 1.0], [-4, -0.4]], [[0], [1.0]], [[0], [1.0]], [[1.0, 0]], [[1.0, 0]]
    )
    design = rp.given_controller(plant, [[-1.0]])
    with pytest.raises(rp.InvalidInputError, match="design alone"):
        loop_of(design, -1)
    with pytest.raises(rp.InvalidInputError, match="with_full_state"):
        loop_of(plant, [[-1.0, -2.0]])


def value(system, omega):
    return np.asarray(system(1j * omega)).reshape(system.noutputs or 1, -1)


def test_feedthrough_on_both_sides():
    plant = control.ss([[-1.0]], [[1.0]], [[2.0]], [[0.5]])
    controller = control.ss([[-3.0]], [[1.0]], [[-4.0]], [[-0.7]])
    loop = loop_of(plant, controller)
    G, K = value(plant, 2.0), value(controller, 2.0)
    np.testing.assert_allclose(value(loop.opened("input"), 2.0), -K * G)
    np.testing.assert_allclose(value(loop.closed, 2.0)[0, 0], 1 / (1 - K * G)[0, 0])
    assert np.sort(loop.stability.poles) == pytest.approx(
        np.sort(control.feedback(plant, controller, 1).poles())
    )


def test_names_and_units_are_those_of_the_plant():
    design = rp.given_controller(
        rp.air_bearing().with_full_state(), np.zeros((6, 12))
    )  # stable by itself
    loop = loop_of(design, None)
    assert loop.names("input")[:2] == ("u_x_m", "u_x")
    assert loop.closed.input_labels[6] == loop.names("output")[0] == "measured_x_m"
    assert (loop.unit("measured_x_m"), loop.unit("noise_measured_x"), loop.unit("F_x")) == (
        "m", "m", "N",
    )  # fmt: skip
    assert loop.unit("nobody") == ""


def test_what_no_control_reaches_lies_outside():
    plant = rp.GeneralizedPlant.from_matrices(
        [[-1.0, 0.0], [1.0, 0.0]], [[1.0], [0.0]], [[1.0], [0.0]], [[0.0, 1.0]], [[1.0, 0.0]],
        states=["x", "weight"],
    )  # fmt: skip
    loop = loop_of(plant, -1)
    assert (loop.inside, loop.outside) == ((0,), ("weight",))
    assert loop.outside_stability.verdict == "marginal"
    assert loop.stability
    assert not loop_of(TEXTBOOK, -1).outside


def test_they_fit_together():
    plant, controller = random_loop(1)
    loop = loop_of(plant, controller)
    G, K = (np.asarray(system(2j)) for system in (plant, controller))
    for place, L in (("input", -K @ G), ("output", -G @ K)):
        at = sensitivities(loop, place)
        S = np.linalg.inv(np.eye(2) + L)
        np.testing.assert_allclose(at.L(2j), L, rtol=1e-9)
        np.testing.assert_allclose(at.S(2j), S, rtol=1e-8)
        np.testing.assert_allclose(at.T(2j), L @ S, rtol=1e-8)
        np.testing.assert_allclose(at.KS(2j), K @ np.linalg.inv(np.eye(2) - G @ K), rtol=1e-8)
        np.testing.assert_allclose(at.GS(2j), G @ np.linalg.inv(np.eye(2) - K @ G), rtol=1e-8)
        assert at.KS.input_labels == list(loop.names("output"))
        assert at.KS.output_labels == list(loop.names("input"))
        peak = at.peaks["S"]
        gains = [np.linalg.norm(at.S(1j * w), 2) for w in np.geomspace(0.01, 100, 200)]
        assert max(gains) <= peak.upper
        assert peak.value == pytest.approx(max(gains), rel=0.01)


# Exact delays of the plant: margins by hand, where Pade models err, and against long ones.


def late(tau, order=3):
    system: Any = control.tf(TEXTBOOK, inputs="u", outputs="y")
    return rp.GeneralizedPlant.from_loop(system).with_delay("u", tau, order=order)


@pytest.mark.parametrize("tau", [0.2, 0.75])
def test_delay_and_delay_margin_add_up(tau):
    free, delayed = textbook(), rp.loop_analysis(late(tau), -1)
    assert delayed.delay_margin + tau == pytest.approx(free.delay_margin, rel=1e-9)
    omega = 2 * np.pi * free.margins[0].gain_crossovers[0].frequency_hz
    lost = np.degrees(omega * tau)
    assert delayed.phase_margin == pytest.approx(free.phase_margin - lost, rel=1e-9)
    assert "are exact in stability" in delayed.explain()
    assert delayed.sample_rate is not None
    assert delayed.sample_rate.rules["fastest closed-loop pole"] < 10


def test_a_delay_beyond_the_margin_is_unstable():
    found = rp.loop_analysis(late(0.77), -1)
    assert not found.stable
    assert "with exact delays unstable: 2 roots" in found.explain()


def test_an_integrator_with_delay_by_hand():
    # k exp(-s T)/s: phase -180 degrees at pi/(2 T), so the gain may reach pi/(2 T k).
    integrator: Any = control.tf([1], [1, 0], inputs="u", outputs="y")
    plant = rp.GeneralizedPlant.from_loop(integrator)
    k, T = 0.7, 0.9
    found = rp.loop_analysis(plant.with_delay("y", T, order=2), -k)
    assert found.gain_margin[1] == pytest.approx(np.pi / (2 * T * k), rel=1e-9)
    assert found.delay_margin == pytest.approx(np.pi / (2 * k) - T, rel=1e-9)
    omega = np.linspace(1e-3, 20, 400_000)
    L = k * np.exp(-1j * omega * T) / (1j * omega)
    assert found.modulus_margin == pytest.approx(np.abs(1 + L).min(), rel=1e-6)
    alpha = 2 / np.abs((1 - L) / (1 + L)).max()
    assert found.disk_margin.alpha == pytest.approx(alpha, rel=1e-6)
    assert not found.disk_margin.proven


@pytest.mark.parametrize("T", [1e-3, 0.9, 40.0])
@pytest.mark.parametrize("order", [1, 3, 8])
def test_no_crossing_is_left_out_up_to_where_they_are_said_to_be_all(T, order):
    # k exp(-s T)/s is negative at (4 n + 1) pi/(2 T), and above 1/1000 up to 1000 k.
    integrator: Any = control.tf([1], [1, 0], inputs="u", outputs="y")
    plant = rp.GeneralizedPlant.from_loop(integrator).with_delay("u", T, order=order)
    k = min(0.5, 0.7 / T)
    margins = rp.loop_analysis(plant, -k).margins[0]
    last = margins.complete_to_hz
    assert last >= min(1e3 * k / (2 * np.pi), 499 / T)
    want = (np.arange(int(last * T) + 2) + 0.25) / T
    found = [c.frequency_hz for c in margins.phase_crossovers]
    np.testing.assert_allclose(found, want[want <= last], rtol=1e-9)
    assert f"up to {last:.4g} Hz" in str(margins)


def test_a_model_too_coarse_is_told():
    # A lag with much gain and a delay of many of its time constants: order 1 errs.
    lag: Any = control.tf([3.0], [1, 1], inputs="u", outputs="y")
    plant = rp.GeneralizedPlant.from_loop(lag)
    verdicts = {}
    # Stable up to (pi - arctan(sqrt(8)))/sqrt(8) = 0.6755 s.
    for tau in (0.6, 0.67, 0.9):
        found = rp.loop_analysis(plant.with_delay("u", tau, order=1), -1)
        exact = rp.linear.delay_stability(plant.with_delay("u", tau).delayed_loop([[-1.0]]))
        verdicts[tau] = (bool(exact), found.stable)
        if exact and not found.stable:
            assert "higher order=" in found.explain()
    assert verdicts[0.9] == (False, False)
    assert verdicts[0.6] == (True, True)


@pytest.mark.long
def test_several_loops_agree_with_long_pade_models():
    system, K = random_loop(5)
    controller: Any = K
    names = {"inputs": ["u1", "u2"], "outputs": ["y1", "y2"]}
    named: Any = control.ss(system, **names)
    plant = rp.GeneralizedPlant.from_loop(named)
    taus = (0.002, 0.005)
    exact, model = plant, plant
    for name, tau in zip(("u1", "y2"), taus, strict=True):
        exact, model = exact.with_delay(name, tau), model.with_delay(name, tau, order=6)
    one, other = (
        rp.loop_analysis(exact, controller),
        rp.loop_analysis(model.without_delays(), controller),
    )
    for ours, theirs in zip(one.margins, other.margins, strict=True):
        assert ours.phase_deg == pytest.approx(theirs.phase_deg, rel=1e-6)
        assert ours.disk.alpha == pytest.approx(theirs.disk.alpha, rel=1e-5)
        assert ours.gain_up == pytest.approx(theirs.gain_up, rel=1e-5)
    for ours, theirs in zip(one.bandwidths, other.bandwidths, strict=True):
        assert ours.peak_s == pytest.approx(theirs.peak_s, rel=1e-5)


def test_values_of_the_loop():
    gain: Any = control.ss([], [], [], [[-1.0]])
    loop = Loop(late(0.3), gain)
    omega = np.array([0.5, 3.0])
    L = TEXTBOOK(1j * omega) * np.exp(-0.3j * omega)
    np.testing.assert_allclose(loop.response("input").scalar(omega), L)
    S = loop.response_around([0])
    np.testing.assert_allclose(S.scalar(omega), 1 / (1 + L))
    assert S.scalar(np.inf)[0] == pytest.approx(1)
    assert Loop(late(0.0), gain).delayed is None
