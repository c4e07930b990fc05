"""Comparison and diagnosis of machines that others measured.

The limits are those that the project has set itself; the reference errors of linear models are
those published with the sets, each fitted to the estimation part alone by least squares.
"""

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from click.testing import CliRunner
from scipy.optimize import least_squares

import robustpolish as rp
from robustpolish.app.cli.main import main
from tests.machine_files import machine

# Linear models on four measured sets: published reference errors.

pytestmark = [pytest.mark.shared, pytest.mark.long]


def fitted(model, keys, records, window=None):
    """Refit some parameters by least squares on the simulation error."""
    start = np.array([model.parameters[key] for key in keys])
    scale = np.where(start != 0, np.abs(start), 1.0)

    def changed(values):
        return model.with_parameters(dict(zip(keys, values * scale, strict=True)))

    def errors(values):
        parts = [rp.compare(changed(values), record, window=window).residual for record in records]
        return np.concatenate([part[name].values for part in parts for name in part.data_vars])

    size = float(np.std(errors(start / scale)))
    solution = least_squares(lambda values: errors(values) / size, start / scale, xtol=1e-6)
    return changed(solution.x)


def pooled(model, records, name, **options):
    squares = [
        rp.compare(model, record, **options).residual[name].values ** 2 for record in records
    ]
    return float(np.sqrt(np.mean(np.concatenate(squares))))


def silverbox(shared: Path):
    data = rp.read_measurement(shared / "data/silverbox/SNLS80mV.mat", sampling_rate=1e7 / 2**14)
    return data.assign(one=("time", np.ones(data.sizes["time"])))  # V1 has an offset of 6 mV


def test_silverbox_by_a_linear_model(shared):
    data = silverbox(shared)
    first, length = 40585, 8692
    at = ("y", "ground")
    resonance = (2 * np.pi * 69.0) ** 2
    model = rp.MechanicalModel(
        [rp.Dof("y", 1.0)],
        [rp.Spring(at, resonance)],
        [rp.Damper(at, 50.0)],
        [rp.Input("V1", at, gain=resonance, unit="V"), rp.Input("one", at, gain=-1e-3 * resonance)],
        [rp.Output("V2", at, unit="V")],
    )
    estimation = data.isel(time=slice(first, first + 3 * length))
    multisines = data.isel(time=slice(first + 3 * length, first + 9 * length))
    arrow = data.isel(time=slice(0, 40400))
    keys = ["spring[0].stiffness", "damper[0].damping", "input.V1.gain", "input.one.gain"]
    model = fitted(model, keys, [estimation])
    assert rp.compare(model, multisines).outputs["V2"].rmse == pytest.approx(6.55e-3, rel=0.01)
    assert rp.compare(model, arrow).outputs["V2"].rmse == pytest.approx(14.18e-3, rel=0.01)


def test_friction_damper_by_a_linear_model(shared):
    def record(name):
        return rp.read_measurement(shared / "data/friction_damper_backlash/brfd.npz", table=name)

    at = ("x", "ground")
    rig = rp.MechanicalModel(
        [rp.Dof("x", 0.0)],
        [rp.Spring(at, 4e5)],
        [rp.Damper(at, 1e5)],
        [rp.Input("x_m", at, "displacement"), rp.Input("v_mps", at, "velocity")],
        [rp.Output("F_N", at, "force")],
    ).with_effect("sensor_offset", "F_N", {"offset": -1e3})
    estimation = [
        record(f"{name}amplitude") for name in ("1Hz36lbtension1p5", "0p5Hz36lbtension0p5")
    ]
    held_out = [
        record(f"{name}amplitude")
        for name in ("1Hz36lbtension1", "1Hz36lbtension0p5", "0p5Hz36lbtension1")
    ]
    rig = fitted(rig, ["spring[0].stiffness", "damper[0].damping", "effect[0].offset"], estimation)
    assert pooled(rig, held_out, "F_N") == pytest.approx(7.03e3, rel=0.01)


def beam_by_a_spring():
    at = ("s", "ground")
    return rp.MechanicalModel(
        [rp.Dof("s", 1.0)],
        [rp.Spring(at, (2 * np.pi * 40) ** 2)],
        [rp.Damper(at, 5.0)],
        outputs=[rp.Output("strain_beam", at, unit="1")],
    )


