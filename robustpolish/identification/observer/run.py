"""A model run over a record: freely, or led by the data; and the start that is closest to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robustpolish.arrays import Array
from robustpolish.identification.observer.kalman import (
    FREE,
    Gain,
    Level,
    Scales,
    amplitude_of,
    excited_bandwidth,
    observer_gain,
    with_missing_force,
)
from robustpolish.identification.record import Record
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.data import MechanicalData
from robustpolish.models.mechanical.ports import dynamic_effects
from robustpolish.simulation.run import NonlinearResponse, Stepper
from robustpolish.simulation.system import NonlinearSystem, build_system, needed_substeps


@dataclass(frozen=True, eq=False)
class Start:
    """State of a model at the first sample of a record: mechanical and internal."""

    state: Array
    internal: Array

    @property
    def vector(self) -> Array:
        """Free displacements, their velocities, then internal states of the effects."""
        return np.concatenate([self.state, self.internal])

    def with_vector(self, vector: Array) -> Start:
        """Return a start with other values."""
        return Start(vector[: self.state.size], vector[self.state.size :])


@dataclass(frozen=True, eq=False)
class StartedPiece:
    """A contiguous piece of record and the state at its first sample."""

    record: Record
    start: Start


class Runner:
    """Makes models ready to run, led by the data at one level.

    The steps per sample and the observer's gain are chosen once, for the model it is made with,
    and kept for all models that are tried with it.

    Parameters
    ----------
    model : MechanicalModel
    dt : float
        Sampling step in s.
    amplitude : float
        Displacement amplitude in m or rad; decides on the steps.
    level : Level, optional
        Free by default.
    scales : Scales, optional
        Needed for every level but the free one.
    """

    def __init__(
        self,
        model: MechanicalModel,
        dt: float,
        amplitude: float,
        level: Level = FREE,
        scales: Scales | None = None,
    ) -> None:
        self.dt, self.level = dt, level
        self.substeps = needed_substeps(model, dt, amplitude)
        self._leak = None if level.free or scales is None else scales.leak
        self._moves_inputs = any(e.definition.domain == "input" for e in model.effects)
        self._inputs: tuple[tuple[object, object], Array] | None = None
        self.gain: Gain | None = None
        if self._leak is not None and scales is not None:
            self.gain = observer_gain(self._system(model), dt, level, scales)

    def run(self, model: MechanicalModel) -> RecordRun:
        """Return a model ready to run."""
        return RecordRun(self, model, Stepper(model, self._system(model), self.dt, self.substeps))

    def _system(self, model: MechanicalModel) -> NonlinearSystem:
        plain = build_system(model, self.dt / self.substeps)
        return plain if self._leak is None else with_missing_force(model, plain, self._leak)

    def inputs(self, model: MechanicalModel, record: Record) -> Array:
        """Return the model's input signals over a record, shape (samples, signals)."""
        key = (record.sets, model if self._moves_inputs else None)
        known = self._inputs
        if known is None or any(a is not b for a, b in zip(known[0], key, strict=True)):
            known = self._inputs = (key, record.signals(model))
        return record.own(known[1])


