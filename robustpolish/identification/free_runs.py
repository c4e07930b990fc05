"""Simulation errors of a model on records: free runs, windows and predictions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import t as student

from robustpolish.base.arrays import Array
from robustpolish.base.checks import described, invalid
from robustpolish.base.results import Table
from robustpolish.identification.observer.runs import (
    InitialState,
    RecordRun,
    Reproducibility,
    StartedPiece,
    free_run,
    reproducibility,
    rest,
)
from robustpolish.identification.observer.starts import (
    StartFit,
    best_observer_run,
    doubling_lengths,
    fitted_start,
    smoothed_motion,
    state_sizes,
    visible_sizes,
)
from robustpolish.identification.record import Record, output_sizes, require_length
from robustpolish.machines.mechanical.data import linear_model
from robustpolish.machines.mechanical.model import MechanicalModel

# Refinement of integration steps until they are no visible part of the error.

# Share of the error of an output that steps may be: 2 % of its root mean square, if they add up as
# squares do. And the share of the output's size below which nobody sees what they are.
_OF_ERROR = 0.2
_FAINT = 1e-4
_MOST = 64


def refine_steps(
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
    finest = None if run.linear else _converged_run(run, pieces)
    if finest is None or finest is run:
        return run, list(pieces)
    rough, fine = (StartFit(of, sizes, pieces) for of in (run, finest))
    found, before = list(pieces), sum(rough.squares(pieces, rough.longest))
    if sizes.size:
        found = fine.refined(pieces, fine.longest)
        if sum(fine.squares(found, fine.longest)) > before:
            found = list(search(finest))
    better = sum(fine.squares(found, fine.longest)) <= before
    return (finest, found) if better else (run, list(pieces))


def _converged_run(run: RecordRun, pieces: Sequence[StartedPiece]) -> RecordRun | None:
    """Return the run with as many steps as show no more; None if all that are tried do."""
    measured = np.concatenate([piece.record.Y for piece in pieces])
    faint = _FAINT * output_sizes(measured)
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


# Predictions over a horizon, from states that an observer takes from the outputs before it.


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
        shown, wanted = f"{horizon} s, {ahead} samples", f"less than the record, {record.samples}"
        raise invalid("horizon", described(shown), f"{wanted} samples", "Choose a shorter one.")
    still = StartedPiece(record, rest(run.model))
    if not still.start.vector.size:
        return run.over(still).outputs, still
    seen = best_observer_run(run.model, record)
    if not np.isfinite(seen.outputs).all():
        shown = described("a model whose observer diverges on these data")
        remedy = "Compare in short windows, or check its stiffness and damping."
        raise invalid("model", shown, "one that can follow them", remedy)
    n = run.run.system.states

    def started(k: int, end: int) -> StartedPiece:
        return StartedPiece(record.part(k, end), InitialState(seen.states[k, :n], seen.internal[k]))

    outputs = np.full(record.Y.shape, np.nan)
    for k in range(record.samples - ahead):
        outputs[k + ahead] = run.over(started(k, k + ahead + 1)).outputs[-1]
    return outputs, started(0, record.samples)


# Simulation of one record: free run, windows, or predictions over a horizon.


class SimulatedPieces(NamedTuple):
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


def simulated_record(
    run: RecordRun, record: Record, method: str, span: float | None
) -> SimulatedPieces:
    """Simulate one record in the way that was asked for."""
    skip = 0
    if method == "prediction" and span is not None:
        simulated, first = predict(run, require_length(run.model, record), span)
        pieces = [first]
        skip = int(np.argmin(np.isnan(simulated[:, 0])))  # before the first prediction
    else:
        stretches = _stretches(run, record, span)
        pieces, sizes = _with_estimated_starts(run, record, stretches)
        run, pieces = refine_steps(
            run, pieces, sizes, lambda finer: _with_estimated_starts(finer, record, stretches)[0]
        )
        simulated = np.concatenate([run.over(piece).outputs for piece in pieces])
    whole = StartedPiece(record, pieces[0].start)
    found = reproducibility(run, whole, simulated, span, method == "prediction")
    return SimulatedPieces(record, simulated, pieces, skip, found)


def free_runs(model: MechanicalModel, record: Record) -> list[SimulatedPieces]:
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
        error = _mean_size(record.Y - np.concatenate([part.outputs for part in found]))
    predictable = all(part.found.reproducible for part in found)
    return np.where(np.isfinite(error), error, np.inf), predictable


def _with_estimated_starts(
    run: RecordRun, record: Record, stretches: list[tuple[int, int]]
) -> tuple[list[StartedPiece], Array]:
    """Return stretches of a record with the starts that suit a model best, and sizes of states."""
    model, still = run.model, rest(run.model)
    observed = None if run.linear else smoothed_motion(model, record)
    linear = run if run.linear else free_run(linear_model(model), record)
    unmoved = rest(linear.model)
    pieces, sizes = [], np.zeros(0)
    for first, last in stretches:
        part, guesses = record.part(first, last), [still]
        # the linear part of a model with effects says something over a short stretch only
        seen = part if run.linear else part.part(0, doubling_lengths(part.samples)[0])
        sizes = visible_sizes(linear, seen, unmoved)
        if not run.linear:
            of_linear = fitted_start(linear, seen, [unmoved], sizes)
            guesses.append(InitialState(of_linear.state, still.internal))
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
        wanted = f"{least} to {record.samples} samples of {record.dt:.6g} s"
        shown, remedy = f"{window} s, {length} samples", "Choose a window of a few periods."
        raise invalid("window", described(shown), wanted, remedy)
    edges = [*range(0, record.samples - length + 1, length), record.samples]
    # A rest shorter than half a window would be judged on its start alone.
    if len(edges) > 2 and edges[-1] - edges[-2] > length + length // 2:
        edges.insert(-1, edges[-2] + length)
    return list(pairwise(edges))


# The errors of a model's outputs, and of one record among several.


@dataclass(frozen=True)
class OutputError:
    """The error of one output.

    Attributes
    ----------
    name, unit : str
        Output and its SI unit.
    nrmse : float
        Norm of the error over the norm of the measured signal without its mean.
    rmse : float
        Root of the mean squared error, in `unit`.
    band : (float, float)
        95 % confidence band of `rmse`. It is wide where the error is slow: samples that resemble
        each other count less.
    relative : float
        Norm of the error over the norm of the measured signal with its mean.
    """

    name: str
    unit: str
    nrmse: float
    rmse: float
    band: tuple[float, float]
    relative: float

    @property
    def fit_percent(self) -> float:
        """100 (1 - NRMSE), as in MATLAB: 100 is perfect, 0 no better than the mean."""
        return 100 * (1 - self.nrmse)

    @property
    def fit_band(self) -> tuple[float, float]:
        """95 % confidence band of `fit_percent`."""
        share = self.nrmse / self.rmse if self.rmse else 0.0
        return 100 * (1 - share * self.band[1]), 100 * (1 - share * self.band[0])


class ErrorsByOutput:
    """What has errors by output, in one figure."""

    outputs: Mapping[str, OutputError]

    @property
    def nrmse(self) -> float:
        """Root of the mean squared NRMSE of the outputs."""
        return float(np.sqrt(np.mean([error.nrmse**2 for error in self.outputs.values()])))

    @property
    def fit_percent(self) -> float:
        """100 (1 - NRMSE) over all outputs."""
        return 100 * (1 - self.nrmse)


@dataclass(frozen=True, eq=False)
class RecordError(ErrorsByOutput):
    """The errors of one record, which may be one of several.

    Attributes
    ----------
    outputs : dict of str to OutputError
        Errors by output.
    starts : ndarray, shape (runs, n)
        Estimated starts: free displacements, velocities, internal states of effects.
    reproducibility : Reproducibility
        Of the free run over this record.
    """

    outputs: Mapping[str, OutputError]
    starts: np.ndarray
    reproducibility: Reproducibility


def records_table(records: Mapping[str, RecordError]) -> tuple[Table, ...]:
    """Return the errors of several records as a table; none for one alone."""
    if len(records) < 2:
        return ()
    rows = tuple(
        (record, error.name, float(f"{error.fit_percent:.2f}"), error.rmse, error.unit)
        for record, errors in records.items()
        for error in errors.outputs.values()
    )
    return (Table("Record by record", ("record", "output", "fit [%]", "RMS error", "unit"), rows),)


def records_content(records: Mapping[str, RecordError]) -> dict[str, Any]:
    """Return the errors of records as the command line writes them."""
    return {
        name: {
            "nrmse": {output: error.nrmse for output, error in record.outputs.items()},
            "fit_percent": record.fit_percent,
            "reproducible": record.reproducibility.reproducible,
        }
        for name, record in records.items()
    }


# The error figures of one output, and the band of its RMS error.


def output_error(name: str, unit: str, measured: Array, simulated: Array) -> OutputError:
    """Return the error figures of one output; they are infinite where the simulation diverged."""
    with np.errstate(over="ignore", invalid="ignore"):
        square = (measured - simulated) ** 2
    square = np.where(np.isfinite(square), square, np.inf)
    mean_square = float(np.mean(square))
    rmse = float(np.sqrt(mean_square))

    def over(size: float) -> float:
        return rmse / size if size > 0 else (0.0 if rmse == 0 else np.inf)

    width = _mean_square_width(square, mean_square)
    return OutputError(
        name, unit, over(float(np.std(measured))), rmse,
        (rmse * np.exp(-width), rmse * np.exp(width)), over(float(np.sqrt(np.mean(measured**2)))),
    )  # fmt: skip


def _mean_square_width(square: Array, mean: float) -> float:
    """Return half the width of the 95 % band of the logarithm of an RMS value.

    It follows from the scatter of the mean square over long blocks, whose logarithm scatters
    symmetrically enough; Student's t makes up for the small number of blocks.
    """
    blocks = min(20, square.size // 4)
    if blocks < 2 or not np.isfinite(mean) or mean == 0:
        return 0.0
    length = square.size // blocks
    means = square[: blocks * length].reshape(blocks, length).mean(axis=1) / mean
    # Neighbouring blocks that resemble each other count as fewer.
    deviation = means - means.mean()
    total = float(deviation @ deviation)
    alike = float(deviation[1:] @ deviation[:-1]) / total if total > 0 else 0.0
    alike = float(np.clip(alike, 0.0, 0.9))
    spread = float(np.std(means, ddof=1)) / np.sqrt(blocks) * np.sqrt((1 + alike) / (1 - alike))
    return float(student.ppf(0.975, blocks - 1)) * spread / 2  # half: root of the mean square


# The errors of simulated records, over all of them and of each.


def output_errors(
    model: MechanicalModel, found: Sequence[SimulatedPieces]
) -> dict[str, OutputError]:
    """Return the errors of each output over records together."""
    measured = np.concatenate([part.record.Y[part.first :] for part in found])
    simulated = np.concatenate([part.outputs[part.first :] for part in found])
    return {
        item.name: output_error(item.name, model.unit_of(item), measured[:, i], simulated[:, i])
        for i, item in enumerate(model.outputs)
    }


def record_errors(
    model: MechanicalModel, found: Sequence[SimulatedPieces]
) -> dict[str, RecordError]:
    """Return the errors of each record by its name."""
    return {
        part.record.name: RecordError(output_errors(model, [part]), part.starts, part.found)
        for part in found
    }
