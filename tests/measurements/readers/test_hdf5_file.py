"""HDF5 files with groups and units."""

import h5py

from robustpolish.measurements import read_measurement
from tests.measurements.records import FORCE, MOTION, TIME, check


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
