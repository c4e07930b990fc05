"""MATLAB files: versions 4 to 7 through SciPy, 7.3 (which is HDF5) through h5py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from robustpolish.measurements.raw import RawTable, table_of, unreadable
from robustpolish.measurements.readers.hdf5_file import SIGNATURE, read_hdf5
from robustpolish.measurements.readers.mat_structure import readable_variables


def read_mat(path: Path, table: str | None = None) -> RawTable:
    """Read the vectors of a MATLAB file; the fields of a struct are named ``struct/field``."""
    with path.open("rb") as stream:
        # Version 7.3 puts 512 bytes of its own before the HDF5 signature.
        start = stream.read(520)
    if SIGNATURE in start:
        return read_hdf5(path, table)
    try:
        content = scipy.io.loadmat(path, variable_names=readable_variables(path.read_bytes()))
    except Exception as error:  # SciPy raises many kinds for a damaged file
        raise unreadable(path, "MATLAB", error) from None
    arrays: dict[str, Any] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            _flatten(name, value, arrays)
    return table_of(arrays, table, str(path))


def _flatten(name: str, value: Any, arrays: dict[str, Any]) -> None:
    array = np.asarray(value)
    if array.dtype.names and array.size == 1:
        for field in array.dtype.names:
            _flatten(f"{name}/{field}", array.reshape(-1)[0][field], arrays)
    elif array.dtype == object and array.size == 1:
        _flatten(name, array.reshape(-1)[0], arrays)
    else:
        arrays[name] = array
