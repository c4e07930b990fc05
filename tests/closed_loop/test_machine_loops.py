"""Machines with their effects in the loops of sampled controllers."""

import json
import time as clock

import numpy as np
import pytest
import xarray as xr
from click.testing import CliRunner

import robustpolish as rp
from robustpolish.app.cli.main import main
from robustpolish.errors import InvalidInputError, SolverError
from robustpolish.simulation import Feedback, FeedbackTerm

PERIOD = 1e-3


@pytest.fixture(scope="module")
def machine():
    return rp.MechanicalModel(
        [rp.Dof("x", 2.0)],
        [rp.Spring(("x", "ground"), 800.0)],
        [rp.Damper(("x", "ground"), 4.0)],
        [rp.Input("F", "x")],
        [rp.Output("x", "x")],
    )


@pytest.fixture(scope="module")
def sampled(machine):
    plant = machine.linearize(controls=["x"], measured="state").with_actuator("u_x", limit=3.0)
    design = rp.state_feedback(plant, control_weight=1e-3)
    return design.discretize(PERIOD, delay=0.4e-3)


def push(size=8.0, samples=2001, step=PERIOD):
    force = np.where(np.arange(samples) > 20, size, 0.0)
    return xr.Dataset({"F": ("time", force, {"units": "N"})}, {"time": step * np.arange(samples)})


@pytest.mark.parametrize("size", [1.0, 40.0])  # within its limits, and beyond
def test_a_linear_machine_runs_as_the_sampled_design_has_it(machine, sampled, size):
    load = push(size)
    found = rp.simulate(machine, sampled, load)
    wanted = sampled.simulate(load)
    x = wanted["x"].interp(time=found.time)
    assert np.max(np.abs(found.x - x)) < 1e-6 * np.max(np.abs(x))
    assert found.u_x.attrs["at_limit"] == pytest.approx(wanted["u_x"].attrs["at_limit"], abs=1e-3)


def test_a_coarse_load_is_run_on_the_grid_of_the_controller(machine, sampled):
    fine, coarse = (rp.simulate(machine, sampled, push(1.0, n, h)) for n, h in
                    ((2001, PERIOD), (601, PERIOD * np.sqrt(11))))  # fmt: skip
    end = {"time": 1.9, "method": "nearest"}
    assert coarse.x.sel(**end) == pytest.approx(float(fine.x.sel(**end)), rel=5e-3)


def test_controllers_are_compared_by_what_is_left_of_the_reference(machine):
    def loop(gain):
        return Feedback("F", PERIOD, [FeedbackTerm("x", gain, 20 * gain, 0.02 * gain, 2e-3, "to")])

    time = PERIOD * np.arange(3001)
    to = xr.Dataset({"to": ("time", 1e-3 * np.minimum(time, 1.0))}, {"time": time})
    sticky = machine.with_effect("coulomb_friction", "x", {"force": 0.5})
    found = rp.compare_controllers(
        {"soft": loop(500.0), "stiff": loop(5000.0)}, plant=sticky, reference=to
    )
    away = found.table["deviation"].sel(signal="x")
    assert list(found.table.row.values) == ["without control", "soft", "stiff"]
    assert away[0] == pytest.approx(1e-3)
    assert away[2] < away[1] / 4
    run = found.responses["stiff"]
    assert away[2] == pytest.approx(float(np.max(np.abs(run.x - run["to"]))))


def test_machines_are_drawn_from_the_errors_of_a_fit(machine):
    rng = np.random.default_rng(0)
    time = 0.01 * np.arange(3000)
    force = rng.standard_normal(time.size)
    data = xr.Dataset({"F": ("time", force)}, {"time": time})
    data["x"] = ("time", rp.simulate(machine, None, data).x.values)
    data["x"] = data.x + 0.2 * float(data.x.std()) * rng.standard_normal(time.size)
    fitted = rp.refit(machine, data)
    load = push(8.0, 6000, 0.002)
    found = rp.simulate(fitted.model, None, load, fit=fitted, samples=200, seed=1)
    assert found.sizes["sample"] == 200
    settled = found.x.isel(time=-1).values
    k, error = (each["spring[0].stiffness"] for each in (fitted.model.parameters, fitted.stderr))
    assert np.std(settled) / np.mean(settled) == pytest.approx(error / k, rel=0.15)
    again = rp.simulate(fitted.model, None, load, fit=fitted, samples=3, seed=1)
    assert again.equals(found.isel(sample=slice(0, 3)))


