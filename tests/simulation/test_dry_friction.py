"""Dry friction that stops, turns round and holds within a step, against closed forms."""

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.machines.simulation.run import simulate_model
from robustpolish.machines.simulation.stepper import friction_over_step

GROUND = ("x", "ground")
FORCE = 0.5
STEP = 1e-3
YIELDS = FORCE * STEP**2 / 12
"""What rests gives way by this at most, as to a spring: within a step the friction is constant."""


def slider(*more, stiffness=400.0, quantities=("displacement", "acceleration"), **friction):
    model = rp.MechanicalModel(
        [rp.Dof("x", 1.0)],
        [rp.Spring(GROUND, stiffness)] if stiffness else [],
        [],
        list(more),
        [rp.Output(f"y{i}", GROUND, quantity) for i, quantity in enumerate(quantities)],
    )
    return model.with_effect("coulomb_friction", GROUND, {"force": FORCE, **friction})


def over(time, **inputs):
    return xr.Dataset({k: ("time", v) for k, v in inputs.items()}, {"time": ("time", time)})


def test_a_body_that_slides_on_feels_what_it_felt():
    assert friction_over_step(2.0, 1.0, 0.5, -1.0, -1.5, 1.5) == (-1.0, 0.0, -1.0)


@pytest.mark.parametrize(
    ("begin", "free", "stops", "last"),
    [
        (0.2, 0.0, 0.2 / 0.7, 0.4),  # rests: 0.2 of speed go in a step, which 0.4 of force take
        (0.2, -3.0, 0.2 / 3.7, 1.5),  # turns round
        (0.0, 0.1, 0.0, -0.2),  # goes on resting
        (0.0, 1.0, 0.0, -1.5),  # gives way
        (0.0, -1.0, 0.0, 1.5),
    ],
)
def test_the_moment_at_which_a_body_stops(begin, free, stops, last):
    mean, change, at_last = friction_over_step(begin, free, 0.5, -1.0, -1.5, 1.5)
    assert at_last == pytest.approx(last)
    t = (np.arange(200000) + 0.5) / 200000
    force, stands_for = np.where(t < stops, -1.0, last), mean + change * (t - 0.5)
    assert np.mean(stands_for) == pytest.approx(np.mean(force), abs=1e-4)
    assert np.mean(stands_for * (1 - t)) == pytest.approx(np.mean(force * (1 - t)), abs=1e-4)


@pytest.mark.parametrize("substeps", [1, 4])
def test_a_decay_is_a_chain_of_half_swings_and_ends_at_rest(substeps):
    """Every half swing is a cosine about +-F/k; where F/k holds it stays, and nothing moves."""
    omega, offset, time = 20.0, FORCE / 400.0, np.arange(3000) * STEP
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
    assert np.max(np.abs(x[time <= FORCE])) < 1.01 * YIELDS
    after = np.maximum(time - FORCE, 0.0)
    np.testing.assert_allclose(x, after**3 / 6, atol=1e-5 * x[-1])
    np.testing.assert_allclose(a, after, atol=2 * STEP)


def test_a_body_that_is_held_at_the_first_sample_shows_no_acceleration():
    held = simulate_model(slider(), over(np.arange(50) * STEP), [0.9 * FORCE / 400.0, 0.0]).outputs
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
