"""Plant and controller as a loop: opened, closed, and what lies outside."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.loops.loop import loop_of
from tests.loops.loops_for_tests import TEXTBOOK, random_loop


def value(system, omega):
    return np.asarray(system(1j * omega)).reshape(system.noutputs or 1, -1)


@pytest.mark.parametrize("seed", range(3))
def test_opened_and_closed_loops_are_those_of_the_book(seed):
    plant, controller = random_loop(seed)
    loop = loop_of(plant, controller)
    for omega in (0.1, 1.0, 7.0):
        G, K, one = value(plant, omega), value(controller, omega), np.eye(2)
        np.testing.assert_allclose(value(loop.opened("input"), omega), -K @ G, rtol=1e-9)
        np.testing.assert_allclose(value(loop.opened("output"), omega), -G @ K, rtol=1e-9)
        S_in, S_out = np.linalg.inv(one - K @ G), np.linalg.inv(one - G @ K)
        whole = np.block([[S_in, S_in @ K], [G @ S_in, S_out]])
        np.testing.assert_allclose(value(loop.closed, omega), whole, rtol=1e-8, atol=1e-12)
        aside = np.block([[np.zeros((2, 2)), -K], [-G, np.zeros((2, 2))]])
        np.testing.assert_allclose(value(loop.side_by_side, omega), aside, rtol=1e-9)
        for place, S in (("input", S_in), ("output", S_out)):
            single = value(loop.opened(place, [1]), omega)[0, 0]
            assert single == pytest.approx(1 / S[1, 1] - 1, rel=1e-8)
            around = value(loop.around(loop.at(place), 2.0, 1.0), omega)
            np.testing.assert_allclose(around, 2 * S - one, rtol=1e-8, atol=1e-12)


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


def test_the_other_sign_is_known():
    loop = loop_of(TEXTBOOK, 1)
    assert not loop.stability
    assert loop.opposite_stability
