"""What is in memory already: tables of pandas and xarray, frequency responses of control."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
import xarray as xr

from robustpolish.base.checks import invalid, misfit
from robustpolish.signals.raw import RawResponse, RawTable


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
