"""A uniform time axis: irregular clocks resampled with a note, long gaps refused."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import PchipInterpolator, make_interp_spline

from robustpolish.arrays import Vector
from robustpolish.measurements.gaps import LONGEST_GAP
from robustpolish.validation import described, invalid

# Shares of the sampling time.
_ROUNDING = 1e-3  # stamps this close to a uniform grid are one, rounded
_JITTER = 0.3  # more than this is a clock without a rate of its own
_NO_STEP = 1e-9  # less than this is the same time: no curve through both is a signal
# Shares of the record.
_MISSING = 0.02  # more than this is no lost sample here and there
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
        return values if self.taken is None else _through(self.taken, values, self.time)

    def doubt(self, name: str, values: Vector) -> str:
        """Say so if a signal changes too fast for an irregular clock, "" if it does not.

        The samples with odd numbers are predicted from those with even ones, as those between the
        samples are from all of them; the error of a smooth signal falls by 16 at half the step.
        """
        if not self.irregular or self.taken is None or values.size < 40:
            return ""
        guessed = _through(self.taken[::2], values[::2], self.taken[1:-1:2])
        missed = float(np.sqrt(np.mean((values[1:-1:2] - guessed) ** 2)))
        size = float(np.std(values))
        if missed <= _UNRESOLVED * size:
            return ""
        return (
            f"{name} changes fast for its irregular clock: every second sample predicts the others "
            f"to {100 * missed / size:.0f} % only; record it faster or at a fixed rate"
        )


def _through(taken: Vector, values: Vector, time: Vector) -> Vector:
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
    # With many rounded stamps the median is a rounded step: fit a line through all of them.
    number = np.concatenate([[0.0], np.cumsum(counts)])
    if missing > max(_MISSING * time.size, 1):
        return _irregular(time, steps)
    step, start = _line(number, time - time[0])
    worst = float(np.max(np.abs(time - time[0] - start - step * number)))
    exact = worst <= _ROUNDING * step
    grid = time[0] + (0.0 if exact else start) + step * np.arange(int(number[-1]) + 1)
    exact = exact or worst <= 0.51 * _resolution(time)
    if exact and not missing:
        return UniformTime(grid)
    if not (exact or worst <= _JITTER * step):
        return _irregular(time, steps)
    if exact:
        return UniformTime(grid, grid[number.astype(int)], _gap_note(counts, missing))
    note = (
        f"time jittered by up to {worst:.3g} s ({100 * (worst / step):.0f} % of a step): resampled"
    )
    if missing:
        note += f"; {_gap_note(counts, missing)}"
    # Only times inside the record can be interpolated.
    grid = grid[(grid >= time[0]) & (grid <= time[-1])]
    return UniformTime(grid, time, note)


def _irregular(time: Vector, steps: Vector) -> UniformTime:
    """Return a grid of as many samples for a clock without a rate of its own."""
    grid = np.linspace(time[0], time[-1], time.size)
    note = (
        f"irregular clock, steps from {steps.min():.3g} to {steps.max():.3g} s (median "
        f"{np.median(steps):.3g} s): resampled at {(time.size - 1) / (time[-1] - time[0]):.6g} Hz "
        "by cubic interpolation"
    )
    return UniformTime(grid, time, note, irregular=True)


def _gap_note(counts: Vector, missing: float) -> str:
    gaps = int(np.count_nonzero(counts > 1))
    samples = f"{missing:.0f} missing sample{'s' if missing > 1 else ''}"
    places = f"{gaps} place{'s' if gaps > 1 else ''}"
    return f"{samples} filled in at {places}, by cubic interpolation"


def _check_rising(time: Vector, name: str) -> None:
    if time.size < 2:
        shown = described(f"{time.size} sample{'' if time.size == 1 else 's'}")
        raise invalid(name, shown, "two samples or more", "Record longer.")
    largest = float(np.max(np.abs(time)))
    if not largest < _LATEST:
        raise invalid(name, described(f"{largest:.3g} s"), "a time in s", "Check its unit.")
    steps = np.diff(time)
    falls = np.flatnonzero(steps <= _NO_STEP * max(float(np.median(steps)), 0.0))
    if falls.size:
        i = int(falls[0]) + 1
        raise invalid(
            name,
            described(f"{time[i]:.9g} s after {time[i - 1]:.9g} s, at sample {i}"),
            "a time that rises from sample to sample",
            "Sort the record, remove repeated samples or cut it there.",
        )


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
    raise invalid(
        name,
        described(
            f"{gaps.size} gap{'s' if gaps.size > 1 else ''}, the longest of {steps[i]:.4g} s "
            f"after {time[i]:.6g} s, with steps of {np.median(steps):.4g} s"
        ),
        f"no gap of more than {LONGEST_GAP} samples",
        remedy if parts else "Record at a fixed rate.",
    )


def _line(x: Vector, y: Vector) -> tuple[float, float]:
    """Return slope and intercept of the least-squares line."""
    about = x - x.mean()
    slope = float(about @ y / (about @ about))
    return slope, float(y.mean() - slope * x.mean())


def _resolution(time: Vector) -> float:
    """Return the decimal place that the time stamps were rounded to, in s, or 0."""
    relative = time - time[0]
    for digits in range(9):
        scaled = time * 10.0**digits
        noise = 4 * np.spacing(np.max(np.abs(time)) * 10.0**digits)
        if np.max(np.abs(scaled - np.rint(scaled))) <= noise + 1e-9 and np.ptp(relative) > 0:
            return 10.0**-digits
    return 0.0
