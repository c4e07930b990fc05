"""Which reader takes which file or object."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import control
import numpy as np
import xarray as xr

from robustpolish.base.checks import instance_of, invalid, misfit
from robustpolish.base.input_files import file_size
from robustpolish.signals.raw import RECORD, RawResponse, RawTable
from robustpolish.signals.readers.arrays import read_npz, read_wav
from robustpolish.signals.readers.csv import read_csv
from robustpolish.signals.readers.hdf5 import read_hdf5
from robustpolish.signals.readers.instruments import read_tdms, read_uff
from robustpolish.signals.readers.mat import read_mat

# What is in memory already: tables of pandas and xarray, frequency responses of control.


def read_object(source: Any) -> RawTable | None:
    """Take a pandas DataFrame or Series or an xarray object apart; None for anything else."""
    if isinstance(source, xr.DataArray):
        return _dataset(source.to_dataset(name=str(source.name or "signal")))
    if isinstance(source, xr.Dataset):
        return _dataset(source)
    # xarray itself requires pandas, so that this import costs nothing more.
    import pandas as pd

    if isinstance(source, pd.Series):
        return _frame(source.to_frame(str(source.name or "signal")))
    if isinstance(source, pd.DataFrame):
        return _frame(source)
    return None


def read_frd(source: Any) -> list[RawResponse] | None:
    """Take a frequency response of python-control apart; None for anything else."""
    if not isinstance(source, control.FrequencyResponseData):
        return None
    omega = np.asarray(source.omega, dtype=float)
    values = np.asarray(source.frdata)
    return [
        RawResponse(str(output), str(entry), omega, values[k, j], frequency_unit="rad/s")
        for k, output in enumerate(source.output_labels)
        for j, entry in enumerate(source.input_labels)
    ]


def _dataset(source: xr.Dataset) -> RawTable:
    table = RawTable()
    if "time" not in source.dims:
        shown = f"an xarray object over {', '.join(map(str, source.dims)) or 'nothing'}"
        raise misfit("measurement", shown, "the dimension time", "Rename the dimension to 'time'.")
    if "time" in source.coords:
        time = source.coords["time"]
        table.add("time", _seconds(time.values), str(time.attrs.get("units", "") or "s"))
    for name, variable in source.data_vars.items():
        if variable.dims == ("time",):
            unit = str(variable.attrs.get("units", ""))
            table.add(str(name), variable.values, unit or None)
        else:
            table.notes.append(f"left out: {name}, which is not over time alone")
    table.notes.extend(str(note) for note in source.attrs.get("notes", ()))
    return table


def _frame(source: Any) -> RawTable:
    table, index = RawTable(), source.index
    # A plain count of rows is no time; anything else that is named, or dates, is.
    unnamed = index.dtype.kind in "iu" and index.name is None
    if type(index).__name__ != "RangeIndex" and not unnamed:
        if index.dtype.kind in "mM":
            table.add("time", _seconds(index.to_numpy()), "s")
        else:
            table.add(str(index.name or "time"), _seconds(index.to_numpy()), fraction=True)
    for name in source.columns:
        values = source[name].to_numpy()
        if values.ndim != 1:
            raise invalid("column", name, "a name used once", "Rename one of the columns.")
        table.add(str(name), values, fraction=True)
    return table


def _seconds(values: np.ndarray) -> np.ndarray:
    """Dates and durations as seconds from the first of them."""
    if values.dtype.kind == "M":
        values = values - values[0] if values.size else values.astype("timedelta64[ns]")
    if values.dtype.kind == "m":
        return values / np.timedelta64(1, "ns") * 1e-9
    return values


# These two kinds of files may hold frequency responses too.
TEXT = (".csv", ".txt", ".tsv", ".dat", ".asc", ".lvm")
UNIVERSAL = (".uff", ".unv", ".uf", ".58")

_READERS: dict[str, Callable[..., RawTable]] = {
    **dict.fromkeys(TEXT, read_csv),
    ".wav": read_wav,
    **dict.fromkeys(UNIVERSAL, read_uff),
    ".mat": read_mat,
    **dict.fromkeys((".h5", ".hdf5", ".hdf"), read_hdf5),
    ".npz": read_npz,
    ".tdms": read_tdms,
}
_ONE_TABLE = (*TEXT, ".wav", *UNIVERSAL)


def raw_table(source: Any, table: str | None = None, max_bytes: float | None = None) -> RawTable:
    """Read a file or take an object apart, without any check of what is in it.

    Parameters
    ----------
    source : path, pandas or xarray object
    table : str, optional
        Matrix or group to read, in files that hold several.
    max_bytes : float, optional
        Largest size of a file and of what it unpacks to.

    Returns
    -------
    RawTable

    Raises
    ------
    InvalidInputError
        If the file is missing, damaged, empty or of an unknown kind.
    """
    found = read_object(source)
    if found is not None:
        return found
    expected, remedy = "a path, or a pandas or xarray object", "Convert it to a pandas.DataFrame."
    path = Path(instance_of("measurement", source, (str, Path), expected, remedy))
    wanted, suffix = RECORD.limited(max_bytes), path.suffix.casefold()
    if file_size(path, wanted) == 0:
        raise misfit("measurement", f"{path}, empty", "data", "Export it again.")
    if suffix not in _READERS:
        known = ", ".join(_READERS)
        want = f"one of the suffixes {known}"
        raise invalid("measurement", path.name, want, "Convert the file.")
    try:
        if suffix not in _ONE_TABLE:
            return _READERS[suffix](path, table, wanted)
        if table is None:
            return _READERS[suffix](path, wanted)
    except OSError as error:
        shown = f"{path} ({error.strerror or error})"
        raise misfit("measurement", shown, "a file that can be read", "Check it.") from None
    shown = f"{table!r} for a {suffix} file"
    raise misfit("table", shown, "no table: the file has but one", "Leave it out.")
