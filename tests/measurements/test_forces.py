"""Recorded forces as a load: names, units, signs, offsets, rates."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.machines.simulation.run import simulate_model


def record(rate=50e3, seconds=0.1, offset=0.0):
    time = np.arange(round(seconds * rate) + 1) / rate
    x = 3.0 + 2.0 * np.sin(2 * np.pi * 190 * time)
    return pd.DataFrame({"t [s]": time, "Fx [kN]": 1e-3 * (x + offset), "Fz": -(x**2)})


def test_a_file_is_replayed_into_a_loop(tmp_path):
    """What simulate_brush made, written and read as a recorder would, moves the loop alike."""
    brush = rp.simulate_brush(run=1, duration=0.05, sample_rate=40e3)
    frame = pd.DataFrame(
        {"time [ms]": 1e3 * brush.time + 20.0, "side [kN]": -1e-3 * brush.F_y, "up [N]": brush.F_z}
    )
    path = tmp_path / "forces.csv"
    frame.to_csv(path, index=False)
    load = rp.signals.measured_forces(
        path, {"F_y": "side", "F_z": "up"}, factors={"F_y": -1}, steady={"F_p": 10.0},
        sample_rate=20e3,
    )  # fmt: skip
    assert load.attrs["began"] == pytest.approx(0.02, abs=1e-3)
    assert load["F_p"].attrs["units"] == "N"
    kept = brush.isel(time=slice(round(40e3 * (load.attrs["began"] - 0.02)), None, 2))
    kept = kept.isel(time=slice(0, load.sizes["time"])).assign_coords(time=load["time"])
    found, direct = (rp.simulate(rp.air_bearing(), w) for w in (load, kept.drop_vars("F_x")))
    for name in ("y", "z"):
        scale = float(abs(direct[name]).max())
        np.testing.assert_allclose(found[name], direct[name], atol=0.01 * scale)


def test_the_same_load_drives_a_model():
    model = rp.MechanicalModel(
        [rp.Dof("x", 0.2)],
        [rp.Spring(("x", "ground"), 1e5)],
        [rp.Damper(("x", "ground"), 10.0)],
        inputs=[rp.Input("F_x", "x")],
        outputs=[rp.Output("x", ("x", "ground"))],
    )
    load = rp.signals.measured_forces(record(), {"F_x": "Fx"}, sample_rate=20e3)
    assert np.abs(simulate_model(model, load).outputs).max() > 1e-5


def test_rates_up_down_and_in_between():
    for rate in (10e3, 50e3, 60e3, 18e3):
        load = rp.signals.measured_forces(record(), {"F_x": "Fx"}, sample_rate=rate)
        time = load["time"].to_numpy() + load.attrs["began"]
        np.testing.assert_allclose(np.diff(time), 1 / rate, rtol=1e-6)
        expected = 3.0 + 2.0 * np.sin(2 * np.pi * 190 * time)
        inside = slice(20, -20)
        np.testing.assert_allclose(load["F_x"][inside], expected[inside], atol=2e-3)
        assert bool(load.attrs["notes"]) is (rate != 50e3)


def test_offsets_parts_and_steady_inputs():
    frame = record(offset=7.0)
    frame.loc[:999, "Fx [kN]"] = 7e-3 + 1e-12 * np.arange(1000)
    load = rp.signals.measured_forces(
        frame, {"F_x": "Fx"}, unloaded=(0.0, 0.0199), between=(0.03, 0.08), steady={"F_p": 12}
    )
    assert load.attrs["began"] == pytest.approx(0.03)
    expected = 3.0 + 2.0 * np.sin(2 * np.pi * 190 * (0.03 + load["time"]))
    np.testing.assert_allclose(load["F_x"], expected, atol=1e-5)
    assert float(load["F_p"][0]) == 12.0
    assert "offset" in " ".join(load.attrs["notes"])


def test_datasets_are_taken_as_they_are():
    time = np.arange(101) / 1e3
    data = xr.Dataset({"F": ("time", np.sin(50 * time), {"units": "N"})}, {"time": time})
    load = rp.signals.measured_forces(data, {"F_y": "F"}, factors={"F_y": 2.0})
    np.testing.assert_allclose(load["F_y"], 2 * data["F"])


def test_what_is_no_force_is_refused():
    with pytest.raises(InvalidInputError, match=r"forces\['F_z'\].*unit not known"):
        rp.signals.measured_forces(record(), {"F_z": "Fz"})
    rp.signals.measured_forces(record(), {"F_z": "Fz"}, units={"Fz": "mN"})
    with pytest.raises(InvalidInputError, match="unit m"):
        rp.signals.measured_forces(record(), {"F_z": "Fz"}, units={"Fz": "mm"})
    with pytest.raises(InvalidInputError, match="factors: got entries for F_q"):
        rp.signals.measured_forces(record(), {"F_x": "Fx"}, factors={"F_q": 1.0})
    with pytest.raises(InvalidInputError, match="steady: got entries for F_x"):
        rp.signals.measured_forces(record(), {"F_x": "Fx"}, steady={"F_x": 1.0})
    with pytest.raises(InvalidInputError, match="unloaded"):
        rp.signals.measured_forces(record(), {"F_x": "Fx"}, unloaded=(5.0, 6.0))
    with pytest.raises(InvalidInputError, match="forces"):
        rp.signals.measured_forces(record(), {})
