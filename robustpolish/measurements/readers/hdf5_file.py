"""HDF5 files, MATLAB 7.3 included."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from robustpolish.measurements.raw import RawTable, split_header, table_of, unreadable

SIGNATURE = b"\x89HDF\r\n\x1a\n"


def read_hdf5(path: Path, table: str | None = None) -> RawTable:
    """Read the vectors of an HDF5 file; the attribute ``units`` or ``unit`` gives their unit.

    Datasets in groups are named ``group/name``.
    """
    arrays: dict[str, Any] = {}
    units: dict[str, str] = {}
    try:
        with h5py.File(path, "r") as file:
            file.visititems(lambda name, item: _collect(name, item, arrays, units))
            for key in ("fs", "sampling_rate", "sample_rate", "dt"):
                if key in file.attrs and key not in arrays:
                    arrays[key] = file.attrs[key]
    except Exception as error:  # h5py raises OSError, RuntimeError and KeyError on damage
        raise unreadable(path, "HDF5", error) from None
    result = table_of(arrays, table, str(path))
    for name, unit in units.items():
        column = split_header(name)[0]
        if column in result.columns:
            result.units[column] = unit
    return result


def _collect(name: str, item: Any, arrays: dict[str, Any], units: dict[str, str]) -> None:
    # MATLAB keeps its cells and strings under #refs#.
    if not isinstance(item, h5py.Dataset) or name.startswith("#"):
        return
    kind = item.dtype.kind
    if kind == "O":
        text = h5py.check_string_dtype(item.dtype) is not None
        arrays[name] = np.atleast_1d(item.asstr()[()]).astype(str) if text else np.zeros(0)
    elif kind in "fiubS" and "MATLAB_empty" not in item.attrs:
        arrays[name] = np.asarray(item[()]).astype(str) if kind == "S" else np.asarray(item[()])
    for key in ("units", "unit"):
        if key in item.attrs:
            value = item.attrs[key]
            units[name] = (
                value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
            )
            break
