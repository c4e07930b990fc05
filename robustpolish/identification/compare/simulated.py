"""One record, simulated: in a free run, in windows, or as predictions over a horizon."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from robustpolish.arrays import Array
from robustpolish.identification.compare.fine_run import fine_run
from robustpolish.identification.compare.horizon import predict
from robustpolish.identification.observer.missing_force import observed_motion
from robustpolish.identification.observer.reproducibility import (
    Reproducibility,
    reproducibility,
)
from robustpolish.identification.observer.run import RecordRun, Start, StartedPiece, free_run, rest
from robustpolish.identification.observer.starts import (
    fitted_start,
    lengths,
    state_sizes,
    visible_sizes,
)
from robustpolish.identification.record import Record, long_enough
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.validation import described, invalid


class Simulated(NamedTuple):
    """One record, simulated: its outputs, the pieces they are made of, and the first to judge."""

    record: Record
    outputs: Array
    pieces: list[StartedPiece]
    first: int
    found: Reproducibility

    @property
    def starts(self) -> Array:
        """State at the first sample of each piece."""
        return np.array([piece.start.vector for piece in self.pieces])


def simulated_record(run: RecordRun, record: Record, method: str, span: float | None) -> Simulated:
    """Simulate one record in the way that was asked for."""
    skip = 0
    if method == "prediction" and span is not None:
        simulated, first = predict(run, long_enough(run.model, record), span)
        pieces = [first]
        skip = int(np.argmin(np.isnan(simulated[:, 0])))  # before the first prediction
    else:
        stretches = _stretches(run, record, span)
        pieces, sizes = _started(run, record, stretches)
        run, pieces = fine_run(
            run, pieces, sizes, lambda finer: _started(finer, record, stretches)[0]
        )
        simulated = np.concatenate([run.over(piece).outputs for piece in pieces])
    whole = StartedPiece(record, pieces[0].start)
    found = reproducibility(run, whole, simulated, span, method == "prediction")
    return Simulated(record, simulated, pieces, skip, found)


def free_runs(model: MechanicalModel, record: Record) -> list[Simulated]:
    """Return free runs over each of several records, from starts of their own."""
    run = free_run(model, record)
    return [simulated_record(run, part, "free run", None) for part in record.parts]


def free_run_error(model: MechanicalModel, record: Record) -> tuple[Array, bool]:
    """Return the error of each output in a free run from an estimated start, as `compare` has it.

    Parameters
    ----------
    model : MechanicalModel
    record : Record
        Of several records each is run from a start of its own.

    Returns
    -------
    error : ndarray, shape (ny,)
        Root mean square; infinite where the run diverges.
    reproducible : bool
        Whether the runs can be repeated; if not, their error judges nothing.
    """
    found = free_runs(model, record)
    with np.errstate(over="ignore", invalid="ignore"):
        left = record.Y - np.concatenate([part.outputs for part in found])
        error = np.sqrt(np.mean(left**2, axis=0))
    calm = all(part.found.reproducible for part in found)
    return np.where(np.isfinite(error), error, np.inf), calm


def _started(
    run: RecordRun, record: Record, stretches: list[tuple[int, int]]
) -> tuple[list[StartedPiece], Array]:
    """Return stretches of a record with the starts that suit a model best, and sizes of states."""
    model, still = run.model, rest(run.model)
    observed = None if run.linear else observed_motion(model, record)
    linear = run if run.linear else free_run(model.without_effects(), record)
    unmoved = rest(linear.model)
    pieces, sizes = [], np.zeros(0)
    for first, last in stretches:
        part, guesses = record.part(first, last), [still]
        # the linear part of a model with effects says something over a short stretch only
        seen = part if run.linear else part.part(0, lengths(part.samples)[0])
        sizes = visible_sizes(linear, seen, unmoved)
        if not run.linear:
            of_linear = fitted_start(linear, seen, [unmoved], sizes)
            guesses.append(Start(of_linear.state, still.internal))
            sizes = state_sizes(model, sizes)
        if observed is not None:
            guesses.append(observed.start(model, first))
        pieces.append(StartedPiece(part, fitted_start(run, part, guesses, sizes)))
    return pieces, sizes


def _stretches(run: RecordRun, record: Record, window: float | None) -> list[tuple[int, int]]:
    """First and last sample of each free run; a short rest belongs to the last one."""
    if window is None:
        return [(0, record.samples)]
    length = round(window / record.dt)
    least = rest(run.model).vector.size + 1
    if length < least or length > record.samples:
        raise invalid(
            "window",
            described(f"{window} s, {length} samples"),
            f"{least} to {record.samples} samples of {record.dt:.6g} s",
            "Choose a window of a few periods.",
        )
    edges = [*range(0, record.samples - length + 1, length), record.samples]
    # A rest shorter than half a window would be judged on its start alone.
    if len(edges) > 2 and edges[-1] - edges[-2] > length + length // 2:
        edges.insert(-1, edges[-2] + length)
    return list(pairwise(edges))
