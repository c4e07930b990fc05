"""Quality of a record: missing values, clipping and the sampling rate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from scipy.interpolate import make_interp_spline

from robustpolish.base.arrays import Array, Vector
from robustpolish.base.checks import misfit

# Missing values: short gaps filled, with a note, and long ones refused.

LONGEST_GAP = 5
"""Missing samples that may be filled in one after the other: a curve through the samples around
them is then a guess within the shape of the signal, and beyond that an invention."""

_MISSING = 0.02
"""Share of a channel that may be filled in."""


def marked_runs(marked: np.ndarray) -> list[tuple[int, int]]:
    """Return first and last number of each run of marked samples.

    Examples
    --------
    >>> marked_runs(np.array([True, False, True, True]))
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
    gaps, count = marked_runs(missing), int(missing.sum())
    first, last = max(gaps, key=lambda gap: gap[1] - gap[0])
    what = f"{count} missing value{'s' if count > 1 else ''}"
    if last - first >= LONGEST_GAP or count > max(_MISSING * values.size, 1):
        shown = (
            f"{what}, the longest gap of {last - first + 1} at {_places([(first, last)], lines)} "
            f"({time[first]:.6g} to {time[last]:.6g} s)"
        )
        want = f"gaps of at most {LONGEST_GAP} samples, {100 * _MISSING:.0f} % of the record in all"
        remedy = "Read what lies before or behind with between=(START, END), or leave "
        raise misfit(name, shown, want, f"{remedy}{name!r} out with columns=.")
    there = ~missing
    degree = min(3, int(there.sum()) - 1)
    filled = values.copy()
    filled[missing] = make_interp_spline(time[there], values[there], k=degree)(time[missing])
    return filled, f"{name}: {what} filled in by cubic interpolation (at {_places(gaps, lines)})"


def _places(gaps: Sequence[tuple[int, int]], lines: np.ndarray | None) -> str:
    """Say where gaps are, in lines of the file if they are known."""
    word = "sample" if lines is None else "line"
    number = (lambda i: i) if lines is None else (lambda i: int(lines[i]))
    shown = [f"{number(a)}" if a == b else f"{number(a)} to {number(b)}" for a, b in gaps[:3]]
    more = f" and {len(gaps) - 3} more" if len(gaps) > 3 else ""
    several = "s" if len(gaps) > 1 or gaps[0][0] != gaps[0][1] else ""
    return f"{word}{several} {', '.join(shown)}{more}"


def numeric(name: str, values: Any) -> Vector:
    """Return a channel as floats, or refuse text, complex numbers and what is no number."""
    array = np.asarray(values)
    if array.dtype.kind == "c":
        raise misfit(name, "complex numbers", "a real signal", "Take one part of it.")
    try:
        return array.astype(float)
    except (TypeError, ValueError):
        for i, item in enumerate(array.reshape(-1)):
            try:
                float(item)
            except (TypeError, ValueError):
                shown = f"{str(item)!r} at sample {i}"
                raise misfit(name, shown, "numbers", "Remove the text.") from None
        raise misfit(name, "no numbers", "numbers", "Check the column.") from None


def check_finite(name: str, values: Vector, time: Vector | None = None) -> None:
    """Refuse a channel with NaN or infinity, naming the first."""
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        i = int(bad[0])
        when = "" if time is None or not np.isfinite(time[i]) else f" ({time[i]:.6g} s)"
        more = f" and {bad.size - 1} more" if bad.size > 1 else ""
        remedy = "Cut the record there, or leave the samples out: short gaps are filled."
        raise misfit(name, f"{values[i]} at sample {i}{when}{more}", "finite numbers", remedy)


def check_not_clipped(name: str, values: Vector) -> None:
    """Refuse a channel that was cut off at the end of its range.

    A clipped signal runs into its largest or smallest value at full speed and stays there. That
    leaves alone what rests at its extremes by nature: square waves (few values), ramps with holds
    (few slopes), smooth holds (the signal slows down first), the flat tops of a coarse converter
    (likewise), and pulses that rest at zero.
    """
    if plateaus := clipped_plateaus(values):
        share = sum(plateaus) / values.size
        shown = f"{len(plateaus)} plateaus at the ends of its range, {share:.1%} of it"
        remedy = "Record again with a lower amplitude or a wider range of the sensor, or, if it is "
        remedy += f"a command, pass at_limit=[{name!r}]; inputs of a model may stay at a limit."
        raise misfit(name, shown, "a signal that is not clipped", remedy)


