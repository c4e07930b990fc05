"""Effects on inputs and outputs, those that users add among them."""

import itertools

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.machines.effects import effect as effect_module
from robustpolish.machines.effects.effect import register
from robustpolish.machines.effects.kind import EffectKind, Parameter
from robustpolish.machines.simulation.run import (
    lines,
    measured,
    raw_outputs,
    signals,
    simulate_model,
)

GROUND = ("x", "ground")
TIME = np.arange(400) * 1e-3


def oscillator(name="F", outputs=None):
    return rp.MechanicalModel(
        [rp.Dof("x", 2.0)],
        [rp.Spring(GROUND, 800.0)],
        [rp.Damper(GROUND, 4.0)],
        [rp.Input(name, GROUND)],
        outputs or [rp.Output("x", GROUND)],
    )


def push(*names):
    return xr.Dataset({n: ("time", np.sin(30 * TIME)) for n in names}, coords={"time": TIME})


@pytest.fixture
def catalogue(monkeypatch):
    monkeypatch.setattr(effect_module, "_registered", {})


@pytest.mark.parametrize("name", ["F", "F_dot", "F_ddot", "_dot"])
def test_the_name_of_an_input_takes_nothing_from_its_effects(name):
    model = oscillator(name)
    plain = simulate_model(model, push(name)).outputs
    tripled = simulate_model(model.with_effect("input_gain", name, {"gain": 3.0}), push(name))
    np.testing.assert_allclose(tripled.outputs, 3 * plain, rtol=1e-12)
    linear = model.with_effect("input_gain", name, {"gain": 3.0}).linearize()
    np.testing.assert_allclose(linear.B1, 3 * model.linearize().B1)


def test_an_effect_on_one_input_leaves_its_namesakes_alone():
    model = rp.MechanicalModel(
        [rp.Dof("x", 2.0)],
        [rp.Spring(GROUND, 800.0)],
        inputs=[rp.Input("F", GROUND), rp.Input("F_dot", GROUND)],
        outputs=[rp.Output("x", GROUND)],
    ).with_effect("input_gain", "F", {"gain": 3.0})
    W = signals(model, push("F", "F_dot"))
    np.testing.assert_array_equal(W[:, 0], 3 * W[:, 1])
    plant = model.linearize()
    np.testing.assert_allclose(plant.B1[:, 0], 3 * plant.B1[:, 1])


def test_derivatives_of_an_imposed_motion_follow_it(catalogue):
    model = rp.MechanicalModel(
        [rp.Dof("b", 0.0), rp.Dof("x", 1.0)],
        [rp.Spring(("b", "x"), 50.0)],
        inputs=[rp.Input("b_dot", ("b", "ground"), imposes="displacement")],
        outputs=[rp.Output("x", GROUND)],
    )
    data = push("b_dot")
    plain = signals(model, data)
    tripled = signals(model.with_effect("input_gain", "b_dot", {"gain": 3.0}), data)
    np.testing.assert_array_equal(tripled, 3 * plain)
    register(
        EffectKind(
            "zero_error",
            "Zero error",
            "input",
            (Parameter("shift", "L", "of the scale"),),
            on_signal=lambda u, time, values: u + values["shift"],
        )
    )
    shifted = signals(model.with_effect("zero_error", "b_dot", {"shift": 0.5}), data)
    np.testing.assert_allclose(shifted[:, 0], plain[:, 0] + 0.5)
    np.testing.assert_allclose(shifted[:, 1], plain[:, 1])  # a constant has no derivative


def test_a_kind_of_any_parameter_acts_on_inputs(catalogue):
    register(
        EffectKind(
            "lever",
            "Lever",
            "input",
            (Parameter("ratio", "1", "of the arms", default=1.0),),
            on_signal=lambda u, time, values: values["ratio"] * u,
        )
    )
    plain = simulate_model(oscillator(), push("F")).outputs
    model = oscillator().with_effect("lever", "F", {"ratio": 2.0})
    np.testing.assert_allclose(simulate_model(model, push("F")).outputs, 2 * plain, rtol=1e-12)
    np.testing.assert_allclose(model.linearize().B1, 2 * oscillator().linearize().B1)


def test_a_kind_of_any_parameter_acts_on_outputs(catalogue):
    register(
        EffectKind(
            "drift",
            "Drift of a sensor",
            "output",
            (Parameter("rate", "signal", "per second"),),
            on_signal=lambda u, time, values: u + values["rate"] * time,
        )
    )
    plain = simulate_model(oscillator(), push("F")).outputs
    model = oscillator().with_effect("drift", "x", {"rate": 0.1})
    shown = simulate_model(model, push("F")).outputs
    np.testing.assert_allclose(shown[:, 0], plain[:, 0] + 0.1 * TIME)
    np.testing.assert_allclose(raw_outputs(model, shown, TIME), plain, atol=1e-15)


def test_what_sensors_add_is_taken_out_again():
    outputs = [rp.Output("x", GROUND), rp.Output("v", GROUND, "velocity")]
    model = (
        oscillator(outputs=outputs)
        .with_effect("sensor_gain", "x", {"gain": -2.0})
        .with_effect("sensor_offset", "x", {"offset": 5.0})
    )
    Y = np.random.default_rng(1).standard_normal((TIME.size, 2))
    shown = measured(model, Y, TIME)
    np.testing.assert_allclose(shown[:, 0], 5.0 - 2.0 * Y[:, 0])
    np.testing.assert_array_equal(shown[:, 1], Y[:, 1])
    np.testing.assert_allclose(raw_outputs(model, shown, TIME), Y, atol=1e-14)


