"""MATLAB files of all versions."""

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse

from robustpolish.measurements import read_measurement
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
