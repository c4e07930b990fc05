"""MATLAB files of all versions."""

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse

from robustpolish.errors import InvalidInputError
from robustpolish.signals.read import read_measurement
from tests.measurements.records import FORCE, MOTION, TIME, UNITS, check


@pytest.mark.parametrize("shape", [(-1, 1), (1, -1)])
def test_mat(tmp_path, shape):
    path = tmp_path / "data.mat"
    content = {"t": TIME, "F": FORCE / 1e3, "x": MOTION * 1e6}
    scipy.io.savemat(path, {k: v.reshape(shape) for k, v in content.items()} | {"gain": 3.0})
    check(read_measurement(path, units=UNITS))


def test_mat_structs_and_sampling_rate(tmp_path):
    path = tmp_path / "data.mat"
    scipy.io.savemat(path, {"m": {"F": FORCE / 1e3, "x": MOTION * 1e6}, "fs": 1000.0})
    data = read_measurement(path, units={"m/F": "kN", "m/x": "um"})
    check(data.rename({"m/F": "F", "m/x": "x"}))


def test_mat_with_what_is_no_signal_and_compressed(tmp_path):
    path = tmp_path / "data.mat"
    content = {
        "t": TIME, "F": FORCE / 1e3, "x": MOTION * 1e6,
        "remark": "made in Delft", "empty": np.zeros((0, 0)), "sparse": scipy.sparse.eye(3),
        "cells": np.array([1, "a"], dtype=object), "z": 1 + 2j * TIME,
    }  # fmt: skip
    scipy.io.savemat(path, content, do_compression=True)
    check(read_measurement(path, units=UNITS, columns=["F", "x"]))


def test_mat_of_version_4(tmp_path):
    path = tmp_path / "data.mat"
    content = {"t": TIME, "F": FORCE / 1e3, "x": MOTION * 1e6}
    scipy.io.savemat(path, content, format="4")
    check(read_measurement(path, units=UNITS))


def test_mat_of_version_7_3(tmp_path):
    path = tmp_path / "data.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in {"t": TIME, "F": FORCE / 1e3, "x": MOTION * 1e6}.items():
            file[name] = values.reshape(1, -1)
        file["#refs#/a"] = np.zeros(3)
    content = bytearray(path.read_bytes())
    content[:116] = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116)
    path.write_bytes(bytes(content))
    check(read_measurement(path, units=UNITS))


def cells(*items):
    content = np.empty(len(items), dtype=object)
    content[:] = items
    return content


def test_mat_cells_and_nested_structs(tmp_path):
    path = tmp_path / "data.mat"
    content = {"rig": {"daq": {"t": TIME, "F": FORCE / 1e3}, "c": cells(MOTION * 1e6, "a", 3.0)}}
    scipy.io.savemat(path, content)
    data = read_measurement(path, units={"F": "kN", "rig/c{1}": "um"})
    check(data.rename({"rig/daq/F": "F", "rig/c{1}": "x"}))


def test_mat_matrix_with_names_in_a_cell(tmp_path):
    path = tmp_path / "data.mat"
    table = np.column_stack([TIME, FORCE / 1e3, MOTION * 1e6])
    scipy.io.savemat(path, {"data": table, "names": cells("t", "F [kN]", "x [um]")})
    check(read_measurement(path))


def test_mat_structs_by_number(tmp_path):
    path = tmp_path / "data.mat"
    runs = np.array([(TIME, FORCE), (TIME, 2 * FORCE)], dtype=[("t", object), ("F", object)])
    scipy.io.savemat(path, {"run": runs})
    second = read_measurement(path, table="run(2)")
    np.testing.assert_allclose(second["F"], 2 * FORCE)
    with pytest.raises(InvalidInputError, match=r"table=, one of run\(1\), run\(2\)"):
        read_measurement(path)


def test_mat_of_version_7_3_with_cells(tmp_path):
    path = tmp_path / "data.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        parts = {"a": TIME, "b": FORCE / 1e3, "c": MOTION * 1e6}
        for name, values in parts.items():
            file[f"#refs#/{name}"] = values.reshape(1, -1)
        for name, text in (("d", "t"), ("e", "F")):
            file[f"#refs#/{name}"] = np.array([[ord(letter)] for letter in text], np.uint16)
            file[f"#refs#/{name}"].attrs["MATLAB_class"] = np.bytes_("char")
        references = [file[f"#refs#/{name}"].ref for name in "abc"]
        file.create_dataset("data", data=np.array(references, dtype=h5py.ref_dtype))
        words = [file[f"#refs#/{name}"].ref for name in "de"]
        file.create_dataset("names", data=np.array(words, dtype=h5py.ref_dtype))
    data = read_measurement(
        path, rename={"data{1}": "t", "data{2}": "F", "data{3}": "x"}, units=UNITS
    )
    check(data)
    assert data.attrs["notes"] == ["left out, as they are no signals: names"]
