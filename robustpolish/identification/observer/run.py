"""A model run over a record: freely, or led by the data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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
from robustpolish.simulation.between import Lines
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
    substeps : int, optional
        Steps per sample; as many as the amplitude asks for by default.
    """

    def __init__(
        self,
        model: MechanicalModel,
        dt: float,
        amplitude: float,
        level: Level = FREE,
        scales: Scales | None = None,
        substeps: int | None = None,
    ) -> None:
        self.dt, self.level = dt, level
        self.substeps = substeps or needed_substeps(model, dt, amplitude)
        self._leak = None if level.free or scales is None else scales.leak
        self._moves_inputs = any(e.definition.domain == "input" for e in model.effects)
        self._signals: tuple[tuple[object, object], Array, Lines | None] | None = None
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
        return Runner(self.model, runner.dt, 0.0, substeps=2 * runner.substeps).run(self.model)

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
        return self.run.over(inputs, state, start.internal, record.time, *led, keep, lines)

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
            self.runner.lines(self.model, [p.record for p in pieces]),
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
