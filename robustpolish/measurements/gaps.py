"""Missing values: short gaps filled, with a note, and long ones refused."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import make_interp_spline

from robustpolish.arrays import Vector
from robustpolish.validation import described, invalid

LONGEST_GAP = 5
"""Missing samples that may be filled in one after the other: a curve through the samples around
them is then a guess within the shape of the signal, and beyond that an invention."""

_MISSING = 0.02
"""Share of a channel that may be filled in."""


def runs(marked: np.ndarray) -> list[tuple[int, int]]:
    """Return first and last number of each run of marked samples.

    Examples
    --------
    >>> runs(np.array([True, False, True, True]))
    [(0, 0), (2, 3)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def ends_without_values(channels: Sequence[Vector]) -> tuple[int, int]:
    """Return how many samples at the beginning and the end lack a value in any channel.

    Only a few at either end are counted; what is longer is a gap like any other.
    """
    first = last = 0
    for values in channels:
        there = np.flatnonzero(~np.isnan(values))
        if there.size:
            first = max(first, int(there[0]) if there[0] <= LONGEST_GAP else 0)
            behind = values.size - 1 - int(there[-1])
            last = max(last, behind if behind <= LONGEST_GAP else 0)
    return first, last


def fill_gaps(
    name: str, values: Vector, time: Vector, lines: np.ndarray | None = None
) -> tuple[Vector, str]:
    """Fill short gaps of a channel by cubic interpolation over time.

    Parameters
    ----------
    name : str
    values : ndarray, shape (samples,)
        NaN where a value is missing.
    time : ndarray, shape (samples,)
        In s.
    lines : ndarray of int, optional
        Line of the file by sample.

    Returns
    -------
    values : ndarray
    note : str
        What was filled in, or "".

    Raises
    ------
    InvalidInputError
        If a gap is too long, or too much is missing.

    Examples
    --------
    >>> values, note = fill_gaps("x", np.array([0, 1, np.nan, 3, 4.0]), np.arange(5.0))
    >>> note
    'x: 1 missing value filled in by cubic interpolation (at sample 2)'
    """
    missing = np.isnan(values)
    if not missing.any():
        return values, ""
    gaps = runs(missing)
    longest = max(gaps, key=lambda gap: gap[1] - gap[0])
    count = int(missing.sum())
    if longest[1] - longest[0] >= LONGEST_GAP or count > max(_MISSING * values.size, 1):
        first, last = longest
        when = f"{time[first]:.6g} to {time[last]:.6g} s"
        long = last - first + 1
        raise invalid(
            name,
            described(
                f"{count} missing value{'s' if count > 1 else ''}, the longest gap of {long} at "
                f"{_places([longest], lines)} ({when})"
            ),
            f"gaps of at most {LONGEST_GAP} samples, {100 * _MISSING:.0f} % of the record in all",
            f"Read what lies before or behind with between=(START, END), or leave {name!r} out "
            "with columns=.",
        )
    there = ~missing
    degree = min(3, int(there.sum()) - 1)
    filled = values.copy()
    filled[missing] = make_interp_spline(time[there], values[there], k=degree)(time[missing])
    what = f"{count} missing value{'s' if count > 1 else ''}"
    return filled, f"{name}: {what} filled in by cubic interpolation (at {_places(gaps, lines)})"


def _places(gaps: Sequence[tuple[int, int]], lines: np.ndarray | None) -> str:
    """Say where gaps are, in lines of the file if they are known."""
    word = "sample" if lines is None else "line"
    number = (lambda i: i) if lines is None else (lambda i: int(lines[i]))
    shown = [f"{number(a)}" if a == b else f"{number(a)} to {number(b)}" for a, b in gaps[:3]]
    more = f" and {len(gaps) - 3} more" if len(gaps) > 3 else ""
    several = "s" if len(gaps) > 1 or gaps[0][0] != gaps[0][1] else ""
    return f"{word}{several} {', '.join(shown)}{more}"
