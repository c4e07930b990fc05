"""Files and tables in, one checked xarray dataset in SI units out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import control
import numpy as np
import xarray as xr

from robustpolish.base.arrays import Vector
from robustpolish.base.checks import instance_of, invalid, misfit, positive
from robustpolish.base.input_files import file_size
from robustpolish.signals.raw import (
    RECORD,
    RawResponse,
    RawTable,
    check_finite,
    check_not_clipped,
    ends_without_values,
    fill_gaps,
    is_count,
    numeric,
    share_at_limit,
    to_si,
)
from robustpolish.signals.readers.arrays import read_npz, read_wav, table_of
from robustpolish.signals.readers.csv import read_csv
from robustpolish.signals.readers.instruments import read_tdms, read_uff
from robustpolish.signals.readers.mat import read_hdf5, read_mat
from robustpolish.signals.time_axis import find_time, is_text, seconds, uniform_time

# Which reader takes which file or object.

# What is in memory already: tables of pandas and xarray, frequency responses of control.


def read_object(source: Any) -> RawTable | None:
    """Take a table in memory apart: see :func:`read_measurement`; None for anything else."""
    if isinstance(source, xr.DataArray):
        return _dataset(source.to_dataset(name=str(source.name or "signal")))
    if isinstance(source, xr.Dataset):
        return _dataset(source)
    if isinstance(source, control.TimeResponseData):
        source = source.to_pandas()
    if isinstance(source, np.ndarray) and source.dtype.names:
        source = {name: source[name] for name in source.dtype.names}
    if isinstance(source, Mapping):
        columns = {str(name): values for name, values in source.items()}
        return table_of(columns, None, "a mapping of arrays")
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
    expected = "a path, a pandas or xarray object, a mapping of arrays or a TimeResponseData"
    remedy = "Convert it to a pandas.DataFrame."
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


_CLOCKS_AGREE = 0.01  # relative, what the clock of a computer may be off


def read_measurement(
    source: Any,
    *,
    columns: Sequence[str] | None = None,
    optional: Sequence[str] = (),
    units: Mapping[str, str] | None = None,
    time: str | None = None,
    rename: Mapping[str, str] | None = None,
    between: tuple[float, float] | None = None,
    sampling_rate: float | None = None,
    table: str | None = None,
    max_bytes: float | None = None,
    at_limit: Sequence[str] = (),
) -> xr.Dataset:
    """Read a measurement, check it, and convert it to SI units.

    Parameters
    ----------
    source : path, pandas or xarray object, mapping of names to arrays, or TimeResponseData
        A text table (``.csv``, ``.txt``, ``.tsv``, ``.dat``, ``.asc``, ``.lvm``) with a header of
        names and units, such as ``x [mm]``, ``x (mm)`` or ``x/mm``; a MATLAB file of any version,
        HDF5, NPZ or WAV; TDMS and UFF 58 with the extra ``[io]``. A mapping is read as an NPZ
        file of these arrays, as is an array with named fields.
    columns : sequence of str, optional
        The channels to read; all by default. What a group holds is called ``group/name``, or
        ``name`` alone where that is clear.
    optional : sequence of str, optional
        Channels that are read beside `columns` if the file holds them.
    units : mapping of str to str, optional
        Units of channels whose file has none, or other ones; a factor may precede the unit:
        ``{"channel_1": "2.5 mm"}``. A channel without a unit is kept as it is.
    time : str, optional
        Name of the time channel; by default what is called time, t, Zeit, timestamp and the like.
        Dates and times of day (``2024-05-03T12:00:00.001``) count from the first.
    rename : mapping of str to str, optional
        New names by old ones; all other arguments go by the new names.
    between : (float, float), optional
        First and last time in s to be read, on the clock of the file.
    sampling_rate : float, optional
        In Hz, for files without time.
    table : str, optional
        Matrix or group to read, in files that hold several.
    max_bytes : float, optional
        Largest size of a file in bytes, and of what it unpacks to; 1e9 by default.
    at_limit : sequence of str, optional
        Channels that may stay at a limit, such as commands: they get a note instead of an error.

    Returns
    -------
    xarray.Dataset
        Channels over ``time`` in s, uniform, each with its SI unit in ``attrs["units"]`` ("" if
        unknown). ``attrs["notes"]`` tells what was filled in, resampled or left out, and
        which channels never change.

    Raises
    ------
    InvalidInputError
        If the file is missing, damaged, empty or of an unknown kind; if a column is missing; if
        time does not rise or has a long gap; if a channel has long gaps, text, infinities, or is
        clipped; if a unit is unknown. The message names file, channel, and sample or
        line.
    MissingDependencyError
        If the format needs the extra ``[io]``.

    Examples
    --------
    >>> import pandas as pd
    >>> import robustpolish as rp
    >>> frame = pd.DataFrame({"Time (ms)": [0, 1, 2], "disp [um]": [0.0, 2.0, 1.0]})
    >>> data = rp.read_measurement(frame, rename={"disp": "x"})
    >>> data["x"].values, data["x"].attrs["units"]
    (array([0.e+00, 2.e-06, 1.e-06]), 'm')
    """
    how: dict[str, Any] = {"units": units, "time": time, "rename": rename, "table": table}
    how |= {"sampling_rate": sampling_rate, "max_bytes": max_bytes}
    raw, stamps, channels = signals_over_time(source, columns, optional, **how)
    kept = _kept(raw, stamps, channels, between)
    axis = uniform_time(stamps[kept], raw.clock or "time")
    taken = stamps[kept] if axis.taken is None else axis.taken
    lines = None if raw.lines is None else raw.lines[kept]
    data: dict[str, Any] = {}
    notes = [*raw.notes, axis.note]
    for column, whole in channels.items():
        given = whole[kept]
        check_finite(column, np.where(np.isnan(given), 0.0, given), taken)  # gaps may stay, so far
        values, note = fill_gaps(column, given, taken, lines)
        check_finite(column, values, taken)
        limit = ""
        if column not in at_limit:
            check_not_clipped(column, values)
        elif share := share_at_limit(values):
            limit = f"{column}: at a limit in {share:.1%} of its samples, taken as it is"
        unit = raw.units.get(raw.resolve("column", column), "")
        values, unit = to_si(values, unit, f"unit of {column!r}")
        data[column] = ("time", axis.move(values), {"units": unit})
        still = f"{column}: {values[0]:.6g} throughout" if np.ptp(values) == 0 else ""
        notes += [note, still, limit, axis.interpolation_warning(column, values)]
    dataset = xr.Dataset(data, coords={"time": ("time", axis.time, {"units": "s"})})
    dataset.attrs["notes"] = list(filter(None, notes))
    if isinstance(source, str | Path):
        dataset.attrs["source"] = str(source)
    return dataset


def signals_over_time(
    source: Any,
    columns: Sequence[str] | None,
    optional: Sequence[str] = (),
    *,
    units: Mapping[str, str] | None = None,
    time: str | None = None,
    rename: Mapping[str, str] | None = None,
    sampling_rate: float | None = None,
    table: str | None = None,
    max_bytes: float | None = None,
) -> tuple[RawTable, Vector, dict[str, Vector]]:
    """Return a source's table, its stamps in s and its channels as they are, unchecked."""
    raw = raw_table(source, table, max_bytes)
    raw.rename(rename or {})
    for column, unit in (units or {}).items():
        if not isinstance(unit, str):
            raise invalid(f"units[{column!r}]", unit, "text such as 'mm'", "Quote it.")
    raw.units.update({raw.resolve("units", column): unit for column, unit in (units or {}).items()})
    raw.clock = find_time(raw, time) if raw.columns else None
    if columns is not None:
        wanted = [columns] if isinstance(columns, str) else list(columns)
        there = [n for n in optional if n not in wanted and raw.holds(n)]
        columns = [*wanted, *there] or list(optional)
    stamps = _stamps(raw, raw.clock, sampling_rate)
    return raw, stamps, _channels(raw, columns, raw.clock, stamps.size)