def test_magnetic_beam_by_a_linear_model(shared):
    decay = rp.read_measurement(
        shared / "data/magnetic_beam/decay.npz", columns=["strain_beam"]
    ).isel(time=slice(2180, 5680))
    model = beam_by_a_spring()
    model = fitted(
        model, ["spring[0].stiffness", "damper[0].damping"], [decay.isel(time=slice(0, 1000))]
    )
    held_out = decay.isel(time=slice(1000, 3500))
    error = rp.compare(model, held_out, window=0.25).outputs["strain_beam"].rmse
    assert error == pytest.approx(14.59e-6, rel=0.01)


def test_positioning_system_by_a_linear_model(shared):
    """The drive force along the measured motion, where the acceleration is more than noise."""

    def record(name):
        columns = ["qm", "vir"]
        data = rp.read_measurement(
            shared / f"data/emps/{name}.mat", columns=columns, units={"qm": "m"}
        )
        return rp.signals.lowpass(
            data.assign(F=("time", 35.15 * data["vir"].values, {"units": "N"})), 20.0
        )

    at = ("q", "ground")
    model = rp.MechanicalModel(
        [rp.Dof("q", 90.0)],
        dampers=[rp.Damper(at, 300.0)],
        inputs=[rp.Input("qm", at, "displacement")],
        outputs=[rp.Output("F", ("q",), "force", drive=True)],
    ).with_effect("sensor_offset", "F", {"offset": -3.0})
    keys = ["dof.q.mass", "damper[0].damping", "effect[0].offset"]
    estimation, held_out = record("DATA_EMPS"), record("DATA_EMPS_PULSES")
    model = fitted(model, keys, [estimation])
    assert model.parameters["dof.q.mass"] == pytest.approx(95.1, rel=0.01)
    assert rp.compare(model, held_out).outputs["F"].relative == pytest.approx(0.170, rel=0.03)
    friction = fitted(
        model.with_effect("coulomb_friction", at, {"force": 20.0}),
        [*keys, "effect[1].force"],
        [estimation],
    )
    assert friction.parameters["damper[0].damping"] == pytest.approx(203.5, rel=0.02)
    assert friction.parameters["effect[1].force"] == pytest.approx(20.39, rel=0.02)
    assert rp.compare(friction, held_out).outputs["F"].relative < 0.05


# Diagnoses of the four measured sets.


MEMORY = {"elastic_coulomb_friction", "bouc_wen_hysteresis", "lugre_friction"}


def kinds(diagnosis):
    # of a real machine a part may be left that the motion foretells: the report says so
    assert diagnosis.verdict in ("missing_effect", "partly_explained")
    return [effect.kind for effect in diagnosis.effects]


def test_silverbox_diagnosed(shared):
    """An electronic Duffing oscillator: a cubic spring, then the offset of the amplifier.

    The last two effects are small, and both are there: fitted to the three multisines of the
    estimation, the quadratic spring lowers the error of the six unseen ones from 0.346 to 0.301 mV
    and that of the unseen arrow, which extrapolates, from 0.451 to 0.390 mV; damping with v|v|
    lowers them again, to 0.236 and 0.301 mV. So they are expected here, and the limits are those
    of the whole model.
    """
    model = rp.MechanicalModel.from_toml(machine("silverbox"))
    data = rp.read_measurement(shared / "data/silverbox/SNLS80mV.mat", sampling_rate=1e7 / 2**14)
    first, length = 40585, 8692
    diagnosis = rp.diagnose(model, data.isel(time=slice(first, first + 3 * length)))
    assert kinds(diagnosis) == [
        "cubic_stiffness", "constant_force", "quadratic_stiffness", "quadratic_damping",
    ]  # fmt: skip
    multisines = data.isel(time=slice(first + 3 * length, first + 9 * length))
    arrow = data.isel(time=slice(0, 40400))
    assert rp.compare(diagnosis.model, multisines).outputs["V2"].rmse < 0.25e-3
    assert rp.compare(diagnosis.model, arrow).outputs["V2"].rmse < 0.32e-3


