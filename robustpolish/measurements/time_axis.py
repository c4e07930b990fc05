"""A uniform time axis, with small gaps and jitter mended and large ones refused."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator, make_interp_spline

from robustpolish.arrays import Vector
from robustpolish.validation import described, invalid

# Shares of the sampling time.
_ROUNDING = 1e-3  # stamps this close to a uniform grid are one, rounded
_JITTER = 0.3  # more than this is no jitter
# Shares of the record, and samples.
_MISSING = 0.02
_LONGEST_GAP = 10
_LATEST = 1e30  # s; squares of later times overflow


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
    """

    time: Vector
    taken: Vector | None = None
    note: str = ""

    def move(self, values: Vector) -> Vector:
        """Bring a signal to the uniform grid."""
        if self.taken is None:
            return values
        if self.taken.size < 8:
            return np.asarray(PchipInterpolator(self.taken, values)(self.time))
        return np.asarray(make_interp_spline(self.taken, values, k=3)(self.time))


def uniform_time(time: Vector, name: str = "time") -> UniformTime:
    """Return the uniform grid that `time` is meant to be.

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
        If time does not rise everywhere, jitters by more than 30 % of the sampling time, has a
        gap of more than 10 samples, or misses more than 2 % of the samples.

    Examples
    --------
    >>> import numpy as np
    >>> uniform_time(np.array([0.0, 0.1, 0.2, 0.4, 0.5, 0.6])).note
    '1 missing sample filled in at 1 place, by cubic interpolation'
    """
    _check_rising(time, name)
    steps = np.diff(time)
    step = float(np.median(steps))
    with np.errstate(over="ignore"):
        counts = np.maximum(np.rint(steps / step), 1)
    missing = float(np.sum(counts)) + 1 - time.size
    _check_gaps(time, steps, counts, missing, name)
    # With many rounded stamps the median is a rounded step: fit a line through all of them.
    number = np.concatenate([[0.0], np.cumsum(counts)])
    step, start = _line(number, time - time[0])
    worst = float(np.max(np.abs(time - time[0] - start - step * number)))
    exact = worst <= _ROUNDING * step
    grid = time[0] + (0.0 if exact else start) + step * np.arange(int(number[-1]) + 1)
    exact = exact or worst <= 0.51 * _resolution(time)
    if exact and not missing:
        return UniformTime(grid)
    if not exact and worst > _JITTER * step:
        raise invalid(
            name,
            described(f"time steps from {steps.min():.4g} to {steps.max():.4g} s"),
            f"steps within {_JITTER:.0%} of {step:.4g} s",
            "Resample the record, or record it at a fixed rate.",
        )
    if exact and missing:
        return UniformTime(grid, grid[number.astype(int)], _gap_note(counts, missing))
    note = f"time jittered by up to {worst:.3g} s ({worst / step:.0%} of a step): resampled"
    if missing:
        note += f"; {_gap_note(counts, missing)}"
    # Only times inside the record can be interpolated.
    grid = grid[(grid >= time[0]) & (grid <= time[-1])]
    return UniformTime(grid, time, note)


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
    falls = np.flatnonzero(np.diff(time) <= 0)
    if falls.size:
        i = int(falls[0]) + 1
        raise invalid(
            name,
            described(f"{time[i]:.9g} s after {time[i - 1]:.9g} s, at sample {i}"),
            "a time that rises from sample to sample",
            "Sort the record, remove repeated samples or cut it there.",
        )


def _check_gaps(time: Vector, steps: Vector, counts: Vector, missing: float, name: str) -> None:
    if counts.max() - 1 > _LONGEST_GAP or missing > _MISSING * time.size + 1:
        i = int(np.argmax(steps))
        raise invalid(
            name,
            described(
                f"{missing:.4g} missing samples, the longest gap {steps[i]:.4g} s "
                f"after {time[i]:.6g} s"
            ),
            f"no gap of more than {_LONGEST_GAP} samples and at most {_MISSING:.0%} missing",
            "Cut the record into its unbroken parts.",
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
