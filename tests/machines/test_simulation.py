"""Runs of mechanical models with their effects: steps, dry friction, signals between samples."""

import itertools
from dataclasses import replace

import control
import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import CubicSpline

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.linear.response import linear_response
from robustpolish.machines.effects import effect as effect_module
from robustpolish.machines.effects.effect import register
from robustpolish.machines.effects.kind import EffectKind, Parameter
from robustpolish.machines.simulation import lines, measured, raw_outputs, signals, simulate_model

# Runs of models with effects over samples.
GROUND = ("x", "ground")


def over(time, **inputs):
    return xr.Dataset({k: ("time", v) for k, v in inputs.items()}, {"time": ("time", time)})


TIME = 2.0 + np.arange(600) * 1e-3
FORCE = np.sin(20 * TIME) ** 3
DATA = over(TIME, F=FORCE)


def oscillator(name="F", outputs=None):
    return rp.MechanicalModel(
        [rp.Dof("x", 2.0)], [rp.Spring(GROUND, 800.0)], [rp.Damper(GROUND, 4.0)],
        [rp.Input(name, GROUND)], outputs or [rp.Output("x", GROUND)],
    )  # fmt: skip


def moved_base(name="b_dot"):
    return rp.MechanicalModel(
        [rp.Dof("b", 0.0), rp.Dof("x", 1.0)], [rp.Spring(("b", "x"), 50.0)],
        inputs=[rp.Input(name, ("b", "ground"), imposes="displacement")],
        outputs=[rp.Output("x", GROUND)],
    )  # fmt: skip


def test_without_effects_a_run_is_the_linear_response():
    exact = linear_response(oscillator().state_space(), TIME, FORCE[:, None], [0.01, 0.2])
    response = simulate_model(oscillator(), DATA, initial_state=[0.01, 0.2])
    np.testing.assert_allclose(response.outputs, exact.outputs, atol=1e-12)
    np.testing.assert_allclose(response.states, exact.states, atol=1e-12)


@pytest.mark.parametrize("order", [0.0, 3.0])
def test_an_accelerometer_sees_a_held_force_as_it_is(order):
    """As in discrete time: y[k] = C x[k] + D u[k], whatever the input does between the samples."""
    model = oscillator(outputs=[rp.Output("a", GROUND, "acceleration"), rp.Output("x", GROUND)])
    step = 4e-3
    time = np.arange(3000) * step
    lines = 2 * np.pi * np.geomspace(0.5, 30, 40)
    force = np.sin(np.multiply.outer(time, lines) + np.arange(40)).sum(axis=1)
    data = over(time, F=force)
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


def test_a_start_of_another_size_is_refused():
    with pytest.raises(InvalidInputError, match="initial_state"):
        simulate_model(oscillator(), DATA, initial_state=[1.0])


def test_without_a_measured_displacement_the_run_itself_says_how_stiff_it_gets():
    model = oscillator().with_effect("cubic_stiffness", GROUND, {"stiffness": 1e9})
    fine = simulate_model(model, DATA, [0.05, 0.0], substeps=64).outputs
    chosen = simulate_model(model, DATA, [0.05, 0.0]).outputs
    rough = simulate_model(model, DATA, [0.05, 0.0], substeps=2).outputs
    assert np.max(np.abs(chosen - fine)) < 0.2 * np.max(np.abs(rough - fine))


# Dry friction that stops, turns round and holds within a step, against closed forms.
FORCE_DRY_FRICTION = 0.5
STEP = 1e-3
YIELDS = FORCE_DRY_FRICTION * STEP**2 / 12
"""What rests gives way by this at most, as to a spring: within a step the friction is constant."""


def slider(*more, stiffness=400.0, quantities=("displacement", "acceleration"), **friction):
    model = rp.MechanicalModel(
        [rp.Dof("x", 1.0)],
        [rp.Spring(GROUND, stiffness)] if stiffness else [],
        [],
        list(more),
        [rp.Output(f"y{i}", GROUND, quantity) for i, quantity in enumerate(quantities)],
    )
    return model.with_effect("coulomb_friction", GROUND, {"force": FORCE_DRY_FRICTION, **friction})


