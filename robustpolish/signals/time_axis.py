"""The time of a record: which column it is, what its stamps say, and a uniform grid."""

from __future__ import annotations

import functools
import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.interpolate import PchipInterpolator, make_interp_spline

from robustpolish.base.arrays import SAME, Vector
from robustpolish.base.checks import invalid, misfit
from robustpolish.signals.raw import (
    LONGEST_GAP,
    MISSING,
    RawTable,
    check_finite,
    numeric,
    rank_as_time,
    to_si,
)

# A uniform time axis: irregular clocks resampled with a note, long gaps refused.

# Shares of the sampling time.
_ROUNDING = 1e-3  # stamps this close to a uniform grid are one, rounded
_JITTER = 0.3  # more than this is a clock without a rate of its own
_UNRESOLVED = 0.1  # of a channel's own size: between the samples it is a guess
_LATEST = 1e30  # s; squares of later times overflow
_LONG_PART = 20  # samples; shorter parts between gaps are not worth reading


@dataclass(frozen=True, eq=False)
class UniformTime:
    """A uniform grid and, if samples have to be moved to it, where they were taken.

    Attributes
    ----------
    time : ndarray, shape (samples,)
        Uniform, in s.
    taken : ndarray or None
        Original times if the signals have to be interpolated.
    note : str
        What was wrong, or "".
    irregular : bool
        Whether the clock had no rate of its own, so that the grid is a choice.
    """

    time: Vector
    taken: Vector | None = None
    note: str = ""
    irregular: bool = False

    def move(self, values: Vector) -> Vector:
        """Bring a signal to the uniform grid."""
        return values if self.taken is None else _interpolate_cubic(self.taken, values, self.time)

    def interpolation_warning(self, name: str, values: Vector) -> str:
        """Say so if a signal changes too fast for an irregular clock, "" if it does not.

        The samples with odd numbers are predicted from those with even ones, as those between the
        samples are from all of them; the error of a smooth signal falls by 16 at half the step.
        """
        if not self.irregular or self.taken is None or values.size < 40:
            return ""
        guessed = _interpolate_cubic(self.taken[::2], values[::2], self.taken[1:-1:2])
        missed = float(np.sqrt(np.mean((values[1:-1:2] - guessed) ** 2)))
        size = float(np.std(values))
        if missed <= _UNRESOLVED * size:
            return ""
        return (
            f"{name} changes fast for its irregular clock: every second sample predicts the others "
            f"to {100 * missed / size:.0f} % only; record it faster or at a fixed rate"
        )


def _interpolate_cubic(taken: Vector, values: Vector, time: Vector) -> Vector:
    """Interpolate a signal by cubic polynomials."""
    if taken.size < 8:
        return np.asarray(PchipInterpolator(taken, values)(time))
    return np.asarray(make_interp_spline(taken, values, k=3)(time))


