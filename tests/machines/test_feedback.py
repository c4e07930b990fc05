"""Machines in the loops of sampled controllers, against a second integrator with loops by hand."""

from dataclasses import replace

import control
import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.machines.simulation import simulate_model
from robustpolish.simulation import Feedback, FeedbackTerm

M, C, K3 = 2.0, 3.0, 30.0
T = 0.01
"""A slide with a hardening spring, and the period of its controller."""

FILE = """
[dof.x]
mass = 2.0
[[damper]]
between = ["x", "ground"]
damping = 3.0
[[input]]
name = "F"
force_on = "x"
[[output]]
name = "x"
measures = "x"
[feedback]
drives = "F"
period = 0.01
limit = 8.0
unknown = ["limit", "x.gain"]
[[feedback.term]]
of = "x"
gain = 60.0
derivative = 9.0
lag = 0.02
reference = "r"
"""


def slide(*loops):
    model = rp.MechanicalModel(
        [rp.Dof("x", M)], dampers=[rp.Damper(("x", "ground"), C)],
        inputs=[rp.Input("F", "x"), rp.Input("d", "x")],
        outputs=[rp.Output("x", "x"), rp.Output("v", "x", "velocity")],
    ).with_effect("cubic_stiffness", "x", {"stiffness": K3})  # fmt: skip
    return replace(model, feedback=loops)


def drives(dt, seconds=4.0):
    t = np.arange(round(seconds / dt) + 1) * dt
    step = np.where(t > 0.5, 0.3, 0.0)
    return xr.Dataset({"r": ("time", step), "d": ("time", np.sin(3 * t))}, {"time": t})


def by_hand(law, delay, data):
    """Integrate the slide piece by piece; `law(k, reference, x, v)` gives the k-th command."""
    t, r = data.time.values, data.r.values
    state, acts, waiting = np.zeros(2), 0.0, []
    found = np.full((t.size, 2), np.nan)
    found[0] = 0.0
    for k in range(round(t[-1] / T)):
        now, end = k * T, (k + 1) * T
        waiting.append((now + delay, law(k, np.interp(now, t, r), *state)))
        while now < end - 1e-12:
            while waiting and waiting[0][0] <= now + 1e-12:
                acts = waiting.pop(0)[1]
            stop = min([end, *(at for at, _ in waiting if at > now + 1e-12)])
            inside = t[(t > now + 1e-12) & (t < stop + 1e-12)]

            def slope(at, s, u=acts):
                return [s[1], (u + np.interp(at, t, data.d) - C * s[1] - K3 * s[0] ** 3) / M]

            grid = np.unique(np.clip([*inside, stop], now, stop))
            run = solve_ivp(slope, (now, stop), state, "DOP853", grid, rtol=1e-10, atol=1e-12)
            for at, s in zip(run.t, run.y.T, strict=True):
                if np.min(np.abs(t - at)) < 1e-9:
                    found[np.argmin(np.abs(t - at))] = s
            now, state = stop, run.y[:, -1]
    return found


def pid(kp=60.0, ki=80.0, kd=9.0, lag=0.02, limit=np.inf, rise=np.inf):
    """Tustin's rule, and a sum that moves at limits as if the error had been another (Hanus)."""
    a, b = (2 * lag - T) / (2 * lag + T), 2 * kd / (2 * lag + T)
    gain = kp + ki * T / 2 + b
    memory = {"sum": 0.0, "slope": 0.0, "last": 0.0}

    def law(k, r, x, v):
        m, e = memory, r - x
        wanted = gain * e + m["sum"] + m["slope"]
        given = np.clip(wanted, m["last"] - rise, m["last"] + rise)
        given = float(np.clip(given, -limit, limit))
        m["sum"] += ki * T * (e + (given - wanted) / gain)
        m["slope"] = a * (m["slope"] + b * e) - b * e
        m["last"] = given
        return given

    return law


TERM = FeedbackTerm("x", 60.0, 80.0, 9.0, 0.02, "r")


@pytest.mark.parametrize("dt", [0.0025, 0.01, 0.02])  # records finer, as fine, and coarser
@pytest.mark.parametrize("delay", [0.0, 0.0134])
@pytest.mark.parametrize("limits", [{}, {"limit": 8.0, "rate_limit": 400.0}])
def test_loops_agree_with_a_second_integrator(dt, delay, limits):
    data = drives(dt)
    found = simulate_model(slide(Feedback("F", T, [TERM], delay, **limits)), data)
    law = pid(limit=limits.get("limit", np.inf), rise=T * limits.get("rate_limit", np.inf))
    wanted = by_hand(law, delay, data)
    assert np.max(np.abs(found.outputs - wanted), initial=0) < 2e-5
    if limits and dt <= T:
        assert np.max(np.abs(found.commands)) == 8.0


def test_a_velocity_loop_inside_a_position_loop():
    inner = Feedback("F", T, [FeedbackTerm("v", 20.0, reference="wanted")], limit=5.0)
    outer = Feedback("wanted", 2 * T, [FeedbackTerm("x", 4.0, reference="r")], limit=0.2)
    data, kept = drives(T), {}

    def law(k, r, x, v):
        if k % 2 == 0:
            kept["wanted"] = np.clip(4.0 * (r - x), -0.2, 0.2)
        return float(np.clip(20.0 * (kept["wanted"] - v), -5.0, 5.0))

    model = slide(inner, outer)  # the outer one acts first, whatever their order
    assert model.columns == ("d", "r")
    found = simulate_model(model, data).outputs
    np.testing.assert_allclose(found, by_hand(law, 0.0, data), atol=1e-6)


