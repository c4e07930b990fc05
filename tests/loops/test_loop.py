"""Plant and controller as a loop: what users may give, opened, closed, over frequency."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.loops.loop import Loop, loop_of
from robustpolish.loops.performance import sensitivities
from tests.loops.loops_for_tests import SATELLITE, TEXTBOOK, random_loop, s


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