def test_positioning_system_diagnosed(shared):
    """The drive's force along its motion; friction first, and what the data leaves open."""

    def record(name, cutoff):
        path = shared / f"data/emps/{name}.mat"
        data = rp.read_measurement(path, columns=["qm", "vir"], units={"qm": "m"})
        data = data.assign(F=("time", 35.15 * data["vir"].values, {"units": "N"}))
        return rp.signals.lowpass(data, cutoff)

    model = rp.MechanicalModel(
        [rp.Dof("q", 90.0)],
        dampers=[rp.Damper(("q", "ground"), 300.0)],
        inputs=[rp.Input("qm", ("q", "ground"), "displacement")],
        outputs=[rp.Output("F", ("q",), "force", drive=True)],
    )
    diagnosis = rp.diagnose(model, record("DATA_EMPS", 20.0))
    assert kinds(diagnosis) == ["coulomb_friction", "sensor_offset"]
    force = diagnosis.effects[0].parameters["force"].value
    assert force == pytest.approx(20.39, rel=0.03)
    assert diagnosis.parameters["dof.q.mass"].value == pytest.approx(95.1, rel=0.01)
    alike = [{pair.first.kind, pair.second.kind} for pair in diagnosis.indistinguishable]
    assert {"sensor_offset", "coulomb_friction"} in alike
    assert "asymmetry" in diagnosis.explain() or "direction" in diagnosis.explain()
    # measured and simulated force through one filter, where the acceleration is more than noise
    comparison = rp.compare(diagnosis.model, record("DATA_EMPS_PULSES", 100.0))
    seen = rp.signals.lowpass(xr.merge([
        comparison.residual.rename(F="error"), comparison.measured,
    ]), 20.0)  # fmt: skip
    relative = np.linalg.norm(seen["error"]) / np.linalg.norm(seen["F"])
    assert relative < 0.046