def test_converters_round_and_columns_are_added():
    coarse = Feedback(
        "F", T, [FeedbackTerm("x", 60.0, quantum=0.02)], quantum=0.5, feedforward=["r"]
    )
    data = drives(T)

    def law(k, r, x, v):
        return 0.5 * np.floor((r - 60.0 * 0.02 * np.floor(x / 0.02 + 0.5)) / 0.5 + 0.5)

    found = simulate_model(slide(coarse), data)
    np.testing.assert_allclose(found.outputs, by_hand(law, 0.0, data), atol=1e-6)
    assert set(np.unique(found.commands)) <= set(0.5 * np.arange(-20, 21))


def test_actuators_and_sensors_with_effects():
    model = slide(Feedback("F", T, [FeedbackTerm("x", 60.0, reference="r")]))
    model = model.with_effect("input_gain", "F", {"gain": 0.5})
    model = model.with_effect("input_saturation", "F", {"limit": 4.0})
    model = model.with_effect("input_delay", "F", {"delay": 0.004})
    model = model.with_effect("sensor_gain", "x", {"gain": 2.0})
    model = model.with_effect("sensor_offset", "x", {"offset": 0.05})
    data = drives(T)

    def law(k, r, x, v):
        return float(np.clip(0.5 * 60.0 * (r - 2.0 * x - 0.05), -4.0, 4.0))

    found, wanted = simulate_model(model, data).outputs, by_hand(law, 0.004, data)
    np.testing.assert_allclose(found[:, 0], 2.0 * wanted[:, 0] + 0.05, atol=2e-5)


def test_a_linear_loop_is_its_state_space():
    """Discretised exactly, and closed by a matrix product."""
    machine = slide().without_effects()
    loop = Feedback("F", T, [FeedbackTerm("x", 60.0, reference="r"), FeedbackTerm("v", 5.0)])
    data = drives(T).assign(d=("time", np.zeros(401)))
    A, B, *_ = machine.matrices.first_order()
    plant = control.c2d(control.ss(A, B[:, :1], np.eye(2), 0), T)
    closed = plant.A - plant.B @ np.array([[60.0, 5.0]])
    states = np.zeros((401, 2))
    for k in range(400):
        states[k + 1] = closed @ states[k] + plant.B[:, 0] * 60.0 * data.r.values[k]
    found = simulate_model(replace(machine, feedback=(loop,)), data).outputs
    np.testing.assert_allclose(found, states, atol=1e-12)


def test_a_model_file_keeps_its_loops():
    model = rp.MechanicalModel.from_toml(FILE)
    assert model.columns == ("r",)
    assert model.driven == ("F",)
    changed = model.with_parameters({"feedback[0].x.gain": 50.0, "feedback[0].limit": 3.0})
    assert changed.feedback[0].terms[0].gain == 50.0
    assert changed.feedback[0].limit == 3.0
    assert rp.MechanicalModel.from_toml(changed.to_toml()) == changed
    several = slide(
        Feedback("F", T, [TERM], matrices=([[0.5]], [[1.0]], [[2.0]], [[3.0]]), limit=(-1.0, 2.0)),
        Feedback("d", T, [FeedbackTerm("v", numerator=(1.0,), denominator=(0.1, 1.0))]),
    )
    assert rp.MechanicalModel.from_toml(several.to_toml()) == several


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("period = 0.01", "", r"line 13: feedback\[0\].period: got no period"),
        ("period = 0.01", "period = -1", r"line 15: feedback\[0\].period: got -1"),
        ('["limit", "x.gain"]', '["x.size"]', "line 17: .*unknown: got 'x.size'"),
        ('drives = "F"', 'drives = "G"', "line 14: .*drives: got 'G', expected one of 'F'"),
        ('reference = "r"', 'reference = "x"', "'x', an output of the machine"),
        ('reference = "r"', 'reference = "F"', "circle: F, expected no algebraic loop"),
        ("gain = 60.0", "gian = 60.0", "gian: got an unknown key.*Write gain"),
        ("limit = 8.0", "limit = [3, 1]", "low < high"),
        ("limit = 8.0", 'controller = "no.json"', "unknown key|no.json"),
    ],
)
def test_bad_loops_are_refused(old, new, says):
    with pytest.raises(InvalidInputError, match=says):
        rp.MechanicalModel.from_toml(FILE.replace(old, new))


def test_what_does_not_suit_a_loop_is_refused():
    model = rp.MechanicalModel.from_toml(FILE)
    with pytest.raises(InvalidInputError, match="'F', which loop 0 drives already"):
        replace(model, feedback=model.feedback * 2)
    odd = replace(model.feedback[0], period=0.01 * np.pi)
    with pytest.raises(InvalidInputError, match="Resample the record, or correct the period"):
        simulate_model(replace(model, feedback=(odd,)), drives(T))
    with pytest.raises(InvalidInputError, match=r"got 'y', expected one of 'x', 'v'.*nothing else"):
        slide(Feedback("F", T, [FeedbackTerm("y")]))
    with pytest.raises(InvalidInputError, match="no column 'r'"):
        simulate_model(model, drives(T)[["d"]])
