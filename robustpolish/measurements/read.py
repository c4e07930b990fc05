"""Files and tables in, one checked xarray dataset in SI units out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from robustpolish.measurements import readers
from robustpolish.measurements.quality import (
    check_finite,
    check_moves,
    check_not_clipped,
    numeric,
)
from robustpolish.measurements.raw import RawTable
from robustpolish.measurements.time_axis import UniformTime, uniform_time
from robustpolish.measurements.units import to_si
from robustpolish.validation import described, instance_of, invalid, positive

_WITHOUT_TABLES: dict[str, Callable[[Path], RawTable]] = {
    ".csv": readers.read_csv,
    ".txt": readers.read_csv,
    ".tsv": readers.read_csv,
    ".dat": readers.read_csv,
    ".wav": readers.read_wav,
    ".uff": readers.read_uff,
    ".unv": readers.read_uff,
}
_WITH_TABLES: dict[str, Callable[[Path, str | None], RawTable]] = {
    ".mat": readers.read_mat,
    ".h5": readers.read_hdf5,
    ".hdf5": readers.read_hdf5,
    ".hdf": readers.read_hdf5,
    ".npz": readers.read_npz,
    ".tdms": readers.read_tdms,
}
_TIME_NAMES = ("time", "t", "time_s", "t_s")


def read_measurement(
    source: Any,
    *,
    columns: Sequence[str] | None = None,
    units: Mapping[str, str] | None = None,
    time: str | None = None,
    sampling_rate: float | None = None,
    table: str | None = None,
) -> xr.Dataset:
    """Read a measurement, check it, and convert it to SI units.

    Parameters
    ----------
    source : path, pandas.DataFrame, pandas.Series, xarray.Dataset or xarray.DataArray
        A CSV file with the header ``name [unit]`` (also ``.txt``, ``.tsv``, ``.dat``), a MATLAB
        file of any version, HDF5, NPZ or WAV; TDMS and UFF 58 with the extra ``[io]``.
    columns : sequence of str, optional
        The channels to read; all by default.
    units : mapping of str to str, optional
        Units of channels whose file has none, or other ones; a factor may precede the unit:
        ``{"channel_1": "2.5 mm"}``. A channel without a unit is kept as it is.
    time : str, optional
        Name of the time channel; ``time`` or ``t`` by default.
    sampling_rate : float, optional
        In Hz, for files without time.
    table : str, optional
        Matrix or group to read, in files that hold several.

    Returns
    -------
    xarray.Dataset
        Channels over ``time`` in s, uniform, each with its SI unit in ``attrs["units"]`` ("" if
        unknown). ``attrs["notes"]`` tells what was filled in, resampled or left out.

    Raises
    ------
    InvalidInputError
        If the file is missing, damaged, empty or of an unknown kind; if a column is missing; if
        time does not rise or is strongly irregular; if a channel has gaps, text, NaN, is constant
        or clipped; if a unit is unknown. The message names file, channel, and sample or line.
    MissingDependencyError
        If the format needs the extra ``[io]``.

    Examples
    --------
    >>> import pandas as pd
    >>> import robustpolish as rp
    >>> frame = pd.DataFrame({"time [ms]": [0, 1, 2], "x [um]": [0.0, 2.0, 1.0]})
    >>> data = rp.read_measurement(frame)
    >>> data["x"].values, data["x"].attrs["units"]
    (array([0.e+00, 2.e-06, 1.e-06]), 'm')
    """
    raw = _raw(source, table)
    raw.units.update(_known(units or {}, raw, "units"))
    name, axis = _time(raw, time, sampling_rate)
    chosen = _chosen(raw, columns, name)
    length = axis.time.size if axis.taken is None else axis.taken.size
    data: dict[str, Any] = {}
    notes = [*raw.notes, *([axis.note] if axis.note else [])]
    for column in chosen:
        values = numeric(column, raw.columns[column])
        if values.shape != (length,):
            if columns is None:
                notes.append(f"left out: {column}, which is not as long as the time")
                continue
            shown = described(f"shape {values.shape}")
            raise invalid(column, shown, f"{length} samples, like the time", "Check the file.")
        check_finite(column, values, axis.taken if axis.taken is not None else axis.time)
        check_moves(column, values)
        check_not_clipped(column, values)
        values, unit = to_si(values, raw.units.get(column, ""), f"unit of {column!r}")
        data[column] = ("time", axis.move(values), {"units": unit})
    if not data:
        shown = described("no channel beside the time")
        raise invalid("measurement", shown, "one channel or more", "Check the file.")
    dataset = xr.Dataset(data, coords={"time": ("time", axis.time, {"units": "s"})})
    dataset.attrs["notes"] = notes
    if isinstance(source, str | Path):
        dataset.attrs["source"] = str(source)
    return dataset


def _raw(source: Any, table: str | None) -> RawTable:
    found = readers.read_object(source)
    if found is not None:
        return found
    expected, remedy = "a path, or a pandas or xarray object", "Convert it to a pandas.DataFrame."
    path = Path(instance_of("measurement", source, (str, Path), expected, remedy))
    if not path.is_file():
        what = "a folder" if path.is_dir() else "no such file"
        raise invalid("measurement", described(f"{path} ({what})"), "a file", "Check the path.")
    if path.stat().st_size == 0:
        raise invalid("measurement", described(f"{path}, empty"), "data", "Export it again.")
    suffix = path.suffix.casefold()
    try:
        if suffix in _WITH_TABLES:
            return _WITH_TABLES[suffix](path, table)
        if suffix in _WITHOUT_TABLES:
            if table is not None:
                shown = described(f"{table!r} for a {suffix} file")
                raise invalid("table", shown, "no table: the file has but one", "Leave it out.")
            return _WITHOUT_TABLES[suffix](path)
    except OSError as error:
        shown = described(f"{path} ({error.strerror or error})")
        raise invalid("measurement", shown, "a file that can be read", "Check it.") from None
    known = ", ".join([*_WITHOUT_TABLES, *_WITH_TABLES])
    raise invalid("measurement", path.name, f"one of the suffixes {known}", "Convert the file.")


def _known(units: Mapping[str, str], raw: RawTable, argument: str) -> dict[str, str]:
    for name, unit in units.items():
        if name not in raw.columns:
            raise invalid(argument, name, f"one of {', '.join(raw.columns)}", "Check its name.")
        if not isinstance(unit, str):
            raise invalid(f"{argument}[{name!r}]", unit, "text such as 'mm'", "Quote it.")
    return dict(units)


def _chosen(raw: RawTable, columns: Sequence[str] | None, time: str | None) -> list[str]:
    available = [name for name in raw.columns if name != time]
    if columns is None:
        return available
    wanted = [columns] if isinstance(columns, str) else list(columns)
    for name in wanted:
        if name not in available:
            listed = ", ".join(available) or "none"
            raise invalid(
                "column",
                described(f"no channel {name!r}"),
                f"the channels that are there: {listed}",
                "Check the header.",
            )
    return wanted


def _time(
    raw: RawTable, name: str | None, sampling_rate: float | None
) -> tuple[str | None, UniformTime]:
    """Return the name of the time channel, if there is one, and the uniform axis."""
    if not raw.columns:
        raise invalid("measurement", described("no channels"), "signals", "Check the file.")
    if name is not None and name not in raw.columns:
        raise invalid("time", name, f"one of {', '.join(raw.columns)}", "Check its name.")
    if name is None:
        named = {column.casefold(): column for column in reversed(raw.columns)}
        name = next((named[key] for key in _TIME_NAMES if key in named), None)
    if name is not None and sampling_rate is None:
        stamps = numeric(name, raw.columns[name])
        check_finite(name, stamps)
        stamps, unit = to_si(stamps, raw.units.get(name, "") or "s", f"unit of {name!r}")
        if unit != "s":
            raise invalid(f"unit of {name!r}", unit, "a unit of time", "Correct the header.")
        return name, uniform_time(np.atleast_1d(stamps).reshape(-1), name)
    rate = raw.sampling_rate if sampling_rate is None else sampling_rate
    if rate is None:
        raise invalid(
            "time",
            described(f"no channel of that name among {', '.join(raw.columns)}"),
            "a time channel or a sampling rate",
            "Pass time=NAME or sampling_rate=HZ.",
        )
    step = 1 / positive("sampling_rate", rate, "Hz")
    length = _common_length(raw, name)
    if length < 2:
        raise invalid(
            "measurement", described(f"{length} samples"), "two or more", "Record longer."
        )
    return name, UniformTime(step * np.arange(length, dtype=np.float64))


def _common_length(raw: RawTable, time: str | None) -> int:
    """Length of most of the channels."""
    lengths = [np.size(values) for name, values in raw.columns.items() if name != time]
    return max(set(lengths), key=lengths.count) if lengths else 0
