"""Prediction errors of a model with effects, led by the data as strongly as wanted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robustpolish.identification.observer import (
    Level,
    Scales,
    observer_gain,
    with_missing_force,
)
from robustpolish.identification.record import Record
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.ports import dynamic_effects
from robustpolish.simulation.signals import measured, raw_outputs, signals
from robustpolish.simulation.step import run_steps
from robustpolish.simulation.system import NonlinearSystem, build_system, needed_substeps

Array = NDArray[np.float64]


class Prediction(NamedTuple):
    """Predicted outputs (samples, ny), augmented states and internal states if kept."""

    outputs: Array
    states: Array
    internal: Array


@dataclass(frozen=True, eq=False)
class Start:
    """State of a piece of record at its first sample: mechanical and internal."""

    state: Array
    internal: Array

    @property
    def vector(self) -> Array:
        """Both parts in one vector."""
        return np.concatenate([self.state, self.internal])

    def with_vector(self, vector: Array) -> Start:
        """Return a start with other values."""
        return Start(vector[: self.state.size], vector[self.state.size :])


class Predictor:
    """Predicts pieces of a record at one level of guidance.

    The observer's gain is computed once, for the model it is made with, and kept for all
    models that are tried with it.
    """

    def __init__(
        self, model: MechanicalModel, dt: float, level: Level, scales: Scales, amplitude: float
    ) -> None:
        self.dt = dt
        self.level = level
        self.scales = scales
        self.amplitude = amplitude
        self.substeps = needed_substeps(model, dt, amplitude)
        self.moves_inputs = any(e.kind.startswith("input_") for e in model.effects)
        self._signals: dict[int, tuple[Record, Array]] = {}
        self.gain = observer_gain(self._system(model), dt, level, scales)

    def _system(self, model: MechanicalModel) -> NonlinearSystem:
        plain = build_system(model, self.dt / self.substeps)
        return with_missing_force(model, plain, self.scales.leak)

    def _inputs(self, model: MechanicalModel, record: Record) -> Array:
        if self.moves_inputs:
            return signals(model, record.data)
        known = self._signals.get(id(record))
        if known is None:
            known = (record, signals(model, record.data))
            self._signals[id(record)] = known
        return known[1]

    def system(self, model: MechanicalModel) -> NonlinearSystem:
        """Return the augmented system of a model."""
        return self._system(model)

    def predict(
        self,
        model: MechanicalModel,
        record: Record,
        start: Start,
        keep: bool = False,
        system: NonlinearSystem | None = None,
        matrices: tuple[Array, ...] | None = None,
    ) -> Prediction:
        """Return the predictions of a piece from its start."""
        system = self._system(model) if system is None else system
        matrices = system.steps(self.dt / self.substeps) if matrices is None else matrices
        sites = system.states - start.state.size
        s0 = np.concatenate([start.state, np.zeros(sites)])
        time = np.asarray(record.data["time"].values, dtype=float)
        outputs, states, internal = run_steps(
            matrices, system.motion, (system.C, system.D, system.H), system.laws,
            system.layout, system.values, self._inputs(model, record),
            raw_outputs(model, record.Y, time), self.gain.filter, s0, start.internal,
            record.start, self.dt, self.substeps, keep,
        )  # fmt: skip
        return Prediction(measured(model, outputs, time), states, internal)


def zero_start(model: MechanicalModel) -> Start:
    """Return a start at rest."""
    internal = sum(_internal_states(model))
    return Start(np.zeros(2 * len(model.free)), np.zeros(internal))


def _internal_states(model: MechanicalModel) -> list[int]:
    return [effect.definition.states for _, effect in dynamic_effects(model)]