@pytest.mark.parametrize("substeps", [1, 4])
def test_a_decay_is_a_chain_of_half_swings_and_ends_at_rest(substeps):
    """Every half swing is a cosine about +-F/k; where F/k holds it stays, and nothing moves."""
    omega, offset, time = 20.0, FORCE_DRY_FRICTION / 400.0, np.arange(3000) * STEP
    amplitude = 0.0123
    turns = int(np.ceil((amplitude / offset - 1) / 2))
    half = np.minimum((time * omega / np.pi).astype(int), turns)
    size, sign = amplitude - (2 * half + 1) * offset, np.where(half % 2, -1.0, 1.0)
    x = sign * (size * np.cos(omega * time - half * np.pi) + offset)
    rests = half == turns
    x[rests] = (1 if turns % 2 == 0 else -1) * (amplitude - 2 * turns * offset)
    seen = simulate_model(slider(), over(time), [amplitude, 0.0], substeps=substeps).outputs
    assert np.max(np.abs(seen[:, 0] - x)) < 1e-4 * amplitude
    assert np.ptp(seen[rests, 0][1:]) < 1e-9 * amplitude
    assert np.max(np.abs(seen[rests, 1][2:])) < 1e-6 * 400.0 * amplitude


def test_a_body_rests_until_the_force_exceeds_the_friction():
    time = np.arange(1000) * STEP
    model = slider(rp.Input("F", GROUND), stiffness=0.0)
    x, a = simulate_model(model, over(time, F=time), substeps=1).outputs.T
    assert np.max(np.abs(x[time <= FORCE_DRY_FRICTION])) < 1.01 * YIELDS
    after = np.maximum(time - FORCE_DRY_FRICTION, 0.0)
    np.testing.assert_allclose(x, after**3 / 6, atol=1e-5 * x[-1])
    np.testing.assert_allclose(a, after, atol=2 * STEP)


def test_a_body_that_is_held_at_the_first_sample_shows_no_acceleration():
    held = simulate_model(
        slider(), over(np.arange(50) * STEP), [0.9 * FORCE_DRY_FRICTION / 400.0, 0.0]
    ).outputs
    assert np.max(np.abs(held[:, 1])) < 1e-9


def test_frictions_hold_each_other():
    """A stack of two, pushed below: first all holds, then the lower slips, with the upper on it."""
    lower, upper = ("a", "ground"), ("b", "a")
    model = rp.MechanicalModel(
        [rp.Dof("a", 2.0), rp.Dof("b", 1.0)], [], [],
        [rp.Input("F", lower)], [rp.Output("a", lower), rp.Output("b", ("b", "ground"))],
    )  # fmt: skip
    model = model.with_effect("coulomb_friction", lower, {"force": 0.5})
    model = model.with_effect("coulomb_friction", upper, {"force": 1.0})
    time = np.arange(3000) * STEP
    a, b = simulate_model(model, over(time, F=time), substeps=2).outputs.T
    together = np.maximum(time - 0.5, 0.0) ** 3 / 6 / 3.0
    np.testing.assert_allclose(a, together, atol=1e-6 * together[-1])
    np.testing.assert_allclose(b, a, atol=1e-6 * together[-1])  # 1 kg at 0.83 m/s^2 is held by 1 N


def test_static_friction_is_what_has_to_be_overcome():
    model = slider(rp.Input("F", GROUND), stiffness=0.0).without_effects()
    model = model.with_effect(
        "stribeck_friction", GROUND, {"force": 0.5, "static_force": 0.8, "velocity": 0.01}
    )
    time = np.arange(1000) * STEP
    x = simulate_model(model, over(time, F=time), substeps=2).outputs[:, 0]
    assert np.max(np.abs(x[time < 0.8])) < 2 * YIELDS
    assert x[time > 0.85].min() > 1e-6


def test_a_width_that_steps_resolve_creeps():
    """A width that is given is kept: under a load the slider creeps at the speed that it says."""
    time = np.arange(400) * STEP
    model = slider(rp.Input("F", GROUND), stiffness=0.0, width=0.01)
    x = simulate_model(model, over(time, F=np.full(time.size, 0.25))).outputs[:, 0]
    assert (x[-1] - x[-101]) / 0.1 == pytest.approx(0.01 * np.arctanh(0.5), rel=1e-5)


