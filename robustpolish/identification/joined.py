"""Several records in one dataset: one behind the other, each with its name and its own time.

The time of the joined dataset runs on, so that it can be drawn and cut as any other. Its
coordinates say to which record a sample belongs, and when it was on that record's own clock.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from robustpolish.measurements import decimate, holds_frequency_response, sampling_time
from robustpolish.validation import described, invalid

_RECORD, _OWN_TIME = "record", "own_time"

_SAME_RATE = 1e-4
"""Relative difference of sampling rates that the rounding of times may make."""


def named_records(data: Any) -> dict[str, Any]:
    """Return the records that a user gave, by name.

    Parameters
    ----------
    data : xarray.Dataset, path or pandas.DataFrame, or a sequence or mapping of them
        In a sequence files go by their names, all others are called "record 1" and so on. A
        joined dataset is taken apart.

    Returns
    -------
    dict
        In the order given.

    Raises
    ------
    InvalidInputError
        If there is no record at all, or something that is none.
    """
    if isinstance(data, xr.Dataset):
        return taken_apart(data)
    if isinstance(data, Mapping):
        found = {str(name): record for name, record in data.items()}
    elif isinstance(data, list | tuple):
        found = dict(zip(_names(data), data, strict=True))
    else:
        return {_name(0): data}
    if not found:
        remedy = "Pass a record, or a list of them."
        raise invalid("data", described("no record at all"), "one or more", remedy)
    for name, record in found.items():
        if holds_frequency_response(record):
            shown = described(f"frequency responses as {name!r}")
            remedy = "Pass frequency responses alone, all pairs in one array."
            raise invalid("data", shown, "records over time", remedy)
        if not isinstance(record, xr.Dataset | pd.DataFrame | str | Path):
            shown = described(f"{type(record).__name__} as {name!r}")
            raise invalid("data", shown, "datasets, tables or paths", "Read it first.")
    return found


def _names(records: list[Any] | tuple[Any, ...]) -> list[str]:
    numbered = [_name(i) for i in range(len(records))]
    told = [
        Path(record).stem if isinstance(record, str | Path) else number
        for record, number in zip(records, numbered, strict=True)
    ]
    return told if len(set(told)) == len(told) else numbered


def _name(index: int) -> str:
    return f"record {index + 1}"


def taken_apart(data: xr.Dataset) -> dict[str, xr.Dataset]:
    """Return the records of a joined dataset by name, each over its own time again.

    Parameters
    ----------
    data : xarray.Dataset
        A dataset that is not joined is one record.

    Returns
    -------
    dict of str to xarray.Dataset
    """
    if not {_RECORD, _OWN_TIME} <= set(data.coords) or data[_RECORD].dims != ("time",):
        return {_name(0): data}
    labels = data[_RECORD].values
    begins = np.flatnonzero(np.append(True, labels[1:] != labels[:-1]))
    found = {}
    for begin, end in zip(begins, [*begins[1:], labels.size], strict=True):
        part = data.isel(time=slice(int(begin), int(end)))
        time = ("time", part[_OWN_TIME].values, dict(data["time"].attrs))
        found[str(labels[begin])] = part.drop_vars([_RECORD, _OWN_TIME]).assign_coords(time=time)
    return found


def joined(records: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return records one behind the other.

    Parameters
    ----------
    records : mapping of str to xarray.Dataset
        Over uniform ``time``, of one sampling step.

    Returns
    -------
    xarray.Dataset
        The only record as it is. Of several the channels that all have, over a ``time`` that runs
        on, with the coordinates ``record`` (name) and ``own_time``.

    Examples
    --------
    >>> import xarray as xr
    >>> small = xr.Dataset({"x": ("time", [0.0, 1.0])}, {"time": [0.0, 0.1]})
    >>> both = joined({"small": small, "large": 5 * small})
    >>> both["x"].values.tolist(), both["record"].values.tolist()
    ([0.0, 1.0, 0.0, 5.0], ['small', 'small', 'large', 'large'])
    >>> taken_apart(both)["large"]["time"].values.tolist()
    [0.0, 0.1]
    """
    first, *others = records.values()
    if not others:
        return first
    shared = [
        name
        for name, channel in first.data_vars.items()
        if channel.dims == ("time",) and all(name in other for other in others)
    ]
    step, begin = sampling_time(first), float(first["time"].values[0])
    sizes = [data.sizes["time"] for data in records.values()]
    time = begin + step * np.arange(sum(sizes))
    own = np.concatenate([np.asarray(d["time"].values, dtype=float) for d in records.values()])
    coordinates = {
        "time": ("time", time, {"units": "s"}),
        _RECORD: ("time", np.repeat(list(records), sizes)),
        _OWN_TIME: ("time", own, {"units": "s"}),
    }
    channels = {
        name: (
            "time",
            np.concatenate([data[name].values for data in records.values()]),
            first[name].attrs,
        )
        for name in shared
    }
    notes = [f"{name}: {note}" for name, d in records.items() for note in d.attrs.get("notes", ())]
    return xr.Dataset(channels, coordinates, {**first.attrs, "notes": notes})


def of_one_step(records: Mapping[str, xr.Dataset]) -> dict[str, xr.Dataset]:
    """Return the records sampled alike, at the step of the slowest.

    Parameters
    ----------
    records : mapping of str to xarray.Dataset

    Returns
    -------
    dict of str to xarray.Dataset
        Faster ones are decimated, with a note.

    Raises
    ------
    InvalidInputError
        If a rate is no whole multiple of the lowest.
    """
    steps = {name: sampling_time(data) for name, data in records.items()}
    slowest = max(steps, key=lambda name: steps[name])
    found = {}
    for name, data in records.items():
        times = steps[slowest] / steps[name]
        if abs(times / round(times) - 1) > _SAME_RATE:
            rate, least = 1 / steps[name], 1 / steps[slowest]
            raise invalid(
                "data",
                described(f"{name!r} sampled at {rate:.6g} Hz, {slowest!r} at {least:.6g} Hz"),
                "one sampling rate, or whole multiples of the lowest",
                "Resample one of them, or use the records apart.",
            )
        found[name] = data if round(times) == 1 else decimate(data, 1 / steps[slowest])
    return found
