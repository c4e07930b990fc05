"""Runs in steps so fine that these are no visible part of the error that is judged."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from robustpolish.arrays import Array
from robustpolish.identification.observer.closest import closest, squares, weights_of
from robustpolish.identification.observer.run import RecordRun, StartedPiece

# Share of the error of an output that steps may be: 2 % of its root mean square, if they add up as
# squares do. And the share of the output's size below which nobody sees what they are.
_OF_ERROR = 0.2
_FAINT = 1e-4
_MOST = 64


def fine_run(
    run: RecordRun,
    pieces: Sequence[StartedPiece],
    sizes: Array,
    search: Callable[[RecordRun], Sequence[StartedPiece]],
) -> tuple[RecordRun, list[StartedPiece]]:
    """Return a run in finer steps where steps make a visible part of the error, and its starts.

    The model is to be judged, not the steps: those that searches can afford are rough for quiet
    sensors. The error never rises.

    Parameters
    ----------
    run : RecordRun
        Free.
    pieces : sequence of StartedPiece
        With starts that suit the run.
    sizes : ndarray, shape (n,)
        Of the states, as of :func:`~robustpolish.identification.observer.starts.fitted_start`.
    search : callable
        Gives the pieces with starts that suit a run, from nothing, for one so different that these
        starts are lost.

    Returns
    -------
    run : RecordRun
        As it was where finer steps change nothing, or where runs part whatever the steps.
    pieces : list of StartedPiece
    """
    finest = None if run.linear else _fine_enough(run, pieces)
    if finest is None or finest is run:
        return run, list(pieces)
    longest = max((piece.record for piece in pieces), key=lambda record: record.samples)
    weights = weights_of(longest)

    def left(of: RecordRun, started: Sequence[StartedPiece]) -> float:
        return sum(squares(of, started, longest.samples, weights))

    found = list(pieces)
    if sizes.size:
        found = closest(finest, pieces, longest.samples, sizes, weights)
        if left(finest, found) > left(run, pieces):
            found = list(search(finest))
    return (finest, found) if left(finest, found) <= left(run, pieces) else (run, list(pieces))


def _fine_enough(run: RecordRun, pieces: Sequence[StartedPiece]) -> RecordRun | None:
    """Return the run with as many steps as show no more; None if all that are tried do."""
    measured = np.concatenate([piece.record.Y for piece in pieces])
    size = np.std(measured, axis=0)
    faint = _FAINT * np.where(size > 0, size, 1.0)
    outputs = run.over_all(pieces).outputs
    least = _mean_size(measured - outputs)
    while run.runner.substeps < _MOST and np.isfinite(least).all():
        finer = run.finer()
        other = finer.over_all(pieces).outputs
        least = np.minimum(least, _mean_size(measured - other))
        if np.max(_mean_size(other - outputs) / np.maximum(least, faint)) <= _OF_ERROR:
            return run
        run, outputs = finer, other
    return None


def _mean_size(signals: Array) -> Array:
    """Return the root mean square of each column; not finite where a run diverges."""
    with np.errstate(over="ignore", invalid="ignore"):
        return np.sqrt(np.mean(signals**2, axis=0))