def uniform_time(time: Vector, name: str = "time") -> UniformTime:
    """Return the uniform grid that `time` is meant to be.

    Stamps that scatter by up to 30 % of a step about a fixed rate keep that rate, and single
    samples that are missing are filled in. An irregular clock, of whatever kind, gets a grid of
    as many samples as it took.

    Parameters
    ----------
    time : ndarray, shape (samples,)
        Time stamps in s.
    name : str, optional
        What the messages call them.

    Returns
    -------
    UniformTime

    Raises
    ------
    InvalidInputError
        If time does not rise everywhere, or has a gap of more than a few samples; the message
        lists the unbroken parts.

    Examples
    --------
    >>> import numpy as np
    >>> uniform_time(np.array([0.0, 0.1, 0.2, 0.4, 0.5, 0.6])).note
    '1 missing sample filled in at 1 place, by cubic interpolation'
    """
    _check_rising(time, name)
    steps = np.diff(time)
    step = float(np.median(steps))
    _check_gaps(time, steps, name)
    with np.errstate(over="ignore"):
        counts = np.maximum(np.rint(steps / step), 1)
    missing = float(np.sum(counts)) + 1 - time.size
    if missing > max(MISSING * time.size, 1):
        return _irregular(time, steps)
    # With many rounded stamps the median is a rounded step: fit a line through all of them.
    number, since = np.concatenate([[0.0], np.cumsum(counts)]), time - time[0]
    about = number - number.mean()
    step = float(about @ since / (about @ about))
    start = float(since.mean() - step * number.mean())
    worst = float(np.max(np.abs(since - start - step * number)))
    exact = worst <= _ROUNDING * step
    grid = time[0] + (0.0 if exact else start) + step * np.arange(int(number[-1]) + 1)
    exact = exact or worst <= 0.51 * _resolution(time)
    if not (exact or worst <= _JITTER * step):
        return _irregular(time, steps)
    gaps = ""
    if missing:
        places = int(np.count_nonzero(counts > 1))
        gaps = (
            f"{missing:.0f} missing sample{'s' if missing > 1 else ''} filled in at {places} "
            f"place{'s' if places > 1 else ''}, by cubic interpolation"
        )
    if exact:
        return UniformTime(grid, grid[number.astype(int)] if missing else None, gaps)
    share = f"{worst:.3g} s ({100 * (worst / step):.0f} % of a step)"
    note = f"time jittered by up to {share}: resampled{f'; {gaps}' if gaps else ''}"
    # Only times inside the record can be interpolated.
    return UniformTime(grid[(grid >= time[0]) & (grid <= time[-1])], time, note)


def _irregular(time: Vector, steps: Vector) -> UniformTime:
    """Return a grid of as many samples for a clock without a rate of its own."""
    grid = np.linspace(time[0], time[-1], time.size)
    note = (
        f"irregular clock, steps from {steps.min():.3g} to {steps.max():.3g} s (median "
        f"{np.median(steps):.3g} s): resampled at {(time.size - 1) / (time[-1] - time[0]):.6g} Hz "
        "by cubic interpolation"
    )
    return UniformTime(grid, time, note, irregular=True)


def _check_rising(time: Vector, name: str) -> None:
    if time.size < 2:
        shown = f"{time.size} sample{'' if time.size == 1 else 's'}"
        raise misfit(name, shown, "two samples or more", "Record longer.")
    largest = float(np.max(np.abs(time)))
    if not largest < _LATEST:
        raise misfit(name, f"{largest:.3g} s", "a time in s", "Check its unit.")
    steps = np.diff(time)
    # less than this is the same time: no curve through both is a signal
    falls = np.flatnonzero(steps <= SAME * max(float(np.median(steps)), 0.0))
    if falls.size:
        i = int(falls[0]) + 1
        shown = f"{time[i]:.9g} s after {time[i - 1]:.9g} s, at sample {i}"
        remedy = "Sort the record, remove repeated samples or cut it there."
        raise misfit(name, shown, "a time that rises from sample to sample", remedy)


def _check_gaps(time: Vector, steps: Vector, name: str) -> None:
    typical = max(float(np.median(steps)), float(np.mean(steps)))
    gaps = np.flatnonzero(steps > (LONGEST_GAP + 1.5) * typical)
    if not gaps.size:
        return
    i = int(gaps[np.argmax(steps[gaps])])
    edges = np.concatenate([[-1], gaps, [time.size - 1]])
    parts = [(a + 1, b) for a, b in pairwise(edges.tolist()) if b - a >= _LONG_PART]
    longest = sorted(sorted(parts, key=lambda part: part[0] - part[1])[:4])
    listed = ", ".join(f"{time[a]:.6g} to {time[b]:.6g} s" for a, b in longest)
    remedy = f"Read an unbroken part with between=(START, END): {listed}."
    shown = (
        f"{gaps.size} gap{'s' if gaps.size > 1 else ''}, the longest of {steps[i]:.4g} s "
        f"after {time[i]:.6g} s, with steps of {np.median(steps):.4g} s"
    )
    want = f"no gap of more than {LONGEST_GAP} samples"
    raise misfit(name, shown, want, remedy if parts else "Record at a fixed rate.")


