"""The response of mechanical models over frequency."""

import numpy as np
import pytest

import robustpolish as rp

PLACE = ("x", "ground")
LINES = np.array([0.1, 0.3, 0.5, 2.0])
S = 2j * np.pi * LINES


def oscillator(quantity="displacement", **changes):
    parts = {
        "dofs": [rp.Dof("x", 2.0)],
        "springs": [rp.Spring(PLACE, 8.0)],
        "dampers": [rp.Damper(PLACE, 0.4)],
        "inputs": [rp.Input("F", PLACE)],
        "outputs": [rp.Output("y", PLACE, quantity)],
    }
    return rp.MechanicalModel(**{**parts, **changes})


def receptance(stiffness=8.0, damping=0.4, mass=2.0):
    return 1 / (mass * S**2 + damping * S + stiffness)


@pytest.mark.parametrize(
    ("quantity", "order", "unit"),
    [("displacement", 0, "m/N"), ("velocity", 1, "m/s/N"), ("acceleration", 2, "m/s^2/N")],
)
def test_receptance_mobility_accelerance(quantity, order, unit):
    response = oscillator(quantity).frequency_response(LINES)
    np.testing.assert_allclose(response.values[:, 0, 0], receptance() * S**order, rtol=1e-12)
    assert response["units"].item() == unit


def test_effects_are_linearised_where_they_can_be():
    model = (
        oscillator()
        .with_effect("cubic_stiffness", PLACE, {"stiffness": 4.0})
        .with_effect("coulomb_friction", PLACE, {"force": 1.0})
    )
    response = model.frequency_response(LINES, operating_point={"x": 0.5})
    np.testing.assert_allclose(response.values[:, 0, 0], receptance(11.0), rtol=1e-6)
    assert "jumps at rest" in response.attrs["notes"][0]


def test_delays_gains_and_holds_of_inputs():
    model = (
        oscillator()
        .with_effect("input_delay", "F", {"delay": 0.2})
        .with_effect("sensor_gain", "y", {"gain": 3.0})
        .with_effect("input_hold", "F", {"order": 0.0})
    )
    expected = 3 * receptance() * np.exp(-0.2 * S)
    left_out = model.frequency_response(LINES)
    np.testing.assert_allclose(left_out.values[:, 0, 0], expected, rtol=1e-9)
    assert "sampling time" in left_out.attrs["notes"][0]
    held = model.frequency_response(LINES, sampling_time=0.1)
    factor = (1 - np.exp(-0.1 * S)) / (0.1 * S)
    np.testing.assert_allclose(held.values[:, 0, 0], expected * factor, rtol=1e-9)


def test_an_actuator_lags():
    model = oscillator().with_effect("input_lag", "F", {"lag": 0.3})
    response = model.frequency_response(LINES).values[:, 0, 0]
    np.testing.assert_allclose(response, receptance() / (1 + 0.3 * S), rtol=1e-9)


def test_a_relaxing_force_is_a_stiffness_over_frequency():
    values = {"stiffness": 5.0, "time": 0.4}
    model = oscillator().with_effect("maxwell_element", PLACE, values)
    expected = 1 / (1 / receptance() + 5.0 * 0.4 * S / (1 + 0.4 * S))
    np.testing.assert_allclose(model.frequency_response(LINES).values[:, 0, 0], expected, rtol=1e-6)


def test_an_attached_resonator_is_a_mode():
    model = oscillator().with_effect(
        "attached_resonator", "x", {"mass": 0.1, "stiffness": 1.0, "damping": 0.01}
    )
    pull = (1.0 + 0.01 * S) * 0.1 * S**2 / (0.1 * S**2 + 0.01 * S + 1.0)
    expected = 1 / (2 * S**2 + 0.4 * S + 8.0 + pull)
    np.testing.assert_allclose(model.frequency_response(LINES).values[:, 0, 0], expected, rtol=1e-6)


@pytest.mark.parametrize(("imposed", "order"), [("displacement", 0), ("velocity", 1)])
def test_imposed_motion_comes_with_its_derivatives(imposed, order):
    inputs = [rp.Input("b", ("base", "ground"), "displacement", gain=2.0)]
    if order:
        inputs.append(rp.Input("vb", ("base", "ground"), "velocity", gain=4.0))
    model = oscillator(
        dofs=[rp.Dof("x", 2.0), rp.Dof("base", 0.0)],
        springs=[rp.Spring(("x", "base"), 8.0)],
        dampers=[rp.Damper(("x", "base"), 0.4)],
        inputs=inputs,
    )
    transmitted = (8.0 + 0.4 * S) * receptance()
    response = model.frequency_response(LINES).sel(output="y")
    np.testing.assert_allclose(response.sel(input="b"), 2 * transmitted, rtol=1e-9)
    if order:
        np.testing.assert_allclose(response.sel(input="vb"), 4 * transmitted / S, rtol=1e-9)


def test_a_line_on_an_undamped_pole_is_nan():
    free = oscillator(springs=[], dampers=[])
    response = free.frequency_response([0.0, 1.0]).values[:, 0, 0]
    assert np.isnan(response[0])
    assert response[1] == pytest.approx(-1 / (2 * (2 * np.pi) ** 2))


def test_what_is_refused():
    with pytest.raises(rp.InvalidInputError, match="one of each"):
        oscillator(inputs=[]).frequency_response(LINES)
    with pytest.raises(rp.InvalidInputError, match="finite numbers"):
        oscillator().frequency_response([np.nan])


def test_a_sensor_that_sees_a_sum_of_coordinates():
    ground = ("z", "ground")
    model = oscillator(
        dofs=[rp.Dof("x", 2.0), rp.Dof("z", 1.0)],
        springs=[rp.Spring(PLACE, 8.0), rp.Spring(ground, 3.0)],
        dampers=[rp.Damper(PLACE, 0.4), rp.Damper(ground, 0.1)],
        inputs=[rp.Input("F", PLACE), rp.Input("G", ground)],
        outputs=[rp.Output("tip", ("x", "z"), weights=(0.8, -0.3))],
    )
    response = model.frequency_response(LINES)
    expected = np.column_stack([0.8 * receptance(), -0.3 * receptance(3.0, 0.1, 1.0)])
    np.testing.assert_allclose(response.values[:, 0], expected, rtol=1e-12)