def test_many_small_steps_that_hold_by_force_agree():
    """Two driven masses, against steps a hundred times smaller that only ask what holds."""
    model = rp.MechanicalModel(
        [rp.Dof("x", 1.0), rp.Dof("y", 0.5)],
        [rp.Spring(GROUND, 300.0), rp.Spring(("y", "x"), 200.0)],
        [rp.Damper(GROUND, 0.3)],
        [rp.Input("F", ("y", "ground"))],
        [rp.Output("x", GROUND), rp.Output("y", ("y", "ground"))],
    )  # fmt: skip
    time = np.arange(400) * 0.005
    force = 3.0 * np.sin(11 * time) + 2.0 * np.cos(29 * time)
    data = over(time, F=force)
    seen = simulate_model(
        model.with_effect("coulomb_friction", ("y", "x"), {"force": 1.0}), data
    ).outputs
    wanted = _held_by_force(model, force, 0.005, 1.0)
    assert np.max(np.abs(seen - wanted)) < 2e-3 * np.max(np.abs(wanted))


def _held_by_force(model, force, step, friction, count=400):
    """Euler steps, the friction of each being what would end the sliding, within its limit."""
    m = model.matrices
    h, q, v = step / count, np.zeros(2), np.zeros(2)
    rows, each = np.array([-1.0, 1.0]), 1 / np.diag(m.M)
    mobility, found = h * np.sum(each), [q]
    for k in range(len(force) - 1):
        for j in range(count):
            now = force[k] + (force[k + 1] - force[k]) * (j + 0.5) / count
            middle = q + h / 2 * v
            v = v + h * each * (m.B[:, 0] * now - m.K @ middle - m.C @ v)
            v = v + h * each * rows * np.clip(-(rows @ v) / mobility, -friction, friction)
            q = middle + h / 2 * v
        found.append(q)
    return np.array(found)


# Effects on inputs and outputs, those that users add among them.
TIME_SIGNALS = np.arange(400) * 1e-3


def push(*names):
    return over(TIME_SIGNALS, **{name: np.sin(30 * TIME_SIGNALS) for name in names})


@pytest.fixture
def offer(monkeypatch):
    """Register a kind of one parameter on a signal, for one test."""
    monkeypatch.setattr(effect_module, "_registered", {})

    def registered(name, domain, parameter, change):
        register(EffectKind(name, name, domain, (parameter,), on_signal=change))

    return registered


@pytest.mark.parametrize("name", ["F", "F_dot", "F_ddot", "_dot"])
def test_the_name_of_an_input_takes_nothing_from_its_effects(name):
    model = oscillator(name)
    plain = simulate_model(model, push(name)).outputs
    tripled = simulate_model(model.with_effect("input_gain", name, {"gain": 3.0}), push(name))
    np.testing.assert_allclose(tripled.outputs, 3 * plain, rtol=1e-12)
    linear = model.with_effect("input_gain", name, {"gain": 3.0}).linearize()
    np.testing.assert_allclose(linear.B1, 3 * model.linearize().B1)


def test_an_effect_on_one_input_leaves_its_namesakes_alone():
    inputs = [rp.Input("F", GROUND), rp.Input("F_dot", GROUND)]
    model = replace(oscillator(), inputs=inputs).with_effect("input_gain", "F", {"gain": 3.0})
    W = signals(model, push("F", "F_dot"))
    np.testing.assert_array_equal(W[:, 0], 3 * W[:, 1])
    plant = model.linearize()
    np.testing.assert_allclose(plant.B1[:, 0], 3 * plant.B1[:, 1])


def test_derivatives_of_an_imposed_motion_follow_it(offer):
    model, data = moved_base(), push("b_dot")
    plain = signals(model, data)
    tripled = signals(model.with_effect("input_gain", "b_dot", {"gain": 3.0}), data)
    np.testing.assert_array_equal(tripled, 3 * plain)
    shift = Parameter("shift", "L", "of the scale")
    offer("zero_error", "input", shift, lambda u, time, values: u + values["shift"])
    shifted = signals(model.with_effect("zero_error", "b_dot", {"shift": 0.5}), data)
    np.testing.assert_allclose(shifted[:, 0], plain[:, 0] + 0.5)
    np.testing.assert_allclose(shifted[:, 1], plain[:, 1])  # a constant has no derivative