def _resolution(time: Vector) -> float:
    """Return the decimal place that the time stamps were rounded to, in s, or 0."""
    for digits in range(9):
        scaled = time * 10.0**digits
        noise = 4 * np.spacing(np.max(np.abs(scaled)))
        if np.max(np.abs(scaled - np.rint(scaled))) <= noise + 1e-9:
            return 10.0**-digits
    return 0.0


# Dates and times of day as text, turned into seconds.

_DAY = 86400
_DATE = (
    r"(?:(?P<y>\d{4})[-/.](?P<m>\d{1,2})[-/.](?P<d>\d{1,2})"
    r"|(?P<d2>\d{1,2})(?P<between>[./-])(?P<m2>\d{1,2})(?P=between)(?P<y2>\d{4}))"
)
_CLOCK = r"(?P<h>\d{1,2}):(?P<min>\d{2})(?::(?P<s>\d{2}(?:[.,:]\d+)?))?\s*(?P<half>[AaPp][Mm])?"
_ZONE = r"(?P<zone>[Zz]|UTC|GMT|(?P<sign>[+-])(?P<zh>\d{2}):?(?P<zm>\d{2})?)"
_PLAIN = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(?::\d\d(?:\.\d{1,9})?)?")
_STAMP = re.compile(rf"\s*(?:{_DATE})?(?:(?<=\d)[Tt]|\s*)(?:{_CLOCK})?\s*{_ZONE}?\s*")


@dataclass(frozen=True, eq=False)
class ClockTimes:
    """Stamps in seconds.

    Attributes
    ----------
    days : ndarray of int or None
        Days of the calendar; None if the stamps name none.
    seconds : ndarray or None
        Seconds since midnight, of universal time if the stamps name a zone; None for dates alone.
    """

    days: np.ndarray | None
    seconds: Vector | None

    def since_first(self, days: np.ndarray | None = None) -> Vector:
        """Return seconds since the first stamp.

        Parameters
        ----------
        days : ndarray of int, optional
            Days from another column, for stamps that have none. Where there are none at all, a
            clock that falls by more than half a day has passed midnight.
        """
        days = self.days if self.days is not None else days
        if self.seconds is None:
            assert days is not None, "a stamp is a date, a time of day, or both"
            return (days - days[0]) * float(_DAY)
        since = self.seconds - self.seconds[0]
        if days is not None:
            return since + (days - days[0]) * float(_DAY)
        midnights = np.cumsum(np.diff(self.seconds, prepend=self.seconds[0]) < -_DAY / 2)
        return since + midnights * float(_DAY)


def is_clock_text(text: str) -> bool:
    """Return whether a cell is a date, a time of day or both.

    Examples
    --------
    >>> is_clock_text("2024-05-03T12:00:00.001+02:00"), is_clock_text("3.5"), is_clock_text("")
    (True, False, False)
    """
    found = _STAMP.fullmatch(text)
    return found is not None and (found["h"] is not None or _has_date(found))


def clock_times(cells: Sequence[str]) -> ClockTimes | int:
    """Read stamps of one kind: ISO 8601, ``03.05.2024 12:00:00,001``, a date or a time of day.

    Dates with strokes have the month first unless that is impossible, as in the United States.

    Parameters
    ----------
    cells : sequence of str

    Returns
    -------
    ClockTimes or int
        The number of the first cell that is no stamp, or of another kind than the first one.

    Examples
    --------
    >>> clock_times(["2024-05-03 23:59:59.5", "2024-05-04 00:00:00,5"]).since_first()
    array([0., 1.])
    """
    quick = _plain(cells)
    if quick is not None:
        return quick
    dated = timed = False
    days, seconds = np.zeros(len(cells), dtype=np.int64), np.zeros(len(cells))
    # there are few days, and many samples of each
    ordinal = functools.lru_cache(maxsize=None)(_ordinal)
    for i, cell in enumerate(cells):
        found = _STAMP.fullmatch(cell)
        if found is None:
            return i
        kinds = (_has_date(found), found["h"] is not None)
        if i == 0:
            dated, timed = kinds
        if kinds != (dated, timed) or not any(kinds):
            return i
        day = ordinal(*found.group("y", "m", "d", "y2", "m2", "d2", "between")) if dated else 0
        second = _of_day(found) if timed else 0.0
        if day is None or second is None:
            return i
        days[i], seconds[i] = day, second
    return ClockTimes(days if dated else None, seconds if timed else None)


