"""Predictions over a horizon, from states that an observer takes from the outputs before it."""

from __future__ import annotations

import numpy as np

from robustpolish.arrays import Array
from robustpolish.identification.observer.missing_force import observed
from robustpolish.identification.observer.run import RecordRun, Start, StartedPiece, rest
from robustpolish.identification.record import Record
from robustpolish.validation import described, invalid


def predict(run: RecordRun, record: Record, horizon: float) -> tuple[Array, StartedPiece]:
    """Return predictions, and the record with the start that the observer began with.

    Each prediction is a free run of the model over the horizon. The observer may take a part of
    the motion for the work of an unknown force; that force is not carried into the prediction,
    which judges the model alone.

    Parameters
    ----------
    run : RecordRun
        The model, free.
    record : Record
    horizon : float
        In s; at least one sample.

    Returns
    -------
    outputs : ndarray, shape (samples, ny)
        NaN over the first horizon.
    start : StartedPiece
    """
    ahead = max(1, round(horizon / record.dt))
    if ahead >= record.samples:
        raise invalid(
            "horizon",
            described(f"{horizon} s, {ahead} samples"),
            f"less than the record, {record.samples} samples",
            "Choose a shorter one.",
        )
    still = StartedPiece(record, rest(run.model))
    if not still.start.vector.size:
        return run.over(still).outputs, still
    seen = observed(run.model, record)
    if not np.isfinite(seen.outputs).all():
        raise invalid(
            "model",
            described("a model whose observer diverges on these data"),
            "one that can follow them",
            "Compare in short windows, or check its stiffness and damping.",
        )
    n = run.run.system.states

    def started(k: int, end: int) -> StartedPiece:
        return StartedPiece(record.part(k, end), Start(seen.states[k, :n], seen.internal[k]))

    outputs = np.full(record.Y.shape, np.nan)
    for k in range(record.samples - ahead):
        outputs[k + ahead] = run.over(started(k, k + ahead + 1)).outputs[-1]
    return outputs, started(0, record.samples)
