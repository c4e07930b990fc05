"""Whether the error of a free run can judge a model at all.

Backlash and stops in lightly damped systems are chaotic: two runs of the true model from nearly
the same start part company, while its parameters may be right to a fraction of a percent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from robustpolish.arrays import Array
from robustpolish.identification.observer.kalman import white_noise
from robustpolish.identification.observer.run import RecordRun, StartedPiece
from robustpolish.identification.record import Record

_TINY = 1e-6
_DIRECTIONS = 3
# Samples over which runs have to stay apart.
_LASTS = 3
# Share of an output's size below which a change matters to nobody, however quiet the sensor.
_VISIBLE = 1e-3


@dataclass(frozen=True)
class Reproducibility:
    """Whether a free run can be repeated at all.

    Attributes
    ----------
    reproducible : bool
        False if a tiny change of the start grows beyond the noise, or the run diverges.
    growth : float
        Largest change of an output over the change at the beginning.
    diverged_after : float or None
        Time in s until the change exceeds the noise.
    reason : str
        In words.
    """

    reproducible: bool
    growth: float
    diverged_after: float | None
    reason: str


def reproducibility(
    run: RecordRun,
    piece: StartedPiece,
    outputs: Array,
    span: float | None = None,
    ahead: bool = False,
) -> Reproducibility:
    """Change the start by a millionth and see whether the runs part by more than the noise.

    Parameters
    ----------
    run : RecordRun
        Free.
    piece : StartedPiece
    outputs : ndarray, shape (samples, ny)
        What is judged: a run from that start, or windows and predictions.
    span : float, optional
        Length of the windows or the horizon in s: only so long do runs have to agree.
    ahead : bool, optional
        Whether these are predictions, which need not hold from the first sample on.

    Returns
    -------
    Reproducibility
    """
    record = piece.record
    diverged = _divergence(outputs[-1:] if ahead else outputs)
    if diverged is not None:
        after = diverged * record.dt
        return Reproducibility(
            False,
            np.inf,
            after,
            f"the free run diverges after {after:.4g} s: its error judges nothing; "
            "compare in windows, or check the signs of the model's damping and stiffness",
        )
    if not piece.start.vector.size:
        return Reproducibility(True, 0.0, None, "")
    length = record.samples
    if span is not None:
        length = min(length, max(round(span / record.dt), 2))
    size = np.std(record.Y, axis=0)
    size = np.where(size > 0, size, 1.0)
    change = _largest_change(run, StartedPiece(record.part(0, length), piece.start), size)
    beyond = np.flatnonzero(~(change <= max(_noise(record, size), _VISIBLE)))
    growth = float(np.max(change) / _TINY) if np.isfinite(change).all() else np.inf
    if not beyond.size:
        reason = _drift_note(run, record) if span is None else ""
        return Reproducibility(True, growth, None, reason)
    after = float(beyond[0] * record.dt)
    advice = "look ahead" if ahead else f"compare in windows shorter than {after:.3g} s"
    return Reproducibility(
        False,
        growth,
        after,
        f"the free run is not reproducible: a change of the start by a millionth grows beyond the "
        f"noise within {after:.4g} s, so that its error judges nothing; {advice}",
    )


def _noise(record: Record, size: Array) -> float:
    """Return the noise of the quietest output, as a share of its size."""
    if record.samples < 64:  # too few for a spectrum
        return 0.0
    return min(
        white_noise(y, record.dt, record.honest) / s for y, s in zip(record.Y.T, size, strict=True)
    )


def _divergence(outputs: Array) -> int | None:
    bad = np.flatnonzero(~np.isfinite(outputs).all(axis=1))
    return int(bad[0]) if bad.size else None


def _largest_change(run: RecordRun, piece: StartedPiece, size: Array) -> Array:
    """Largest change of an output, as a share of its size, over a few directions.

    What lasts less than three samples does not count: where friction turns round, an acceleration
    jumps, and which sample is the first after the jump decides no more.
    """
    base = run.over(piece, keep=True)
    every = np.hstack([base.states, base.internal])
    with np.errstate(over="ignore"):  # a run may be about to diverge
        typical = np.std(every, axis=0)
    typical = np.maximum(typical, 1e-3 * np.max(np.abs(every), axis=0))
    typical[run.run.system.states :] = 0.0  # the memory of an effect follows from the motion
    start = piece.start.vector
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (_DIRECTIONS, start.size))
    change = np.zeros(len(every))
    for sign in signs:
        moved = piece.start.with_vector(start + _TINY * sign * typical)
        other = run.over(StartedPiece(piece.record, moved)).outputs
        with np.errstate(invalid="ignore", over="ignore"):
            change = np.maximum(change, np.max(np.abs(other - base.outputs) / size, axis=1))
    if change.size < _LASTS:
        return change
    held = np.pad(change, (_LASTS - 1, 0), mode="reflect")
    held = np.pad(held, (0, _LASTS - 1), mode="edge")
    least = np.min(sliding_window_view(held, _LASTS), axis=1)
    return np.max(sliding_window_view(least, _LASTS), axis=1)


def _drift_note(run: RecordRun, record: Record) -> str:
    """Warn of a plant that integrates, whose free run sums up every small error."""
    if not run.run.system.states:
        return ""
    poles = np.linalg.eigvals(run.run.system.A)
    slow = np.abs(poles) * record.samples * record.dt < 1e-3
    if slow.any() and float(np.max(np.abs(poles))) > 0:
        return "the model integrates: a free run sums up small errors; windows judge it better"
    return ""