def test_positioning_system_from_the_command_line(shared, tmp_path):
    """Force in, position out: a plant that integrates, in a closed loop.

    Beside the friction and the offset of its drive a force over the position shows, as powers of
    it: on the unseen pulses it takes the error from 1.18 to 0.46 mm. So it is expected here, and
    the limit is that of the whole model.
    """
    (tmp_path / "drive.toml").write_text(machine("drive"))
    folder = shared / "data/emps"
    units = ["--unit", "qm=m", "--unit", "vir=35.15 N"]
    model, refined = str(tmp_path / "drive.toml"), str(tmp_path / "refined.toml")
    found, judged = tmp_path / "found.json", tmp_path / "judged.json"
    result = CliRunner().invoke(
        main,
        ["diagnose", str(folder / "DATA_EMPS.mat"), "--model", model, "--json", str(found),
         "--save", refined, *units],
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    content = json.loads(found.read_text())
    # their order tells nothing: what took the place of another kind stands last
    assert sorted(e["kind"] for e in content["effects"]) == [
        "constant_force", "coulomb_friction", "cubic_stiffness", "quadratic_stiffness",
    ]  # fmt: skip
    assert any(
        {one["kind"], other["kind"]} == {"constant_force", "coulomb_friction"}
        for one, other in content["indistinguishable"]
    )
    result = CliRunner().invoke(
        main,
        ["compare", str(folder / "DATA_EMPS_PULSES.mat"), "--model", refined, "--window", "1",
         "--json", str(judged), *units],
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    assert json.loads(judged.read_text())["outputs"]["qm"]["rmse"] < 0.5e-3


def test_friction_damper_diagnosed():
    """Imposed motion, measured force: friction with memory first, then the clearance.

    Dahl's friction has a memory too, and is within five nats of an elastic Coulomb friction. The
    offset of the sensor is found too; it is a constant, and the order of constants does not count.
    """
    at = ("x", "ground")
    model = rp.MechanicalModel(
        [rp.Dof("x", 0.0)],
        [rp.Spring(at, 4e5)],
        [rp.Damper(at, 1e5)],
        [rp.Input("x", at, "displacement"), rp.Input("v", at, "velocity")],
        [rp.Output("F", at, "force")],
    )
    one, other = rp.datasets.friction_damper(1.0, 1.5), rp.datasets.friction_damper(0.5, 0.5)
    later = other.assign_coords(time=other["time"] + float(one["time"][-1]) + 1 / 1024)
    diagnosis = rp.diagnose(model, xr.concat([one, later], "time"))
    found = [kind for kind in kinds(diagnosis) if kind != "sensor_offset"]
    assert found[0] in MEMORY_OR_DAHL
    assert found[1] == "backlash"
    held_out = [rp.datasets.friction_damper(*test) for test in ((1, 1), (1, 0.5), (0.5, 1))]
    assert pooled(diagnosis.model, held_out, "F") < 2.4e3


def test_magnetic_beam_diagnosed():
    """A free decay: the stiffness grows with the amplitude."""
    beam = rp.datasets.magnetic_beam()
    diagnosis = rp.diagnose(beam_by_a_spring(), beam.isel(time=slice(0, 1000)))
    assert kinds(diagnosis)[0] == "cubic_stiffness"
    held_out = beam.isel(time=slice(1000, 3500))
    assert pooled(diagnosis.model, [held_out], "strain_beam", window=0.25) < 1.2e-6


# Diagnoses of five further machines, one of them simulated.


MEMORY_OR_DAHL = MEMORY | {"dahl_friction"}
DRAGS = {"quadratic_damping", "displacement_dependent_damping"}


@pytest.fixture
def diagnosed(shared):
    """Diagnose a machine; return what was found and the error on the record that nobody fitted."""

    def diagnosed(name, output, **options):
        folder = shared / "data/real" / name
        model = rp.MechanicalModel.from_toml(folder / "model.toml")
        diagnosis = rp.diagnose(model, rp.read_measurement(folder / "train.csv"))
        left = rp.compare(
            diagnosis.model, rp.read_measurement(folder / "test.csv"), **options
        ).residual[output]
        return diagnosis, [e.kind for e in diagnosis.effects], float(np.sqrt(np.mean(left**2)))

    return diagnosed


def test_pendulum(diagnosed):
    """It swings freely from 1.6 rad: its weight, then bearing friction and the drag of the air.

    Gravity, Coulomb friction and a damping that grows with the displacement leave 11.2 mrad, with
    drag in its place a refit leaves 11.8. An earlier search ended at 8.1, from other numbers; why
    no refit comes there now is not known.
    """
    _, kinds, error = diagnosed("pendulum_decay", "theta")
    assert kinds[0] == "pendulum_gravity"
    assert set(kinds[1:]) & (MEMORY_OR_DAHL | DRAGS | {"coulomb_friction", "stribeck_friction"})
    assert error < 0.012


def test_damper(diagnosed):
    _, kinds, error = diagnosed("mr_damper_0v", "F")
    assert set(kinds) & MEMORY_OR_DAHL
    assert error < 9.5


def test_sloshing(diagnosed):
    _, kinds, error = diagnosed("sloshing", "x")
    assert set(kinds) & {"cubic_stiffness", "pendulum_gravity"}
    assert error < 0.40e-3


def test_bolted_beam(diagnosed):
    """Micro-slip, at a lower amplitude than it was fitted to."""
    _, kinds, error = diagnosed("brb_mode1", "a", window=0.25)
    assert set(kinds) & MEMORY_OR_DAHL or {"cubic_stiffness", "quadratic_damping"} <= set(kinds)
    assert error < 0.066


def test_hysteresis(diagnosed):
    """The standard benchmark, whose numbers are known."""
    diagnosis, kinds, error = diagnosed("bouc_wen", "y")
    assert kinds == ["bouc_wen_hysteresis"]
    numbers = {name: value.value for name, value in diagnosis.effects[0].parameters.items()}
    # alpha (beta |v| z + gamma v |z|) with an exponent of 1: per unit of the reference force
    bend = numbers["stiffness"] / numbers["force"]
    assert numbers["stiffness"] == pytest.approx(5e4, rel=0.02)
    assert numbers["exponent"] == pytest.approx(1.0, rel=0.02)
    assert bend * numbers["beta"] == pytest.approx(1e3 * 0.8, rel=0.02)
    assert bend * numbers["gamma"] == pytest.approx(-1e3 * 1.1, rel=0.02)
    assert error < 2e-6


# Machines that strangers brought: no all-clear where something is missing.


ALL_CLEAR = ("adequate", "parameters")


def test_a_joint_with_friction_and_an_offset_of_its_sensor(diagnosed):
    """Friction alone gains little, the offset alone nothing: only together they explain."""
    diagnosis, kinds, error = diagnosed("fairino_joint1", "M")
    assert set(kinds) - {"sensor_offset"} <= MEMORY_OR_DAHL | {"coulomb_friction"}
    assert "sensor_offset" in kinds
    assert error < 2.6
    assert diagnosis.verdict not in ALL_CLEAR


def test_a_joint_with_presliding(diagnosed):
    diagnosis, kinds, error = diagnosed("franka_joint2", "M")
    assert set(kinds) & MEMORY_OR_DAHL
    assert error < 0.142
    assert diagnosis.verdict not in ALL_CLEAR


def test_an_arm_with_a_mode_that_its_sensor_sees_with_the_other_sign(diagnosed):
    """A fit by hand leaves 0.0217 rad/s^2; the start model has its mode at 11 Hz instead of 63."""
    diagnosis, kinds, error = diagnosed("daisy_robot_arm", "acc")
    assert kinds == ["parallel_mode"]
    assert diagnosis.effects[0].values["gain"] < 0
    assert error < 1.3 * 0.0217
    assert diagnosis.verdict not in ALL_CLEAR


def test_a_ruler_on_a_motor(shared):
    """A resonator, dry friction, perhaps a delay; the plant integrates, its command is limited.

    A fit by hand leaves 0.039 rad on the other record.
    """
    folder = shared / "data/real/flexible_link"
    model = rp.MechanicalModel.from_toml(folder / "model.toml")
    train, test = (
        rp.read_measurement(folder / f"{name}.csv", at_limit=["v"]) for name in ("train", "test")
    )
    found = rp.diagnose(model, train)
    assert found.effects[0].kind == "attached_resonator"
    left = rp.compare(found.model, test).residual["theta"]
    assert float(np.sqrt(np.mean(left**2))) < 1.3 * 0.039


def test_what_the_model_has_no_part_for_is_no_noise(shared):
    folder = shared / "data/real/servo_rate_limit"
    model = rp.MechanicalModel.from_toml(folder / "model.toml")
    records = [rp.read_measurement(path) for path in sorted(folder.glob("train*.csv"))]
    assert rp.diagnose(model, records).verdict not in ALL_CLEAR


def test_a_force_periodic_in_the_position(shared):
    """Cogging of 4 mm with 6 N below 2 % of noise; the tool passes a wave in a sample or two."""
    folder = shared / "data/second_judge/cogging_4mm"
    model = rp.MechanicalModel.from_toml(folder / "model.toml")
    found = rp.diagnose(model, rp.read_measurement(folder / "train.csv"))
    (effect,) = found.effects
    assert (found.verdict, effect.kind) == ("missing_effect", "cogging")
    assert effect.at == ("tool", "ground")
    assert effect.parameters["period"].value == pytest.approx(4e-3, rel=1e-3)
    assert effect.parameters["force"].value == pytest.approx(6.0, rel=0.03)


def test_a_stop_under_the_tool_has_its_name(shared):
    """The mould under an air bearing, in a record with F_p = 0 throughout."""
    folder = shared / "data/second_judge/stop_under_tool"
    model = rp.MechanicalModel.from_toml(folder / "model.toml")
    found = rp.diagnose(model, folder / "train.csv")
    assert found.verdict == "missing_effect"
    assert [(e.kind, e.at) for e in found.effects] == [("contact_stop", ("z", "ground"))]


def test_a_belt_axis_can_be_stopped_with_its_friction(shared):
    """Three records; as soon as the friction was found, an interruption keeps it."""

    def interrupt(text):
        if text.startswith("found"):
            raise KeyboardInterrupt

    folder = shared / "data/belt_axis"
    model = rp.MechanicalModel.from_toml(folder / "model.toml")
    units = {"torque": "50 N", "enc": "0.02 m"}
    records = [rp.read_measurement(path, units=units) for path in sorted(folder.glob("*.csv"))]
    found = rp.diagnose(model, records, progress=interrupt)
    assert found.status == "stopped"
    (effect,) = found.effects
    assert (effect.kind, effect.at) == ("coulomb_friction", ("carriage", "ground"))
    assert effect.parameters["force"].value == pytest.approx(25.0, rel=0.01)
