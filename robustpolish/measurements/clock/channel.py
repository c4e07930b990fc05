"""Which column is the time, and what it says in seconds."""

from __future__ import annotations

from typing import Any

import numpy as np

from robustpolish.arrays import Vector
from robustpolish.measurements.headers import rank_as_time
from robustpolish.measurements.quality import check_finite, numeric
from robustpolish.measurements.raw import RawTable
from robustpolish.measurements.stamps import ClockTimes, clock_times, is_clock_text
from robustpolish.measurements.units import to_si
from robustpolish.validation import described, invalid

_CALENDAR = 1e8
"""Seconds beyond which a clock counts from an epoch, not from the start of a record: three years.
Doubles of that size leave too few digits for the steps of a fast clock."""


def find_time(raw: RawTable, wanted: str | None) -> str | None:
    """Return the name of the time channel, None if there is none.

    Raises
    ------
    InvalidInputError
        If `wanted` is not there, or several groups of a file have a time of their own.
    """
    if wanted is not None:
        return raw.resolve("time", wanted)
    ranks = {name: rank for name in raw.columns if (rank := rank_as_time(name)) is not None}
    if not ranks:
        dates = [name for name, values in raw.columns.items() if _is_stamped(values)]
        return dates[0] if len(dates) == 1 else None
    best = [name for name, rank in ranks.items() if rank == min(ranks.values())]
    groups = {name.rpartition("/")[0] for name in best}
    if len(best) > 1 and len(groups) == len(best) and "" not in groups:
        raise invalid(
            "measurement",
            described(f"{len(groups)} groups with a time of their own"),
            f"one of them to be chosen; the file holds {raw.listed()}",
            f"Pass table=, one of {', '.join(sorted(groups))}.",
        )
    return best[0]


def seconds(raw: RawTable, name: str) -> Vector:
    """Return the stamps of the time channel in s; dates and large clocks from their first one.

    Raises
    ------
    InvalidInputError
        If they are not numbers, dates or times of day, or in a unit that is none of time.
    """
    values = np.asarray(raw.columns[name]).reshape(-1)
    if values.dtype.kind in "mM":
        return _since_first(values)
    if values.dtype.kind in "US" or (values.dtype == object and _is_stamped(values)):
        return _from_text(raw, name, values)
    stamps = numeric(name, values)
    check_finite(name, stamps)
    stamps, unit = to_si(stamps, raw.units.get(name, "") or "s", f"unit of {name!r}")
    if unit != "s":
        raise invalid(f"unit of {name!r}", unit, "a unit of time", "Correct the header.")
    if stamps.size and abs(stamps[0]) > _CALENDAR:
        raw.notes.append(f"time counts from its first stamp, {stamps[0]:.3f} s")
        stamps = stamps - stamps[0]
    return stamps


def is_text(values: Any) -> bool:
    """Return whether a column holds text or dates, and no numbers."""
    return np.asarray(values).dtype.kind in "USmM" or _is_stamped(values)


def _is_stamped(values: Any) -> bool:
    """Whether a column begins with a date or a time of day."""
    array = np.asarray(values).reshape(-1)
    if array.dtype.kind == "M":
        return True
    if array.dtype.kind not in "UO" or not array.size or not isinstance(array[0], str):
        return False
    return is_clock_text(str(array[0]))


def _since_first(values: np.ndarray) -> Vector:
    if values.dtype.kind == "M" and values.size:
        values = values - values[0]
    return values / np.timedelta64(1, "ns") * 1e-9


def _from_text(raw: RawTable, name: str, values: np.ndarray) -> Vector:
    found = _read(raw, name, values)
    others = [
        other
        for other, column in raw.columns.items()
        if other != name and is_text(column) and _is_stamped(column)
    ]
    days, clock = found.days, found
    for other in others:
        beside = _read(raw, other, np.asarray(raw.columns[other]).reshape(-1))
        if found.seconds is None and beside.days is None:
            clock = beside  # the column that was chosen holds the dates, this one the hours
        elif days is None and beside.seconds is None:
            days = beside.days
    unit = raw.units.get(name, "")
    raw.notes.append(f"time counts from {values[0]}{f' {unit}' if unit else ''}")
    return clock.since_first(days)


def _read(raw: RawTable, name: str, values: np.ndarray) -> ClockTimes:
    found = clock_times(values.astype(str).tolist())
    if isinstance(found, ClockTimes):
        return found
    raise invalid(
        name,
        described(f"{str(values[found])!r} at {raw.place(found)}"),
        "dates or times of day of one kind, such as 2024-05-03T12:00:00.001",
        "Mend the stamp, or cut the record there.",
    )
