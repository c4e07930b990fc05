"""A model run over a record: freely, or led by the data."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robustpolish.arrays import Array
from robustpolish.identification.observer.kalman import (
    FREE,
    Gain,
    Level,
    Scales,
    excited_bandwidth,
    observer_gain,
    peak_of,
    with_missing_force,
)
from robustpolish.identification.record import Record
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.data import MechanicalData
from robustpolish.models.mechanical.ports import dynamic_effects
from robustpolish.simulation.between import Lines
from robustpolish.simulation.run import Course, NonlinearResponse, Stepper
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
    substeps : int, optional
        Steps per sample; as many as the amplitude asks for by default.
    spend : callable, optional
        Told the steps of every run; runs may be made in several threads.
    """

    def __init__(
        self,
        model: MechanicalModel,
        dt: float,
        amplitude: float,
        level: Level = FREE,
        scales: Scales | None = None,
        substeps: int | None = None,
        spend: Callable[[float], None] = lambda _: None,
    ) -> None:
        self.dt, self.level, self.spend = dt, level, spend
        self.substeps = substeps or needed_substeps(model, dt, amplitude)
        self._leak = None if level.free or scales is None else scales.leak
        self._moves_inputs = any(e.definition.domain == "input" for e in model.effects)
        self._signals: tuple[tuple[object, object], Array, Lines | None] | None = None
        self._course: tuple[tuple[object, object], Course, Array] | None = None
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
        return record.own(self._known(model, record)[1])

    def lines(self, model: MechanicalModel, records: Sequence[Record]) -> Lines | None:
        """Return what the signals do between the samples of records, None if all are linear."""
        known = [record.own_lines(self._known(model, record)[2]) for record in records]
        found = [each for each in known if each is not None]
        if not found:
            return None
        return Lines(*(np.concatenate(side) for side in zip(*found, strict=True)))

    def course(self, model: MechanicalModel, records: tuple[Record, ...]) -> tuple[Course, Array]:
        """Return what acts on a model over several pieces of record, and what was measured there.

        The pieces stand one behind the other in the arrays; of those asked for last the answer is
        kept.

        Parameters
        ----------
        model : MechanicalModel
        records : tuple of Record

        Returns
        -------
        course : Course
        measured : ndarray, shape (samples, ny)
        """
        key = (records, model if self._moves_inputs else None)
        known = self._course
        if known is None or known[0][0] != records or known[0][1] is not key[1]:
            signals = np.concatenate([self.inputs(model, record) for record in records])
            time = np.concatenate([record.time for record in records])
            marks = np.cumsum([0, *(record.samples for record in records)])
            course = Course.of(signals, self.lines(model, records), time, marks)
            known = self._course = (key, course, np.concatenate([r.Y for r in records]))
        return known[1:]

    def _known(
        self, model: MechanicalModel, record: Record
    ) -> tuple[tuple[object, object], Array, Lines | None]:
        key = (record.sets, model if self._moves_inputs else None)
        known = self._signals
        if known is None or any(a is not b for a, b in zip(known[0], key, strict=True)):
            known = self._signals = (key, record.signals(model), record.lines(model))
        return known


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

    def finer(self) -> RecordRun:
        """Return the free run of the model in steps half as long."""
        runner = self.runner
        twice = Runner(self.model, runner.dt, 0.0, substeps=2 * runner.substeps, spend=runner.spend)
        return twice.run(self.model)

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
        lines = self.runner.lines(self.model, [record])
        led = (None, None) if gain is None else (record.Y, gain.filter)
        self.runner.spend(record.samples * self.run.substeps)
        return self.run.over(inputs, state, start.internal, record.time, *led, keep, lines)

    def over_all(self, pieces: Sequence[StartedPiece], keep: bool = False) -> NonlinearResponse:
        """Return what the model predicts for several pieces, one after the other in the arrays."""
        starts = np.array([piece.start.vector for piece in pieces])
        return self.along(tuple(piece.record for piece in pieces), starts, keep)

    def all_errors(self, pieces: Sequence[StartedPiece]) -> Array:
        """Return measured minus predicted outputs of several pieces, shape (samples, ny)."""
        starts = np.array([piece.start.vector for piece in pieces])
        return self.errors_along(tuple(piece.record for piece in pieces), starts)

    def along(
        self, records: tuple[Record, ...], starts: Array, keep: bool = False
    ) -> NonlinearResponse:
        """Return what the model predicts for several pieces, one after the other in the arrays.

        Parameters
        ----------
        records : tuple of Record
        starts : ndarray, shape (pieces, n)
            One vector of :class:`Start` each.
        keep : bool, optional
            As in :meth:`over`.
        """
        system = self.run.system
        states = starts.shape[1] - system.internal
        if self.runner.gain is not None:
            begins = (Start(row[:states], row[states:]) for row in starts)
            pieces = (StartedPiece(*each) for each in zip(records, begins, strict=True))
            runs = [self.over(piece, keep) for piece in pieces]
            return NonlinearResponse(*(np.concatenate(part) for part in zip(*runs, strict=True)))
        course, _ = self.runner.course(self.model, records)
        self.runner.spend(course.time.size * self.run.substeps)
        return self.run.over_pieces(course, starts[:, :states], starts[:, states:], keep)

    def errors_along(self, records: tuple[Record, ...], starts: Array) -> Array:
        """Return measured minus predicted outputs of :meth:`along`, shape (samples, ny)."""
        return self.runner.course(self.model, records)[1] - self.along(records, starts).outputs

    def errors(self, piece: StartedPiece) -> Array:
        """Return measured minus predicted outputs, shape (samples, ny)."""
        return piece.record.Y - self.over(piece).outputs


def free_run(model: MechanicalModel, record: Record) -> RecordRun:
    """Return a model ready to run freely over a record."""
    peak = 0.0
    if model.effects:
        peak = peak_of(model, record, excited_bandwidth(model, record))
    return Runner(model, record.dt, peak).run(model)


def rest(model: MechanicalData) -> Start:
    """Return a start at rest."""
    internal = sum(effect.definition.states for _, effect in dynamic_effects(model))
    return Start(np.zeros(2 * len(model.free)), np.zeros(internal))