def _stamps(raw: RawTable, name: str | None, sampling_rate: float | None) -> Vector:
    """Return the times in s at which the samples were taken, as the file says."""
    if not raw.columns:
        raise misfit("measurement", "no channels", "signals", "Check the file.")
    if name is not None and sampling_rate is None:
        stamps = seconds(raw, name)
        told = raw.sampling_rate
        step = float(np.median(np.diff(stamps))) if stamps.size > 1 else 0.0
        if told and step > 0 and abs(step * told - 1) > _CLOCKS_AGREE:
            raw.notes.append(
                f"{name} has a step of {step:.6g} s, where the head of the file gives "
                f"{told:.6g} Hz: the steps are used"
            )
        return stamps
    rate = raw.sampling_rate if sampling_rate is None else sampling_rate
    if rate is None:
        shown = f"no channel of that name among {', '.join(raw.columns)}"
        remedy = "Pass time=NAME or sampling_rate=HZ."
        raise misfit("time", shown, "a time channel or a sampling rate", remedy)
    step = 1 / positive("sampling_rate", rate, "Hz")
    lengths = [np.size(values) for column, values in raw.columns.items() if column != name]
    length = max(set(lengths), key=lengths.count, default=0)
    if length < 2:
        raise misfit("measurement", f"{length} samples", "two or more", "Record longer.")
    return raw.start + step * np.arange(length, dtype=np.float64)