def clipped_plateaus(values: Vector) -> list[int]:
    """Return the lengths of the plateaus that a cut left at the ends of a channel's range.

    Empty if there is but one short plateau, which may be chance.
    """
    plateaus = [length for sign in (1, -1) for length in _plateaus(sign * values)]
    return plateaus if len(plateaus) >= 2 or sum(plateaus) >= 8 else []


def share_at_limit(values: Vector) -> float:
    """Return the share of samples at the ends of a channel's range, 0 if no end is a limit."""
    if not clipped_plateaus(values):
        return 0.0
    low, high = values.min(), values.max()
    return float(np.mean(np.minimum(values - low, high - values) <= 1e-9 * (high - low)))


def _plateaus(values: Vector) -> list[int]:
    """Lengths of the plateaus at the maximum that were run into, or left, at full speed."""
    top = values.max()
    span = top - values.min()
    distinct = np.unique(values)
    if top == 0 or distinct.size < 30:
        return []
    quantum = float(np.min(np.diff(distinct)))
    at_top = values >= top - 1e-9 * span
    found = [
        last + 1 - first
        for first, last in marked_runs(at_top)
        if last - first >= 2
        and all(
            _at_full_speed(top - beside, last + 1 - first, quantum)
            for beside in (values[:first][::-1], values[last + 1 :])
            if beside.size >= 8
        )
    ]
    return [] if not found or _has_few_slopes(values, quantum) else found


def _at_full_speed(below: Vector, length: int, quantum: float) -> bool:
    """Whether a signal near its maximum, seen from there, does not slow down towards it.

    `below` is the distance to the maximum at the samples next to a plateau, the nearest first.
    Towards a smooth hold it shrinks with the square of time, so that the last stretch is a third
    of the one before; towards a cut it is at least half of it. A signal that could not have risen
    by some converter steps during the plateau, `length` samples, says nothing.
    """
    reached = np.flatnonzero(below >= 4 * quantum)
    stretch = max(2, int(reached[0]) + 1) if reached.size else below.size
    if 2 * stretch > below.size:
        return False
    near, both = below[stretch - 1], below[2 * stretch - 1]
    risen = near / stretch * length / 2
    return bool(near > 0.42 * (both - near) > 0 and risen > 6 * quantum)


def _has_few_slopes(values: Vector, quantum: float) -> bool:
    """Whether a signal is made of straight lines of at most three slopes."""
    stretch = min(16, values.size // 4)
    rise = values[stretch:] - values[:-stretch]
    inside = (values > values.min()) & (values < values.max())
    rise = rise[inside[stretch:] & inside[:-stretch]]
    if not rise.size:
        return True
    width = max(2 * quantum, 1e-6 * float(np.ptp(values)))
    _, counts = np.unique(np.rint(rise / width), return_counts=True)
    return float(np.sort(counts)[-3:].sum()) > 0.7 * rise.size


# How a record is sampled, and whether that is fast enough for a model.


def sampling_time(data: xr.Dataset) -> float:
    """Return the sampling time in s of a dataset over a uniform ``time``.

    Parameters
    ----------
    data : xarray.Dataset

    Returns
    -------
    float

    Examples
    --------
    >>> import xarray as xr
    >>> sampling_time(xr.Dataset(coords={"time": [0.0, 0.5, 1.0]}))
    0.5
    """
    values: Array = data["time"].values
    return float((values[-1] - values[0]) / (values.size - 1))


def check_sampling(data: xr.Dataset, frequencies: Sequence[float]) -> None:
    """Refuse a record that cannot show a model's modes.

    Parameters
    ----------
    data : xarray.Dataset
        Over ``time``.
    frequencies : sequence of float
        Natural frequencies in Hz that the outputs show.

    Raises
    ------
    InvalidInputError
        If half the sampling rate, the Nyquist frequency, is below the highest of them.

    Examples
    --------
    >>> import xarray as xr
    >>> check_sampling(xr.Dataset(coords={"time": [0.0, 0.01, 0.02]}), [12.0])
    """
    rate = 1 / sampling_time(data)
    highest = float(np.max(frequencies, initial=0.0))
    if highest >= rate / 2:
        want = f"more than {2 * highest:.6g} Hz, for the model's mode at {highest:.6g} Hz"
        remedy = "Sample faster, or leave the mode out of the model."
        raise misfit("sampling rate", f"{rate:.6g} Hz", want, remedy)