def test_five_seconds_of_the_air_bearing_with_friction():
    """At 20 kHz, in less than a second of processor time."""
    model = rp.polishing.air_bearing_model().with_effect("coulomb_friction", "y", {"force": 0.5})
    design = rp.state_feedback(rp.air_bearing(actuation="force"), control_weight=1e-4)
    sampled = design.discretize(1 / 20e3, delay=1e-6)
    time = np.arange(100_001) / 20e3
    load = xr.Dataset({"F_y": ("time", 10 * np.sin(2 * np.pi * 7 * time))}, {"time": time})
    rp.simulate(model, sampled, load.isel(time=slice(0, 100)))  # compiles
    begin = clock.process_time()
    found = rp.simulate(model, sampled, load)
    assert clock.process_time() - begin < 1.0
    still = rp.simulate(model, None, load)
    assert np.max(np.abs(found.y)) < np.max(np.abs(still.y))


def test_what_cannot_be_run_is_refused(machine, sampled):
    wild = Feedback("F", PERIOD, [FeedbackTerm("x", -1e7)])
    with pytest.raises(SolverError, match=r"the loop diverges after .* s\. Check the signs"):
        rp.simulate(machine, wild, push())
    design = rp.state_feedback(machine.linearize(["x"], measured="state"), control_weight=1e-3)
    with pytest.raises(InvalidInputError, match=r"a continuous controller.*discretize"):
        rp.simulate(machine, design, push())
    with pytest.raises(InvalidInputError, match="neither load nor reference"):
        rp.simulate(machine, sampled)
    with pytest.raises(
        InvalidInputError, match="load: got variables G, expected one of 'F' or several"
    ):
        rp.simulate(machine, sampled, push().rename(F="G"))
    other = rp.MechanicalModel(
        [rp.Dof("z", 1.0)], inputs=[rp.Input("F", "z")], outputs=[rp.Output("z", "z")]
    )
    with pytest.raises(InvalidInputError, match="controller: got 'x', expected one of 'z'"):
        rp.simulate(other, sampled, push())
    with pytest.raises(InvalidInputError, match="disturbance: got NoneType"):
        rp.simulate(design)


def test_the_command(machine, sampled, tmp_path):
    machine.with_effect("coulomb_friction", "x", {"force": 0.2}).to_toml(tmp_path / "m.toml")
    sampled.save(tmp_path / "stiff.json")
    table = push().to_dataframe().rename(columns={"F": "F [N]"}).rename_axis("time [s]")
    table.assign(x=1e-4).rename(columns={"x": "x [m]"}).to_csv(tmp_path / "load.csv")
    words = ["simulate", str(tmp_path / "load.csv"), "--model", str(tmp_path / "m.toml"),
             "--controller", str(tmp_path / "stiff.json"), "--reference", "x",
             "--out", str(tmp_path / "run.csv"), "--json"]  # fmt: skip
    done = CliRunner().invoke(main, words, catch_exceptions=False)
    assert done.exit_code == 0
    found = json.loads(done.stdout)["stiff"]
    written = np.genfromtxt(tmp_path / "run.csv", delimiter=",", names=True)
    assert found["u_x"]["largest"] == pytest.approx(np.max(np.abs(written["u_x"])))
    assert found["x"]["largest"] == pytest.approx(np.max(np.abs(written["x"] - 1e-4)))


def test_a_saved_design_in_a_model_file(machine, sampled, tmp_path):
    sampled.save(tmp_path / "stiff.json")
    text = machine.to_toml().replace('name = "F"', 'name = "u_x"')
    text += '[[output]]\nname = "dx"\nmeasures = "x"\nquantity = "velocity"\n'
    text += '[[input]]\nname = "F"\nforce_on = "x"\n[feedback]\ncontroller = "stiff.json"\n'
    (tmp_path / "m.toml").write_text(text)
    found = rp.MechanicalModel.from_toml(tmp_path / "m.toml")
    kept = rp.MechanicalModel.from_toml(found.to_toml())
    assert kept == found
    runs = [rp.simulate(model, None, push()) for model in (found, kept)]
    wanted = rp.simulate(machine, sampled, push())
    for run in runs:
        np.testing.assert_allclose(run.x, wanted.x, atol=1e-9)