@dataclass(frozen=True, eq=False)
class RecordRun:
    """A model ready to be run again and again, from any start over any piece of record."""

    runner: Runner
    model: MechanicalModel
    run: Stepper

    @property
    def linear(self) -> bool:
        """Whether no effect makes a force."""
        return not self.run.system.effects

    def over(self, piece: StartedPiece, keep: bool = False) -> NonlinearResponse:
        """Return what the model predicts for a piece of record.

        Parameters
        ----------
        piece : StartedPiece
        keep : bool, optional
            Whether the states are wanted too; those of a run that the data lead end with the
            missing forces.

        Returns
        -------
        NonlinearResponse
        """
        record, start, gain = piece.record, piece.start, self.runner.gain
        state = np.zeros(self.run.system.states)
        state[: start.state.size] = start.state
        inputs = self.runner.inputs(self.model, record)
        if gain is None:
            return self.run.over(inputs, state, start.internal, record.time, keep=keep)
        return self.run.over(
            inputs, state, start.internal, record.time, record.Y, gain.filter, keep
        )

    def over_all(self, pieces: Sequence[StartedPiece], keep: bool = False) -> NonlinearResponse:
        """Return what the model predicts for several pieces, one after the other in the arrays."""
        if self.runner.gain is not None:
            runs = [self.over(piece, keep) for piece in pieces]
            return NonlinearResponse(*(np.concatenate(part) for part in zip(*runs, strict=True)))
        starts = np.zeros((len(pieces), self.run.system.states))
        for row, piece in zip(starts, pieces, strict=True):
            row[: piece.start.state.size] = piece.start.state
        return self.run.over_pieces(
            np.concatenate([self.runner.inputs(self.model, p.record) for p in pieces]),
            starts,
            np.array([p.start.internal for p in pieces]).reshape(len(pieces), -1),
            np.concatenate([p.record.time for p in pieces]),
            np.cumsum([0, *(p.record.samples for p in pieces)]),
            keep,
        )

    def all_errors(self, pieces: Sequence[StartedPiece]) -> Array:
        """Return measured minus predicted outputs of several pieces, shape (samples, ny)."""
        measured = np.concatenate([piece.record.Y for piece in pieces])
        return measured - self.over_all(pieces).outputs

    def errors(self, piece: StartedPiece) -> Array:
        """Return measured minus predicted outputs, shape (samples, ny)."""
        return piece.record.Y - self.over(piece).outputs


def free_run(model: MechanicalModel, record: Record) -> RecordRun:
    """Return a model ready to run freely over a record."""
    amplitude = 0.0
    if model.effects:
        amplitude = amplitude_of(model, record, excited_bandwidth(model, record))
    return Runner(model, record.dt, amplitude).run(model)


def rest(model: MechanicalData) -> Start:
    """Return a start at rest."""
    internal = sum(effect.definition.states for _, effect in dynamic_effects(model))
    return Start(np.zeros(2 * len(model.free)), np.zeros(internal))


_ROUNDS = 8
_STEP = 1e-4
_SHORTEST = 50
# Samples of the very first stretches of unknown starts: a spring that stiffens may swing several
# times over what its linear part takes for one swing.
_BRIEFEST = 6
# Times the mean square error with which a start is still tried beside the best, how many are, the
# relative difference below which two are the same, and the rise over a longer stretch that noise
# does not make: then the start is lost.
_RIVAL = 4.0
_RIVALS = 2
_SAME = 1e-6
_LOST = 1.5
# Relative fall with which the start of a stretch is good enough for the next one.
_ROUGHLY = 1e-2


