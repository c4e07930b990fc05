"""The files of the records, and how they become datasets."""

from importlib.resources import files

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.datasets import dataset, load_arrays
from robustpolish.signals.read import read_measurement

TESTS = [(1, 1.5), (0.5, 0.5), (1, 1), (1, 0.5), (0.5, 1)]


def test_each_file_has_its_licence_beside_it():
    folder = files("robustpolish.datasets") / "files"
    records = sorted(path.name for path in folder.iterdir() if path.name.endswith(".npz"))
    assert len(records) == 4
    for name in records:
        licence = (folder / name.replace(".npz", ".LICENSE.txt")).read_text()
        assert licence.startswith(name)
        assert "icense" in licence
        assert "https://github.com/" in licence


@pytest.mark.shared
def test_the_records_are_those_that_were_measured(shared):
    beam = read_measurement(shared / "data/magnetic_beam/decay.npz").isel(time=slice(2180, 5680))
    own = rp.datasets.magnetic_beam()
    for name in own:
        assert np.array_equal(own[name].values, beam[name].values)
    for frequency, amplitude in TESTS:
        name = f"{frequency:g}Hz36lbtension{amplitude:g}amplitude".replace(".", "p")
        path = shared / "data/friction_damper_backlash/brfd.npz"
        original = read_measurement(path, table=name)
        test = rp.datasets.friction_damper(frequency, amplitude)
        for mine, theirs, step in (("x", "x_m", 2e-6), ("v", "v_mps", 1e-5), ("F", "F_N", 1.0)):
            assert np.max(np.abs(test[mine].values - original[theirs].values)) < 0.51 * step


@pytest.mark.shared
def test_the_rounded_ones_are_within_single_precision(shared):
    pieces = {
        "pendulum_decay/train.csv": rp.datasets.pendulum_decay(),
        "pendulum_decay/test.csv": rp.datasets.pendulum_decay("rest"),
        "mr_damper_0v/train.csv": rp.datasets.mr_damper().isel(time=slice(0, 940)),
        "mr_damper_0v/test.csv": rp.datasets.mr_damper().isel(time=slice(940, None)),
    }
    for path, own in pieces.items():
        original = read_measurement(shared / "data/real" / path)
        assert set(own) == set(original)
        for name in own:
            np.testing.assert_allclose(own[name].values, original[name].values, rtol=1e-7)
            assert own[name].attrs["units"] == original[name].attrs["units"]
        assert float(own["time"][1] - own["time"][0]) == pytest.approx(0.01)


def test_columns_stand_over_time_with_their_units():
    data = dataset({"F": (np.arange(5.0), "N"), "x": (np.zeros(5), "m")}, 10.0, "made up")
    np.testing.assert_allclose(data["time"], [0.0, 0.1, 0.2, 0.3, 0.4])
    assert {name: data[name].attrs["units"] for name in data} == {"F": "N", "x": "m"}
    assert (data["time"].attrs["units"], data.attrs["source"]) == ("s", "made up")


def test_only_files_of_the_folder_are_there():
    assert set(load_arrays("magnetic_beam.npz")) == {"strain_beam", "strain_clamp_beam"}
    with pytest.raises(FileNotFoundError):
        load_arrays("nothing.npz")
