"""Runs of models with effects over samples."""

from dataclasses import replace

import control
import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import CubicSpline

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.linear.response import linear_response
from robustpolish.machines.simulation.run import (
    Stepper,
    build_system,
    lines,
    signals,
    simulate_model,
)

GROUND = ("x", "ground")
TIME = 2.0 + np.arange(600) * 1e-3
FORCE = np.sin(20 * TIME) ** 3
DATA = xr.Dataset({"F": ("time", FORCE)}, coords={"time": TIME})


def oscillator():
    return rp.MechanicalModel(
        [rp.Dof("x", 2.0)],
        [rp.Spring(GROUND, 800.0)],
        [rp.Damper(GROUND, 4.0)],
        [rp.Input("F", GROUND)],
        [rp.Output("x", GROUND)],
    )


def run_of(model):
    return Stepper(model, build_system(model, 1e-3), 1e-3, 1)


def test_without_effects_a_run_is_the_linear_response():
    exact = linear_response(oscillator().state_space(), TIME, FORCE[:, None], [0.01, 0.2])
    response = simulate_model(oscillator(), DATA, initial_state=[0.01, 0.2])
    np.testing.assert_allclose(response.outputs, exact.outputs, atol=1e-12)
    np.testing.assert_allclose(response.states, exact.states, atol=1e-12)


def test_a_run_is_led_by_what_was_measured():
    model = oscillator().with_effect("sensor_offset", "x", {"offset": 1.0})
    shown = simulate_model(model, DATA, initial_state=[0.01, 0.0]).outputs
    run, rest = run_of(model), np.zeros(2)
    free = run.over(FORCE[:, None], rest, np.zeros(0), TIME)
    led = run.over(FORCE[:, None], rest, np.zeros(0), TIME, shown, np.array([[0.3], [0.0]]))
    error = [np.abs(one.outputs - shown)[50:100].max() for one in (free, led)]
    assert error[1] < 0.2 * error[0]


def test_states_are_kept_on_request():
    short = run_of(oscillator()).over(FORCE[:, None], np.zeros(2), np.zeros(0), TIME, keep=False)
    assert short.outputs.shape == (600, 1)
    assert short.states.shape == (0, 2)


@pytest.mark.parametrize("order", [0.0, 3.0])
def test_an_accelerometer_sees_a_held_force_as_it_is(order):
    """As in discrete time: y[k] = C x[k] + D u[k], whatever the input does between the samples."""
    outputs = [rp.Output("a", GROUND, "acceleration"), rp.Output("x", GROUND)]
    model = replace(oscillator(), outputs=outputs)
    step = 4e-3
    time = np.arange(3000) * step
    lines = 2 * np.pi * np.geomspace(0.5, 30, 40)
    force = np.sin(np.multiply.outer(time, lines) + np.arange(40)).sum(axis=1)
    data = xr.Dataset({"F": ("time", force)}, coords={"time": time})
    held = model.with_effect("input_hold", "F", {"order": order})
    seen = simulate_model(held, data).outputs
    if order == 0.0:
        sampled = control.c2d(model.state_space(), step, "zoh")
        exact = control.forced_response(sampled, time, force).outputs.T
    else:  # smooth: interpolated by a spline, fifty times as fine
        fine = np.arange(50 * 2999 + 1) * step / 50
        smooth = CubicSpline(time, force)(fine)
        exact = linear_response(model.state_space(), fine, smooth[:, None]).outputs[::50]
    error = np.std(seen - exact, axis=0) / np.std(exact, axis=0)
    assert np.all(error[:2] < 2e-5)
    # of a linear interpolation neither is right
    plain = np.std(simulate_model(model, data).outputs - exact, axis=0) / np.std(exact, axis=0)
    assert plain[0] > 5 * error[0]


def test_a_led_run_of_a_held_force_predicts_what_was_measured():
    model = replace(oscillator(), outputs=[rp.Output("a", GROUND, "acceleration")])
    held = model.with_effect("input_hold", "F", {"order": 0.0})
    rough = np.random.default_rng(0).standard_normal(TIME.size)
    data = xr.Dataset({"F": ("time", rough)}, coords={"time": TIME})
    shown = simulate_model(held, data).outputs
    led = run_of(held).over(
        signals(held, data), np.zeros(2), np.zeros(0), TIME, shown, np.array([[1e-5], [0.0]]),
        lines=lines(held, data),
    )  # fmt: skip
    np.testing.assert_allclose(led.outputs, shown, atol=1e-12)


def test_a_start_of_another_size_is_refused():
    with pytest.raises(InvalidInputError, match="initial_state"):
        simulate_model(oscillator(), DATA, initial_state=[1.0])


def test_without_a_measured_displacement_the_run_itself_says_how_stiff_it_gets():
    model = oscillator().with_effect("cubic_stiffness", GROUND, {"stiffness": 1e9})
    fine = simulate_model(model, DATA, [0.05, 0.0], substeps=64).outputs
    chosen = simulate_model(model, DATA, [0.05, 0.0]).outputs
    rough = simulate_model(model, DATA, [0.05, 0.0], substeps=2).outputs
    assert np.max(np.abs(chosen - fine)) < 0.2 * np.max(np.abs(rough - fine))