def test_a_kind_of_any_parameter_acts_on_signals(offer):
    plain = simulate_model(oscillator(), push("F")).outputs
    ratio = Parameter("ratio", "1", "of the arms", default=1.0)
    offer("lever", "input", ratio, lambda u, time, values: values["ratio"] * u)
    model = oscillator().with_effect("lever", "F", {"ratio": 2.0})
    np.testing.assert_allclose(simulate_model(model, push("F")).outputs, 2 * plain, rtol=1e-12)
    np.testing.assert_allclose(model.linearize().B1, 2 * oscillator().linearize().B1)
    rate = Parameter("rate", "signal", "per second")
    offer("drift", "output", rate, lambda u, time, values: u + values["rate"] * time)
    model = oscillator().with_effect("drift", "x", {"rate": 0.1})
    shown = simulate_model(model, push("F")).outputs
    np.testing.assert_allclose(shown[:, 0], plain[:, 0] + 0.1 * TIME_SIGNALS)
    np.testing.assert_allclose(raw_outputs(model, shown, TIME_SIGNALS), plain, atol=1e-15)


def test_what_sensors_add_is_taken_out_again():
    outputs = [rp.Output("x", GROUND), rp.Output("v", GROUND, "velocity")]
    model = (
        oscillator(outputs=outputs)
        .with_effect("sensor_gain", "x", {"gain": -2.0})
        .with_effect("sensor_offset", "x", {"offset": 5.0})
    )
    Y = np.random.default_rng(1).standard_normal((TIME_SIGNALS.size, 2))
    shown = measured(model, Y, TIME_SIGNALS)
    np.testing.assert_allclose(shown[:, 0], 5.0 - 2.0 * Y[:, 0])
    np.testing.assert_array_equal(shown[:, 1], Y[:, 1])
    np.testing.assert_allclose(raw_outputs(model, shown, TIME_SIGNALS), Y, atol=1e-14)


def test_a_sensor_that_bends_its_signal_is_simulated_but_not_taken_out(offer):
    limit = Parameter("limit", "signal", "largest value", default=1.0)
    offer("saturation", "output", limit,
          lambda u, time, values: values["limit"] * np.tanh(u / values["limit"]))  # fmt: skip
    model = oscillator().with_effect("saturation", "x", {"limit": 0.5})
    Y = np.linspace(-0.4, 0.4, TIME_SIGNALS.size)[:, None]
    assert np.max(np.abs(measured(model, 10 * Y, TIME_SIGNALS))) < 0.5
    with pytest.raises(InvalidInputError, match=r"saturation\.on_signal"):
        raw_outputs(model, Y, TIME_SIGNALS)


def test_a_delay_moves_a_force_as_it_is_between_its_samples():
    data, step = push("F"), TIME_SIGNALS[1] - TIME_SIGNALS[0]
    late = oscillator().with_effect("input_delay", "F", {"delay": 1.25 * step})
    straight = np.interp(TIME_SIGNALS - 1.25 * step, TIME_SIGNALS, data["F"].values)
    np.testing.assert_allclose(signals(late, data)[:, 0], straight)
    held = late.with_effect("input_hold", "F", {"order": 0.0})
    np.testing.assert_allclose(signals(held, data)[2:, 0], data["F"].values[:-2])
    twice = held.with_effect("input_delay", "F", {"delay": 0.75 * step})
    np.testing.assert_allclose(lines(twice, data).begin[2:, 0], data["F"].values[:-2])


@pytest.mark.parametrize("order", [0.0, 1.0])
def test_a_lag_follows_its_input_as_that_is_between_the_samples(order):
    data, step = push("F"), TIME_SIGNALS[1] - TIME_SIGNALS[0]
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
    model = moved_base()
    data, step = push("b_dot"), TIME_SIGNALS[1] - TIME_SIGNALS[0]
    late = model.with_effect("input_delay", "b_dot", {"delay": 3 * step})
    plain = signals(model, data)
    np.testing.assert_allclose(signals(late, data)[3:], plain[:-3], atol=1e-9 * np.max(plain))


def test_a_missing_column_is_named():
    with pytest.raises(InvalidInputError, match="no column 'F'"):
        signals(oscillator(), push("G"))


def test_an_imposed_motion_has_no_limit_that_its_velocity_would_not_know():
    model = moved_base("b")
    doubled = signals(model.with_effect("input_gain", "b", {"gain": 2.0}), push("b"))
    np.testing.assert_allclose(doubled, 2 * signals(model, push("b")), rtol=1e-12)
    limited = model.with_effect("input_saturation", "b", {"limit": 0.5})
    with pytest.raises(InvalidInputError, match="an input that is a force"):
        signals(limited, push("b"))
