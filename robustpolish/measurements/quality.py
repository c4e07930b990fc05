"""Whether a channel can be used at all."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from robustpolish.validation import described, invalid

Vector = NDArray[np.float64]


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
    (few slopes), coarse steps of a converter (no overshoot of more than a few steps is foregone),
    and pulses that rest at zero.
    """
    cut, share = 0, 0.0
    for sign in (1, -1):
        runs, samples = _plateaus(sign * values)
        cut += runs
        share += samples / values.size
    if cut >= 2:
        raise invalid(
            name,
            described(f"{cut} plateaus at the ends of its range ({share:.1%} of the samples)"),
            "a signal that is not clipped",
            "Lower the amplitude or widen the range of the sensor and record again.",
        )


def _plateaus(values: Vector) -> tuple[int, int]:
    """Count the plateaus at the maximum that were run into at speed, and their samples."""
    top = values.max()
    span = top - values.min()
    distinct = np.unique(values)
    slopes = np.unique(np.round(np.diff(values) / span, 6))
    if top == 0 or distinct.size < 30 or slopes.size < 30:
        return 0, 0
    quantum = float(np.min(np.diff(distinct)))
    at_top = values >= top - 1e-9 * span
    edges = np.flatnonzero(np.diff(np.concatenate([[False], at_top, [False]]).astype(np.int8)))
    runs, samples = 0, 0
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if last - first < 3:
            continue
        overshoot = max(
            _foregone(values, first - 1, -1, quantum), _foregone(values, last, 1, quantum)
        )
        if overshoot > 0:
            runs += 1
            samples += int(last - first)
    return runs, samples


def _foregone(values: Vector, near: int, away: int, quantum: float) -> float:
    """How far the signal would have gone beyond the plateau, from its speed beside it."""
    far = near + away
    if not (0 <= near < values.size and 0 <= far < values.size):
        return 0.0
    speed = values[near] - values[far]
    beyond = values[near] + 2 * speed - values[near - away]
    return float(beyond) if speed > 0 and beyond > max(0.5 * speed, 3 * quantum) else 0.0
