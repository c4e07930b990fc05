"""HDF5 files with groups and units."""

import h5py
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.signals.read import read_measurement
from tests.measurements.records import FORCE, MOTION, TIME, UNITS, check


def test_hdf5_with_units_in_its_attributes(tmp_path):
    path = tmp_path / "data.h5"
    with h5py.File(path, "w") as file:
        group = file.create_group("run")
        for name, values, unit in (
            ("time", TIME * 1e3, "ms"),
            ("F", FORCE / 1e3, "kN"),
            ("x", MOTION * 1e6, b"um"),
        ):
            group[name] = values
            group[name].attrs["units"] = unit
        file["remark"] = "made in Delft"
    data = read_measurement(path, time="run/time")
    check(data.rename({"run/F": "F", "run/x": "x"}))


def test_groups_are_tables(tmp_path):
    path = tmp_path / "data.h5"
    with h5py.File(path, "w") as file:
        for run, motion in (("run1", MOTION), ("run2", 2 * MOTION)):
            for name, values in (("time", TIME), ("F", FORCE), ("x", motion)):
                file[f"{run}/daq/{name}"] = values
            file[f"{run}/daq/F"].attrs["units"] = "N"
            file[f"{run}/daq/x"].attrs["unit"] = "m"
    check(read_measurement(path, table="run1/daq"))
    direct = read_measurement(path, time="run1/daq/time", columns=["run1/daq/F", "run1/daq/x"])
    check(direct.rename({"run1/daq/F": "F", "run1/daq/x": "x"}))
    listed = r"file holds run1/daq/F \(400\), run1/daq/time \(400\), .*table=, one of run1/daq, "
    with pytest.raises(InvalidInputError, match=listed):
        read_measurement(path)
    with pytest.raises(InvalidInputError, match=r"'F' in several groups, .*run1/daq/F, run2/daq/F"):
        read_measurement(path, time="run1/daq/time", columns=["F"])
    with pytest.raises(InvalidInputError, match=r"table: got 'run3', .* holds run1/daq/F \(400\)"):
        read_measurement(path, table="run3")


def test_what_one_group_holds_goes_by_its_own_name(tmp_path):
    path = tmp_path / "data.h5"
    with h5py.File(path, "w") as file:
        for name, values in (("time", TIME), ("F", FORCE / 1e3), ("x", MOTION * 1e6)):
            file[f"measurement/{name}"] = values
    check(read_measurement(path, columns=["F", "x"], units=UNITS))