def test_a_sensor_that_bends_its_signal_is_simulated_but_not_taken_out(catalogue):
    register(
        EffectKind(
            "saturation",
            "Saturation",
            "output",
            (Parameter("limit", "signal", "largest value", default=1.0),),
            on_signal=lambda u, time, values: values["limit"] * np.tanh(u / values["limit"]),
        )
    )
    model = oscillator().with_effect("saturation", "x", {"limit": 0.5})
    Y = np.linspace(-0.4, 0.4, TIME.size)[:, None]
    assert np.max(np.abs(measured(model, 10 * Y, TIME))) < 0.5
    with pytest.raises(InvalidInputError, match=r"saturation\.on_signal"):
        raw_outputs(model, Y, TIME)


def test_what_a_hold_does_between_the_samples_is_not_what_is_there():
    data = push("F")
    plain, doubled = oscillator(), oscillator().with_effect("input_gain", "F", {"gain": 2.0})
    assert lines(plain, data) is None
    assert lines(doubled, data) is None
    held = doubled.with_effect("input_hold", "F", {"order": 0.0})
    force = 2.0 * data["F"].values[:, None]
    np.testing.assert_allclose(signals(held, data), force)
    begin, end = lines(held, data)
    np.testing.assert_allclose(begin, force)
    np.testing.assert_allclose(end, force)


def test_a_delay_moves_a_force_as_it_is_between_its_samples():
    data, step = push("F"), TIME[1] - TIME[0]
    late = oscillator().with_effect("input_delay", "F", {"delay": 1.25 * step})
    straight = np.interp(TIME - 1.25 * step, TIME, data["F"].values)
    np.testing.assert_allclose(signals(late, data)[:, 0], straight)
    held = late.with_effect("input_hold", "F", {"order": 0.0})
    np.testing.assert_allclose(signals(held, data)[2:, 0], data["F"].values[:-2])
    twice = held.with_effect("input_delay", "F", {"delay": 0.75 * step})
    np.testing.assert_allclose(lines(twice, data).begin[2:, 0], data["F"].values[:-2])


@pytest.mark.parametrize("order", [0.0, 1.0])
def test_a_lag_follows_its_input_as_that_is_between_the_samples(order):
    data, step = push("F"), TIME[1] - TIME[0]
    model = oscillator().with_effect("input_hold", "F", {"order": order})
    model = model.with_effect("input_lag", "F", {"lag": 3 * step})
    u, fine = data["F"].values, 400
    # u' = (F - u) / lag in steps of its own, F held or linear
    expected = [u[0]]
    for now, then in itertools.pairwise(u):
        here = expected[-1]
        for k in range(fine):
            driven = now + order * (then - now) * (k + 0.5) / fine
            here += (driven - here) * (1 - np.exp(-1 / (3 * fine)))
        expected.append(here)
    np.testing.assert_allclose(signals(model, data)[:, 0], expected, atol=1e-6 * np.max(np.abs(u)))
    assert lines(model, data) is None


def test_an_imposed_motion_is_smooth_and_late_with_its_derivatives():
    model = rp.MechanicalModel(
        [rp.Dof("b", 0.0), rp.Dof("x", 1.0)],
        [rp.Spring(("b", "x"), 50.0)],
        inputs=[rp.Input("b_dot", ("b", "ground"), imposes="displacement")],
        outputs=[rp.Output("x", GROUND)],
    )
    data, step = push("b_dot"), TIME[1] - TIME[0]
    late = model.with_effect("input_delay", "b_dot", {"delay": 3 * step})
    plain = signals(model, data)
    np.testing.assert_allclose(signals(late, data)[3:], plain[:-3], atol=1e-9 * np.max(plain))


def test_a_missing_column_is_named():
    with pytest.raises(InvalidInputError, match="no column 'F'"):
        signals(oscillator(), push("G"))


def test_an_imposed_motion_has_no_limit_that_its_velocity_would_not_know():
    model = rp.MechanicalModel(
        [rp.Dof("b", 0.0), rp.Dof("x", 1.0)],
        [rp.Spring(("b", "x"), 50.0)],
        [rp.Damper(("b", "x"), 1.0)],
        inputs=[rp.Input("b", ("b", "ground"), imposes="displacement")],
        outputs=[rp.Output("x", GROUND)],
    )
    doubled = signals(model.with_effect("input_gain", "b", {"gain": 2.0}), push("b"))
    np.testing.assert_allclose(doubled, 2 * signals(model, push("b")), rtol=1e-12)
    limited = model.with_effect("input_saturation", "b", {"limit": 0.5})
    with pytest.raises(InvalidInputError, match="an input that is a force"):
        signals(limited, push("b"))


def test_a_force_beyond_its_limit_does_not_come():
    data = push("F")
    limited = oscillator().with_effect("input_saturation", "F", {"limit": 0.5})
    np.testing.assert_allclose(signals(limited, data)[:, 0], np.clip(data["F"], -0.5, 0.5))
