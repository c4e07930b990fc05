"""HDF5 files, MATLAB 7.3 included."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from robustpolish.measurements.headers import split_header
from robustpolish.measurements.raw import RawTable, unreadable
from robustpolish.measurements.readers.named_arrays import table_of

SIGNATURE = b"\x89HDF\r\n\x1a\n"


def read_hdf5(path: Path, table: str | None = None) -> RawTable:
    """Read the vectors of an HDF5 file; the attribute ``units`` or ``unit`` gives their unit.

    Datasets in groups are named ``group/name``.
    """
    arrays: dict[str, Any] = {}
    units: dict[str, str] = {}
    try:
        with h5py.File(path, "r") as file:
            file.visititems(lambda name, item: _collect(file, name, item, arrays, units))
            for key in ("fs", "sampling_rate", "sample_rate", "dt"):
                if key in file.attrs and key not in arrays:
                    arrays[key] = file.attrs[key]
    except Exception as error:  # h5py raises OSError, RuntimeError and KeyError on damage
        raise unreadable(path, "HDF5", error) from None
    result = table_of(arrays, table, str(path))
    for name, unit in units.items():
        column = split_header(name.removeprefix(f"{table}/"))[0]
        if column in result.columns:
            result.units[column] = unit
    return result


def _collect(
    file: h5py.File, name: str, item: Any, arrays: dict[str, Any], units: dict[str, str]
) -> None:
    # MATLAB keeps what is in its cells under #refs#; they are reached from the cells.
    if not isinstance(item, h5py.Dataset) or name.startswith("#"):
        return
    kind = item.dtype.kind
    if h5py.check_ref_dtype(item.dtype) is h5py.Reference:
        _cell(file, name, item, arrays)
    elif kind == "O":
        text = h5py.check_string_dtype(item.dtype) is not None
        arrays[name] = np.atleast_1d(item.asstr()[()]).astype(str) if text else np.zeros(0)
    elif kind in "fiubS" and "MATLAB_empty" not in item.attrs:
        arrays[name] = _values(item)
    for key in ("units", "unit"):
        if key in item.attrs:
            value = item.attrs[key]
            units[name] = (
                value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
            )
            break


def _values(item: Any) -> np.ndarray:
    """Return numbers or text; MATLAB writes text as numbers of characters."""
    values = np.asarray(item[()])
    if values.dtype.kind == "S":
        return values.astype(str)
    if item.attrs.get("MATLAB_class") == b"char" and values.dtype.kind in "iu":
        return np.array(["".join(map(chr, values.reshape(-1)))])
    return values


def _cell(file: h5py.File, name: str, item: Any, arrays: dict[str, Any]) -> None:
    """Collect the parts of a MATLAB cell as ``name{1}`` and so on; texts alone as one array."""
    parts = [file[reference] for reference in np.asarray(item[()]).reshape(-1) if reference]
    values = [_values(part) for part in parts if isinstance(part, h5py.Dataset)]
    if values and all(part.dtype.kind == "U" for part in values):
        arrays[name] = np.concatenate(values)
        return
    for i, part in enumerate(values, 1):
        arrays[f"{name}{{{i}}}"] = part
