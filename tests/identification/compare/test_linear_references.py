"""Linear models on the four measured sets: the reference errors that effects have to beat.

The figures are those published with the sets, each fitted to the estimation part alone by least
squares on the simulation error.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from robustpolish.identification.compare import compare
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring
from robustpolish.signals.filtering import lowpass
from robustpolish.signals.read import read_measurement

pytestmark = pytest.mark.shared


def fitted(model, keys, records, window=None):
    """Refit some parameters by least squares on the simulation error."""
    start = np.array([model.parameters[key] for key in keys])
    scale = np.where(start != 0, np.abs(start), 1.0)

    def changed(values):
        return model.with_parameters(dict(zip(keys, values * scale, strict=True)))

    def errors(values):
        parts = [compare(changed(values), record, window=window).residual for record in records]
        return np.concatenate([part[name].values for part in parts for name in part.data_vars])

    size = float(np.std(errors(start / scale)))
    solution = least_squares(lambda values: errors(values) / size, start / scale, xtol=1e-6)
    return changed(solution.x)


def pooled(model, records, name, **options):
    squares = [compare(model, record, **options).residual[name].values ** 2 for record in records]
    return float(np.sqrt(np.mean(np.concatenate(squares))))


def silverbox(shared: Path):
    data = read_measurement(shared / "data/silverbox/SNLS80mV.mat", sampling_rate=1e7 / 2**14)
    return data.assign(one=("time", np.ones(data.sizes["time"])))  # V1 has an offset of 6 mV


def test_silverbox(shared):
    data = silverbox(shared)
    first, length = 40585, 8692
    at = ("y", "ground")
    resonance = (2 * np.pi * 69.0) ** 2
    model = MechanicalModel(
        [Dof("y", 1.0)],
        [Spring(at, resonance)],
        [Damper(at, 50.0)],
        [Input("V1", at, gain=resonance, unit="V"), Input("one", at, gain=-1e-3 * resonance)],
        [Output("V2", at, unit="V")],
    )
    estimation = data.isel(time=slice(first, first + 3 * length))
    multisines = data.isel(time=slice(first + 3 * length, first + 9 * length))
    arrow = data.isel(time=slice(0, 40400))
    keys = ["spring[0].stiffness", "damper[0].damping", "input.V1.gain", "input.one.gain"]
    model = fitted(model, keys, [estimation])
    assert compare(model, multisines).outputs["V2"].rmse == pytest.approx(6.55e-3, rel=0.01)
    assert compare(model, arrow).outputs["V2"].rmse == pytest.approx(14.18e-3, rel=0.01)


def test_friction_damper(shared):
    def record(name):
        return read_measurement(shared / "data/friction_damper_backlash/brfd.npz", table=name)

    at = ("x", "ground")
    rig = MechanicalModel(
        [Dof("x", 0.0)],
        [Spring(at, 4e5)],
        [Damper(at, 1e5)],
        [Input("x_m", at, "displacement"), Input("v_mps", at, "velocity")],
        [Output("F_N", at, "force")],
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


def test_magnetic_beam(shared):
    decay = read_measurement(shared / "data/magnetic_beam/decay.npz", columns=["strain_beam"]).isel(
        time=slice(2180, 5680)
    )
    at = ("s", "ground")
    model = MechanicalModel(
        [Dof("s", 1.0)],
        [Spring(at, (2 * np.pi * 40) ** 2)],
        [Damper(at, 5.0)],
        outputs=[Output("strain_beam", at, unit="1")],
    )
    model = fitted(
        model, ["spring[0].stiffness", "damper[0].damping"], [decay.isel(time=slice(0, 1000))]
    )
    held_out = decay.isel(time=slice(1000, 3500))
    error = compare(model, held_out, window=0.25).outputs["strain_beam"].rmse
    assert error == pytest.approx(14.59e-6, rel=0.01)


def test_positioning_system(shared):
    """The drive force along the measured motion, where the acceleration is more than noise."""

    def record(name):
        columns = ["qm", "vir"]
        data = read_measurement(
            shared / f"data/emps/{name}.mat", columns=columns, units={"qm": "m"}
        )
        return lowpass(data.assign(F=("time", 35.15 * data["vir"].values, {"units": "N"})), 20.0)

    at = ("q", "ground")
    model = MechanicalModel(
        [Dof("q", 90.0)],
        dampers=[Damper(at, 300.0)],
        inputs=[Input("qm", at, "displacement")],
        outputs=[Output("F", ("q",), "force", drive=True)],
    ).with_effect("sensor_offset", "F", {"offset": -3.0})
    keys = ["dof.q.mass", "damper[0].damping", "effect[0].offset"]
    estimation, held_out = record("DATA_EMPS"), record("DATA_EMPS_PULSES")
    model = fitted(model, keys, [estimation])
    assert model.parameters["dof.q.mass"] == pytest.approx(95.1, rel=0.01)
    assert compare(model, held_out).outputs["F"].relative == pytest.approx(0.170, rel=0.03)
    friction = fitted(
        model.with_effect("coulomb_friction", at, {"force": 20.0}),
        [*keys, "effect[1].force"],
        [estimation],
    )
    assert friction.parameters["damper[0].damping"] == pytest.approx(203.5, rel=0.02)
    assert friction.parameters["effect[1].force"] == pytest.approx(20.39, rel=0.02)
    assert compare(friction, held_out).outputs["F"].relative < 0.05
