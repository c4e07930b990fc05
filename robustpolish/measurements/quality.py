"""Whether a channel can be used at all."""

from __future__ import annotations

from typing import Any

import numpy as np

from robustpolish.arrays import Vector
from robustpolish.validation import described, invalid


def numeric(name: str, values: Any) -> Vector:
    """Return a channel as floats, or refuse text, complex numbers and what is no number."""
    array = np.asarray(values)
    if array.dtype.kind == "c":
        raise invalid(name, described("complex numbers"), "a real signal", "Take one part of it.")
    try:
        return array.astype(float)
    except (TypeError, ValueError):
        for i, item in enumerate(array.reshape(-1)):
            try:
                float(item)
            except (TypeError, ValueError):
                shown = described(f"{str(item)!r} at sample {i}")
                raise invalid(name, shown, "numbers", "Remove the text.") from None
        raise invalid(name, described("no numbers"), "numbers", "Check the column.") from None


def check_finite(name: str, values: Vector, time: Vector | None = None) -> None:
    """Refuse a channel with NaN or infinity, naming the first."""
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        i = int(bad[0])
        when = "" if time is None or not np.isfinite(time[i]) else f" ({time[i]:.6g} s)"
        more = f" and {bad.size - 1} more" if bad.size > 1 else ""
        raise invalid(
            name,
            described(f"{values[i]} at sample {i}{when}{more}"),
            "finite numbers",
            "Cut the record there, or leave the samples out: short gaps are filled.",
        )


def check_moves(name: str, values: Vector) -> None:
    """Refuse a channel that never changes."""
    if np.ptp(values) == 0:
        raise invalid(
            name,
            described(f"{values[0]:.6g} throughout"),
            "a signal that changes",
            "Check the sensor, or leave the channel out with columns=.",
        )


def check_not_clipped(name: str, values: Vector) -> None:
    """Refuse a channel that was cut off at the end of its range.

    A clipped signal runs into its largest or smallest value at full speed and stays there. That
    leaves alone what rests at its extremes by nature: square waves (few values), ramps with holds
    (few slopes), smooth holds (the signal slows down first), the flat tops of a coarse converter
    (likewise), and pulses that rest at zero.
    """
    plateaus = clipped_plateaus(values)
    if plateaus:
        share = sum(plateaus) / values.size
        raise invalid(
            name,
            described(f"{len(plateaus)} plateaus at the ends of its range, {share:.1%} of it"),
            "a signal that is not clipped",
            "Lower the amplitude or widen the range of the sensor and record again.",
        )


def clipped_plateaus(values: Vector) -> list[int]:
    """Return the lengths of the plateaus that a cut left at the ends of a channel's range.

    Empty if there is but one short plateau, which may be chance.
    """
    plateaus = [length for sign in (1, -1) for length in _plateaus(sign * values)]
    return plateaus if len(plateaus) >= 2 or sum(plateaus) >= 8 else []


def _plateaus(values: Vector) -> list[int]:
    """Lengths of the plateaus at the maximum that were run into, or left, at full speed."""
    top = values.max()
    span = top - values.min()
    distinct = np.unique(values)
    if top == 0 or distinct.size < 30:
        return []
    quantum = float(np.min(np.diff(distinct)))
    at_top = values >= top - 1e-9 * span
    edges = np.flatnonzero(np.diff(np.concatenate([[False], at_top, [False]]).astype(np.int8)))
    found = [
        int(last - first)
        for first, last in zip(edges[::2], edges[1::2], strict=True)
        if last - first >= 3
        and all(
            _at_full_speed(top - beside, int(last - first), quantum)
            for beside in (values[:first][::-1], values[last:])
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
