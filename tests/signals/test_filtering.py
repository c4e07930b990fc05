"""Filters without delay, contiguous blocks, and recorded forces as loads."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.machines.simulation import simulate_model
from robustpolish.signals.forces import decimate, lowpass, split_blocks

DATA = xr.Dataset({"x": ("time", np.arange(100.0))}, {"time": np.arange(100) * 0.01})


@pytest.mark.parametrize("cutoff", [0.0, -1.0, 50.0, 1e9, "a", 0.5])
def test_bad_filters_are_refused(cutoff):
    with pytest.raises(InvalidInputError, match="cutoff"):
        lowpass(DATA, cutoff)


def test_slow_signals_pass_and_fast_ones_do_not():
    time = np.arange(2000) * 1e-3
    slow, fast = np.sin(2 * np.pi * 3 * time), np.sin(2 * np.pi * 200 * time)
    data = xr.Dataset({"x": ("time", slow + fast, {"units": "m"})}, {"time": time})
    smooth = lowpass(data, 40.0)
    kept = slice(100, 1900)  # four periods of 25 samples at both ends
    np.testing.assert_array_equal(smooth["time"], time[kept])
    np.testing.assert_allclose(smooth["x"], slow[kept], atol=1e-4)
    assert smooth["x"].attrs["units"] == "m"


def test_the_amplitude_is_halved_at_the_cutoff():
    time = np.arange(4000) * 1e-3
    data = xr.Dataset({"x": ("time", np.sin(2 * np.pi * 40 * time))}, {"time": time})
    assert float(abs(lowpass(data, 40.0)["x"]).max()) == pytest.approx(0.5, abs=0.005)


def record(samples, rate, *frequencies):
    time = 3.0 + np.arange(samples) / rate
    return xr.Dataset(
        {
            name: ("time", 7 + np.sin(2 * np.pi * f * time), {"units": "m"})
            for name, f in zip("xyz", frequencies, strict=False)
        },
        {"time": ("time", time, {"units": "s"})},
    )


@pytest.mark.parametrize("every", [2, 3, 10, 25])
@pytest.mark.parametrize("samples", [5000, 5001, 5013])
def test_slow_signals_are_kept_and_fast_ones_leave_nothing(every, samples):
    rate = 1000.0 * every
    data = record(samples, rate, 40.0, 399.0, 601.0)
    fewer = decimate(data, 1000.0)
    time = fewer["time"].values
    np.testing.assert_allclose(np.diff(time), 1e-3, rtol=1e-9)
    assert np.isin(time, data["time"].values).all()
    assert abs(time[0] - 3.013) < 1.1e-3  # 13 samples at the beginning
    assert data["time"].values[-1] - time[-1] < 0.0145
    for name, frequency in (("x", 40.0), ("y", 399.0)):
        slow = 7 + np.sin(2 * np.pi * frequency * time)
        np.testing.assert_allclose(fewer[name], slow, atol=2e-4)
    np.testing.assert_allclose(fewer["z"], 7, atol=2e-4)
    assert fewer["x"].attrs["units"] == "m"
    assert fewer["time"].attrs["units"] == "s"


def test_the_rate_is_never_below_the_wanted_one():
    data = record(5000, 10_000.0, 40.0)
    data.attrs["notes"] = ["resampled"]
    fewer = decimate(data, 3000.0)
    assert 1 / float(np.diff(fewer["time"])[0]) == pytest.approx(10_000 / 3)
    assert fewer.attrs["notes"] == [
        "resampled",
        "decimated from 10000 to 3333.33 Hz: every 3rd sample, no delay, unchanged up to "
        "1333.33 Hz",
    ]
    assert data.attrs["notes"] == ["resampled"]
    assert decimate(data, 6000.0) is data
    assert decimate(data, 10_000.0) is data


@pytest.mark.parametrize("rate", [0.0, -1.0, "a", np.nan, 10.0])
def test_bad_rates_are_refused(rate):
    with pytest.raises(InvalidInputError, match="rate"):
        decimate(record(5000, 10_000.0, 40.0), rate)


def test_blocks_are_contiguous_and_complete():
    blocks = split_blocks(DATA, 7)
    np.testing.assert_array_equal(np.concatenate([b["x"] for b in blocks]), DATA["x"])
    assert all(np.all(np.diff(b["x"]) == 1) for b in blocks)


def test_shares_may_leave_a_rest():
    first, second = split_blocks(DATA, (0.5, 0.2))
    assert (first.sizes["time"], second.sizes["time"]) == (50, 20)
    assert float(second["time"][0]) == 0.5


@pytest.mark.parametrize("parts", [0, 60, (0.9, 0.2), (-0.1, 0.5), (), "ab", None, (0.001,), True])
def test_bad_parts_are_refused(parts):
    with pytest.raises(InvalidInputError, match="parts"):
        split_blocks(DATA, parts)


def record_forces(rate=50e3, seconds=0.1, offset=0.0):
    time = np.arange(round(seconds * rate) + 1) / rate
    x = 3.0 + 2.0 * np.sin(2 * np.pi * 190 * time)
    return pd.DataFrame({"t [s]": time, "Fx [kN]": 1e-3 * (x + offset), "Fz": -(x**2)})


def forces(asked, **more):
    return rp.signals.measured_forces(record_forces(), asked, **more)


def test_a_file_is_replayed_into_a_loop(tmp_path):
    """What simulate_brush made, written and read as a recorder would, moves the loop alike."""
    brush = rp.polishing.simulate_brush(run=1, duration=0.05, sample_rate=40e3)
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
    load = forces({"F_x": "Fx"}, sample_rate=20e3)
    assert np.abs(simulate_model(model, load).outputs).max() > 1e-5


def test_rates_up_down_and_in_between():
    for rate in (10e3, 50e3, 60e3, 18e3):
        load = forces({"F_x": "Fx"}, sample_rate=rate)
        time = load["time"].to_numpy() + load.attrs["began"]
        np.testing.assert_allclose(np.diff(time), 1 / rate, rtol=1e-6)
        expected = 3.0 + 2.0 * np.sin(2 * np.pi * 190 * time)
        inside = slice(20, -20)
        np.testing.assert_allclose(load["F_x"][inside], expected[inside], atol=2e-3)
        assert bool(load.attrs["notes"]) is (rate != 50e3)


def test_offsets_parts_and_steady_inputs():
    frame = record_forces(offset=7.0)
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


@pytest.mark.parametrize(
    ("asked", "more", "message"),
    [
        ({"F_z": "Fz"}, {}, r"forces\['F_z'\].*unit not known"),
        ({"F_z": "Fz"}, {"units": {"Fz": "mm"}}, "unit m"),
        ({"F_x": "Fx"}, {"factors": {"F_q": 1.0}}, "factors: got entries for F_q"),
        ({"F_x": "Fx"}, {"steady": {"F_x": 1.0}}, "steady: got entries for F_x"),
        ({"F_x": "Fx"}, {"unloaded": (5.0, 6.0)}, "unloaded"),
        ({}, {}, "forces"),
    ],
)
def test_what_is_no_force_is_refused(asked, more, message):
    with pytest.raises(InvalidInputError, match=message):
        forces(asked, **more)
    forces({"F_z": "Fz"}, units={"Fz": "mN"})
