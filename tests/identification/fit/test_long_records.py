"""Records of 500,000 samples: how many are kept, and that the numbers come out right."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
import xarray as xr
from scipy.signal import butter, sosfilt

import robustpolish as rp
from robustpolish.identification.fit.prepared import fastest_motion, needed_rate, reduce_record
from robustpolish.identification.observer.runs import InitialState, StartedPiece, free_run
from robustpolish.identification.policy import POLICY
from robustpolish.identification.record import record_of
from robustpolish.machines.simulation.run import simulate_model

RATE = 50e3
JOINT = ("a", "b")


def machine(quantity="displacement", friction=3.0, wrong=1.0):
    """Two masses with modes at 23.8 and 52.2 Hz, which rub on each other."""
    places = [("a", "ground"), ("a", "b")]
    model = rp.MechanicalModel(
        [rp.Dof("a", 2.0), rp.Dof("b", 1.0)],
        [rp.Spring(places[0], 8e4 * wrong), rp.Spring(places[1], 6e4 * wrong)],
        [rp.Damper(places[0], 8.0), rp.Damper(places[1], 4.0)],
        [rp.Input("F", ("a", "ground"))],
        [rp.Output(f"y_{name}", (name, "ground"), quantity) for name in "ab"],
    )
    return model.with_effect("coulomb_friction", JOINT, {"force": friction}) if friction else model


@lru_cache
def record(samples, quantity="displacement", top=100.0, noise=0.01, friction=3.0):
    """A smooth random force of `top` Hz, or a white one, at 50 kHz."""
    random = np.random.default_rng(0)
    time = np.arange(samples) / RATE
    force = random.standard_normal(samples)
    if top:
        force = sosfilt(butter(4, top, fs=RATE, output="sos"), force)
    data = xr.Dataset({"F": ("time", 60 * force / np.std(force), {"units": "N"})}, {"time": time})
    model = machine(quantity, friction)
    run = simulate_model(model, data)
    for name, y in zip(model.output_names, run.outputs.T, strict=True):
        data[name] = ("time", y + noise * np.std(y) * random.standard_normal(samples))
    return data, run.states


def fewer_of(samples, quantity="displacement", top=100.0, noise=0.01, **changes):
    model = machine(quantity)
    data, _ = record(samples, quantity, top, noise)
    return reduce_record(model, record_of(model, data), replace(POLICY, **changes))


def test_a_short_record_stays_as_it_is():
    model = machine()
    whole = record_of(model, record(20_000)[0])
    kept = reduce_record(model, whole, POLICY)
    assert kept.record is whole
    assert kept.model == model
    assert (kept.thinned, kept.notes) == (False, ())


@pytest.mark.parametrize(
    ("quantity", "least", "most"), [("displacement", 40, 46), ("acceleration", 200, 240)]
)
def test_a_smooth_motion_is_thinned_to_what_its_sensors_show(quantity, least, most):
    kept = fewer_of(100_000, quantity, few=500, longest=100_000, comfortable=1000)
    assert kept.thinned
    assert least <= 1 / kept.record.dt / 52.23 <= most
    assert "decimated from 50000" in kept.notes[0]
    assert kept.record.honest == 0.8
    assert fastest_motion(kept.model, kept.record) == pytest.approx(52.2, rel=0.1)


@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
def test_the_true_machine_explains_the_thinned_record(quantity):
    """Its friction jumps, and still it runs at the noise of the samples that are left."""
    kept = fewer_of(100_000, quantity, comfortable=20_000).record
    states = record(100_000, quantity)[1]
    start = InitialState(states[round(kept.time[0] * RATE)], np.zeros(0))
    errors = free_run(machine(quantity), kept).errors(StartedPiece(kept, start))
    noise = 0.01 * np.std(record(100_000, quantity)[0]["y_a"].values)
    left = noise * np.sqrt(1 / (kept.dt * RATE))
    assert 0.9 * left < np.std(errors[:, 0]) < 1.1 * left


def test_broad_forces_are_not_filtered_away():
    """Friction acts at every change of a fast velocity: a part of the record says more."""
    kept = fewer_of(100_000, top=None, noise=0.001, longest=30_000)
    assert not kept.thinned
    assert kept.record.dt == pytest.approx(1 / RATE)
    assert kept.record.samples == 30_000
    assert "30000 of 100000 samples" in kept.notes[0]
    assert kept.record.first == 0


def test_slow_modes_last_some_swings_in_a_part():
    """With a slow machine a part at the full rate would hold not one swing."""
    slow = machine(friction=0.0, wrong=1e-4)
    data, _ = record(100_000, top=None)
    rate = needed_rate(slow, record_of(slow, data), POLICY)
    assert rate < RATE / 4


def test_holds_of_inputs_belong_to_the_record_as_it_was():
    held = machine().with_effect("input_hold", ("F",), {"order": 0.0})
    data, _ = record(100_000)
    kept = reduce_record(held, record_of(held, data), POLICY)
    assert kept.thinned
    assert kept.model.effects[1].values == {"order": 1.0}
    fitted = kept.model.with_effect("constant_force", ("a",), {"force": 1.0})
    back = kept.with_original_holds(fitted)
    assert back.effects[1].values == {"order": 0.0}
    assert back.effects[2].kind == "constant_force"
    plain = reduce_record(machine(), record_of(machine(), data), POLICY)
    assert plain.with_original_holds(plain.model) == machine()
    # half a sample of 20 us late
    late = np.interp(kept.record.times - 1e-5, data["time"], data["F"])
    middle = slice(20, -20)
    np.testing.assert_allclose(
        kept.record.data["F"].values[middle], late[middle], atol=0.02 * np.std(late)
    )


@pytest.mark.long
@pytest.mark.parametrize(("top", "rough"), [(100.0, 0.01), (None, 0.03)])
def test_half_a_million_samples_are_diagnosed(top, rough):
    """In less than two minutes on two idle cores; here only what comes out is held."""
    data, _ = record(500_000, top=top)
    found = rp.diagnose(machine(friction=0.0, wrong=1.05), data)
    assert [(e.kind, e.at) for e in found.effects] == [("coulomb_friction", JOINT)]
    assert found.effects[0].parameters["force"].value == pytest.approx(3.0, rel=rough)
    assert found.model.parameters["spring[1].stiffness"] == pytest.approx(6e4, rel=rough)
    assert len(found.notes) == 1


@pytest.mark.long
def test_half_a_million_samples_are_fitted():
    data, _ = record(500_000)
    fitted = rp.refit(machine(friction=2.0, wrong=1.05), data)
    assert fitted.model.parameters["effect[0].force"] == pytest.approx(3.0, rel=0.01)
    assert "decimated from 50000" in fitted.notes[0]