def fitted_start(run: RecordRun, record: Record, guesses: Sequence[Start], sizes: Array) -> Start:
    """Find the start from which a free run comes closest to the measured outputs.

    Parameters
    ----------
    run : RecordRun
    record : Record
        All of it is run over.
    guesses : sequence of Start
        Where the search may begin: at the best of them over the first stretch.
    sizes : ndarray, shape (n,)
        What matters of each state: see :func:`state_sizes`, or :func:`visible_sizes`.

    Returns
    -------
    Start
    """
    if not sizes.size:
        return guesses[0]
    pieces, weights = [StartedPiece(record, guess) for guess in guesses], _weights(record)
    if run.linear:
        found = fitted_starts(run, pieces, sizes)
        return min(found, key=lambda piece: _size(run, piece, weights)).start
    spans = lengths(record.samples)
    brief = pieces
    for span in (n for n in (spans[0] // 8, spans[0] // 4, spans[0] // 2) if n >= _BRIEFEST):
        brief = _closest(run, brief, span, sizes, weights, _ROUGHLY)
    search = _Growing(run, sizes, weights, record.samples)
    found = search.best_of(search.over([*pieces, *brief], spans[0]), spans[0])
    for before, span in pairwise(spans):
        found = search.best_of(search.longer(found, before, span), span)
    return found[0].start


@dataclass
class _Growing:
    """A search for the start of one record over stretches that grow.

    Over a stretch twice as long a start may be a wrong phase although it was right over the one
    before: where runs part, as near chaos, what noise left open has grown too far. Then the
    stretch grows by less. Where even that loses the record the model is wrong, not the start.
    """

    run: RecordRun
    sizes: Array
    weights: Array
    longest: int
    hopeless: bool = False

    def over(self, pieces: Sequence[StartedPiece], span: int) -> list[StartedPiece]:
        """Return the pieces, their starts improved over a stretch."""
        settled = 1e-6 if span == self.longest else _ROUGHLY
        return _closest(self.run, pieces, span, self.sizes, self.weights, settled)

    def error(self, piece: StartedPiece, span: int) -> float:
        """Return the mean square error over a stretch."""
        head = StartedPiece(piece.record.part(0, min(span, piece.record.samples)), piece.start)
        return _size(self.run, head, self.weights) / head.record.Y.size

    def best_of(self, pieces: Sequence[StartedPiece], span: int) -> list[StartedPiece]:
        """Return the best piece first, then others that are nearly as good and not the same."""
        errors = [self.error(piece, span) for piece in pieces]
        kept: list[int] = []
        for i in np.argsort(errors, kind="stable").tolist():
            near = errors[i] <= _RIVAL * errors[kept[0]] if kept else True
            if near and all(abs(errors[i] - errors[j]) > _SAME * errors[j] for j in kept):
                kept.append(i)
        return [pieces[i] for i in kept[:_RIVALS]]

    def longer(
        self, pieces: Sequence[StartedPiece], before: int, span: int, halvings: int = 3
    ) -> list[StartedPiece]:
        """Return the pieces over a longer stretch, grown in smaller steps if that loses it."""
        found = self.over(pieces, span)
        middle = round(np.sqrt(before * span))
        if (
            self.hopeless
            or not before < middle < span
            or not self._lost(pieces, before, found, span)
        ):
            return found
        if not halvings:
            self.hopeless = True
            return found
        halfway = self.longer(pieces, before, middle, halvings - 1)
        if self.hopeless:
            return found
        return [*self.longer(halfway, middle, span, halvings - 1), *found]

    def _lost(
        self, pieces: Sequence[StartedPiece], before: int, after: Sequence[StartedPiece], span: int
    ) -> bool:
        least = min(self.error(piece, before) for piece in pieces)
        return min(self.error(piece, span) for piece in after) > _LOST * least


def fitted_starts(
    run: RecordRun, pieces: Sequence[StartedPiece], sizes: Array
) -> list[StartedPiece]:
    """Return pieces with the starts from which free runs come closest to the measured outputs.

    For a linear model that is one least-squares problem, over the whole of a piece, as in
    MATLAB's ``compare``. With effects it is solved by damped Gauss-Newton steps on stretches that
    grow twofold: errors over a short stretch depend smoothly on the start even where those over a
    long one do not, and over a long run a wrong start is a wrong phase.

    Parameters
    ----------
    run : RecordRun
    pieces : sequence of StartedPiece
        With the starts at which the search begins.
    sizes : ndarray, shape (n,)
        As of :func:`fitted_start`.
    """
    found = list(pieces)
    if not sizes.size or not found:
        return found
    weights = _weights(max((p.record for p in pieces), key=lambda record: record.samples))
    longest = max(piece.record.samples for piece in pieces)
    for samples in [longest] if run.linear else lengths(longest):
        settled = 1e-6 if samples == longest else _ROUGHLY
        found = _closest(run, found, samples, sizes, weights, settled)
    return found


def _weights(record: Record) -> Array:
    size = np.std(record.Y, axis=0)  # so that units do not matter
    return 1 / np.where(size > 0, size, 1.0)


def lengths(samples: int) -> list[int]:
    """Return lengths that grow twofold up to the whole."""
    found = [samples]
    while found[0] > 2 * _SHORTEST:
        found.insert(0, found[0] // 2)
    return found


def state_sizes(model: MechanicalData, states: Array) -> Array:
    """Append the sizes of internal states to those of the free displacements and velocities."""
    half = len(states) // 2
    q, v = np.max(states[:half], initial=1e-12), np.max(states[half:], initial=1e-12)
    sizes: list[float] = []
    for _, effect in dynamic_effects(model):
        kind = effect.definition
        known = kind.state_sizes(effect.values, float(q), float(v))
        sizes += [size or 1.0 for size in known] if known else [1.0] * kind.states
    return np.concatenate([states, np.array(sizes, dtype=float)])


def visible_sizes(linear: RecordRun, record: Record, start: Start) -> Array:
    """Return for each state of a linear model what would move its outputs by their own size."""
    vector = start.vector
    base = linear.over(StartedPiece(record, start)).outputs
    size = np.std(record.Y, axis=0)
    scale = np.ones(vector.size)
    for i in range(vector.size):
        moved = vector.copy()
        moved[i] += 1.0
        other = linear.over(StartedPiece(record, start.with_vector(moved))).outputs
        change = np.nan_to_num((other - base) / np.where(size > 0, size, 1.0))
        largest = float(np.max(np.abs(change)))
        scale[i] = 1 / largest if largest > 0 else 1.0
    return scale


def _size(run: RecordRun, piece: StartedPiece, weights: Array) -> float:
    """Return the sum of the squares of a run's weighted errors."""
    return float(np.sum(_errors(run, [piece], weights) ** 2))


def _errors(run: RecordRun, pieces: Sequence[StartedPiece], weights: Array) -> Array:
    """Weighted errors of all pieces; a run that diverges has very large ones."""
    with np.errstate(over="ignore", invalid="ignore"):
        error = -run.all_errors(pieces) * weights
    return np.where(np.isfinite(error), np.clip(error, -1e6, 1e6), 1e6)


def _closest(
    run: RecordRun,
    pieces: Sequence[StartedPiece],
    samples: int,
    sizes: Array,
    weights: Array,
    settled: float = 1e-6,
) -> list[StartedPiece]:
    """Improve the starts of pieces over their first samples, by damped least squares.

    No piece becomes worse. All are run together, each with a damping of its own.
    """
    heads = [p.record.part(0, min(samples, p.record.samples)) for p in pieces]
    vectors = np.array([piece.start.vector for piece in pieces])
    step, damping = (
        (1.0, np.zeros(len(pieces))) if run.linear else (_STEP, np.full(len(pieces), 1e-3))
    )

    def errors(rows: Array, which: Sequence[int]) -> list[Array]:
        started = [
            StartedPiece(heads[i], pieces[i].start.with_vector(row))
            for i, row in zip(which, rows, strict=True)
        ]
        marks = np.cumsum([p.record.samples for p in started])[:-1]
        return [e.ravel() for e in np.split(_errors(run, started, weights), marks)]

    active = list(range(len(pieces)))
    now = dict(zip(active, errors(vectors, active), strict=True))
    for _ in range(1 if run.linear else _ROUNDS):
        if not active:
            break
        columns = []
        for j, size in enumerate(sizes):
            ahead = vectors[active]
            ahead[:, j] += step * size
            columns.append(errors(ahead, active))
        jacobians = {
            i: np.column_stack([(column[k] - now[i]) / step for column in columns])
            for k, i in enumerate(active)
        }
        done, waiting = [], active
        for attempt in range(5):
            tried = np.array(
                [
                    vectors[i]
                    - _damped_step(jacobians[i], now[i], damping[i] * 10**attempt) * sizes
                    for i in waiting
                ]
            )
            still = []
            for i, row, after in zip(waiting, tried, errors(tried, waiting), strict=True):
                if not after @ after < now[i] @ now[i]:
                    still.append(i)
                    continue
                if after @ after > (1 - settled) * (now[i] @ now[i]):
                    done.append(i)
                vectors[i], now[i] = row, after
                damping[i] *= 10.0 ** (attempt - 1)
            waiting = still
            if not waiting:
                break
        active = [i for i in active if i not in done and i not in waiting]
    return [
        StartedPiece(piece.record, piece.start.with_vector(row))
        for piece, row in zip(pieces, vectors, strict=True)
    ]


def _damped_step(jacobian: Array, error: Array, damping: float) -> Array:
    """Solve for the step; directions that the outputs hardly show are left as they are."""
    values, vectors = np.linalg.eigh(jacobian.T @ jacobian)
    seen = values > 1e-12 * max(values[-1], 1e-300)
    inverse = np.where(seen, 1 / np.where(seen, values + damping * values[-1], 1.0), 0.0)
    return vectors @ (inverse * (vectors.T @ (jacobian.T @ error)))
