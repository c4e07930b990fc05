"""Runs of models with effects over samples."""

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.simulation import linear_response, simulate_model
from robustpolish.simulation.run import Stepper
from robustpolish.simulation.system import build_system

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


def test_a_start_of_another_size_is_refused():
    with pytest.raises(InvalidInputError, match="initial_state"):
        simulate_model(oscillator(), DATA, initial_state=[1.0])