def _plain(cells: Sequence[str]) -> ClockTimes | None:
    """Read ISO stamps without a zone in one go; None if there are others among them."""
    if not cells or not _PLAIN.fullmatch(cells[0]) or any(len(cell) < 16 for cell in cells):
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # NumPy warns of zones
        try:
            stamps = np.array(cells, dtype="datetime64[ns]")
        except (ValueError, UserWarning, DeprecationWarning):
            return None
    if np.isnat(stamps).any():
        return None
    days = stamps.astype("datetime64[D]")
    return ClockTimes(days.astype(np.int64), (stamps - days) / np.timedelta64(1, "ns") * 1e-9)


def _has_date(found: re.Match[str]) -> bool:
    return found["y"] is not None or found["y2"] is not None


def _ordinal(y: str, m: str, d: str, y2: str, m2: str, d2: str, between: str) -> int | None:
    year, month, day = (int(text) for text in ((y, m, d) if y else (y2, m2, d2)))
    if between == "/" and day <= 12:
        month, day = day, month
    try:
        return date(year, month, day).toordinal()
    except ValueError:
        return None


def _of_day(found: re.Match[str]) -> float | None:
    hour, minute = int(found["h"]), int(found["min"])
    second = float(re.sub("[,:]", ".", found["s"] or "0"))
    if found["half"]:
        hour = hour % 12 + (12 if found["half"].casefold() == "pm" else 0)
    if hour > 24 or minute > 59 or second > 61:
        return None
    ahead = 0
    if found["sign"]:
        ahead = 60 * (60 * int(found["zh"]) + int(found["zm"] or 0))
        ahead = -ahead if found["sign"] == "-" else ahead
    return 3600 * hour + 60 * minute + second - ahead


# Which column is the time, and what it says in seconds.

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
        shown = f"{len(groups)} groups with a time of their own"
        want = f"one of them to be chosen; the file holds {raw.listed()}"
        remedy = f"Pass table=, one of {', '.join(sorted(groups))}."
        raise misfit("measurement", shown, want, remedy)
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
        values = values - values[0] if values.dtype.kind == "M" and values.size else values
        return values / np.timedelta64(1, "ns") * 1e-9
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


def _from_text(raw: RawTable, name: str, values: np.ndarray) -> Vector:
    found = _read(raw, name, values)
    days, clock = found.days, found
    for other, column in raw.columns.items():
        if other == name or not is_text(column) or not _is_stamped(column):
            continue
        beside = _read(raw, other, np.asarray(column).reshape(-1))
        if found.seconds is None and beside.days is None:
            clock = beside  # the column that was chosen holds the dates, this one the hours
        elif days is None and beside.seconds is None:
            days = beside.days
    raw.notes.append(f"time counts from {values[0]} {raw.units.get(name, '')}".rstrip())
    return clock.since_first(days)


def _read(raw: RawTable, name: str, values: np.ndarray) -> ClockTimes:
    found = clock_times(values.astype(str).tolist())
    if isinstance(found, ClockTimes):
        return found
    shown = f"{str(values[found])!r} at {raw.place(found)}"
    want = "dates or times of day of one kind, such as 2024-05-03T12:00:00.001"
    raise misfit(name, shown, want, "Mend the stamp, or cut the record there.")
