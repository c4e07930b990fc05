"""Dates and times of day as text, turned into seconds."""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date

import numpy as np

from robustpolish.arrays import Vector

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
    known: dict[tuple[str, ...], int] = {}  # there are few days, and many samples of each
    for i, cell in enumerate(cells):
        found = _STAMP.fullmatch(cell)
        if found is None:
            return i
        kinds = (_has_date(found), found["h"] is not None)
        if i == 0:
            dated, timed = kinds
        if kinds != (dated, timed) or not (dated or timed):
            return i
        if dated:
            written = found.group("y", "m", "d", "y2", "m2", "d2", "between")
            if written not in known:
                day = _ordinal(*written)
                if day is None:
                    return i
                known[written] = day
            days[i] = known[written]
        if timed:
            second = _of_day(found)
            if second is None:
                return i
            seconds[i] = second
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