def _channels(
    raw: RawTable, columns: Sequence[str] | None, time: str | None, length: int
) -> dict[str, Vector]:
    """Return the signals by the names that they are wanted under, with a note for what is none."""
    found: dict[str, Any] = {}
    if columns is None:
        for name, values in raw.columns.items():
            if name == time:
                continue
            if is_text(values):
                raw.notes.append(f"left out: {name}, which is text")
            elif np.shape(values) != (length,):
                raw.notes.append(f"left out: {name}, which is not as long as the time")
            elif is_count(name) and _counts(values):
                raw.notes.append(f"left out: {name}, which numbers the samples")
            else:
                found[name] = values
    else:
        found = {name: raw.columns[raw.resolve("column", name)] for name in columns}
    channels = {name: numeric(name, given) for name, given in found.items()}
    for name, values in channels.items():
        if values.shape != (length,):
            want = f"{length} samples, like the time"
            raise misfit(name, f"shape {values.shape}", want, "Check the file.")
    if not channels:
        shown = "no channel beside the time"
        raise misfit("measurement", shown, "one channel or more", "Check the file.")
    return channels


def _counts(values: Any) -> bool:
    array = np.asarray(values)
    return array.dtype.kind in "iuf" and bool(np.all(np.diff(array) == 1))


def _kept(
    raw: RawTable,
    stamps: Vector,
    channels: Mapping[str, Vector],
    between: tuple[float, float] | None,
) -> slice:
    """Return the samples to be used: those asked for, from where all channels have values."""
    first, last = 0, stamps.size
    if between is not None:
        try:
            start, end = (float(edge) for edge in between)
        except (TypeError, ValueError):
            remedy = "Pass two times in s."
            raise invalid("between", between, "(START, END)", remedy) from None
        inside = np.flatnonzero((stamps >= start) & (stamps <= end))
        if inside.size < 2:
            shown = f"{inside.size} samples from {start:.6g} to {end:.6g} s"
            ends = f"{np.min(stamps, initial=np.inf):.6g} to {np.max(stamps, initial=-np.inf):.6g}"
            raise misfit("between", shown, f"a part of the record, {ends} s", "Choose another.")
        first, last = int(inside[0]), int(inside[-1]) + 1
    if last - first > 2:
        before, behind = ends_without_values([values[first:last] for values in channels.values()])
        if before + behind and last - first - before - behind > 2:
            where = [f"the first {before}"] * bool(before) + [f"the last {behind}"] * bool(behind)
            raw.notes.append(f"cut off, as a channel has no value there: {' and '.join(where)}")
            first, last = first + before, last - behind
    return slice(first, last)
