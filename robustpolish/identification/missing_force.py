"""Estimate the missing force: a Kalman smoother on the measured outputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robustpolish.effects import Effect, Motion, force_along
from robustpolish.identification.linear_observer import LinearObserver, PortForces
from robustpolish.identification.observer import (
    Level,
    Scales,
)
from robustpolish.identification.prediction import Prediction, Predictor, zero_start
from robustpolish.identification.record import Record
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.ports import context_of, port_matrices, port_pairs, port_rows
from robustpolish.simulation.signals import raw_outputs, signals

Array = NDArray[np.float64]
_START = 3.0


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Motion and missing force along a record.

    Attributes
    ----------
    q, v, a : ndarray, shape (coordinates, samples)
        Displacements and velocities of all coordinates, and the accelerations that the model
        gives them without the missing force.
    force : ndarray, shape (sites, samples)
        Missing force at each site.
    inputs : ndarray, shape (samples, signals)
    outputs : ndarray, shape (samples, ny)
        Noise-free outputs.
    """

    q: Array
    v: Array
    a: Array
    force: Array
    inputs: Array
    outputs: Array


def known_forces(
    model: MechanicalModel, q: Array, v: Array, time: Array, dt: float
) -> PortForces | None:
    """Return the forces of a model's effects along a motion."""
    rows, pairs, values = [], [], []
    for added in model.effects:
        effect = Effect(added.kind, added.at, added.parameters)
        if effect.definition.law is None:
            continue
        here = port_rows(model, effect)
        context = context_of(model, effect.at, dt / 4)
        motion = Motion(time, here @ q, here @ v, context)
        p = [*effect.values.values(), *(context[c] for c in effect.definition.context)]
        rows.append(here)
        pairs += port_pairs(effect)
        values.append(force_along(effect.definition, motion, np.array(p)))
    if not rows:
        return None
    return PortForces(np.vstack(rows), pairs, np.vstack(values))


def smooth(
    model: MechanicalModel, record: Record, level: Level, scales: Scales, amplitude: float
) -> Smoothed:
    """Return motion and missing force along a record.

    Effects of the model enter as known forces along the motion that a forward pass of the
    nonlinear observer finds.
    """
    W = signals(model, record.data)
    Y = raw_outputs(model, record.Y, record.data["time"].values)
    time = np.asarray(record.data["time"].values, dtype=float)
    observer = LinearObserver(model, record.dt, level, scales)
    sizes = _start_sizes(model, scales, amplitude)
    forces = None
    if any(Effect(e.kind, e.at, e.parameters).definition.law is not None for e in model.effects):
        predictor = Predictor(model, record.dt, level, scales, amplitude)
        kept: Prediction = predictor.predict(model, record, zero_start(model), keep=True)
        q, v = motion_of(model, kept.states, W)
        forces = known_forces(model, np.nan_to_num(q), np.nan_to_num(v), time, record.dt)
    s = _smoothed_states(observer, Y, W, forces, sizes)
    if forces is not None:  # once more, along the smoothed motion
        forces = known_forces(model, *motion_of(model, s, W), time, record.dt)
        s = _smoothed_states(observer, Y, W, forces, sizes)
    q, v = motion_of(model, s, W)
    n = 2 * len(model.free)
    force = s[:, n:].T
    return Smoothed(
        q, v, _accelerations(model, q, v, W, forces), force, W,
        s @ observer.system.C.T + W @ observer.system.D.T
        + (0.0 if forces is None else _through(model, forces)),
    )  # fmt: skip


def _through(model: MechanicalModel, forces: PortForces) -> Array:
    _, H, _ = port_matrices(model, forces.rows, forces.pairs)
    return (H @ forces.values).T


def _smoothed_states(
    observer: LinearObserver, Y: Array, W: Array, forces: PortForces | None, sizes: Array
) -> Array:
    """Smooth; the start is fitted to the first part of the record."""
    first = min(len(Y), 4000)
    head = None if forces is None else forces.head(first)
    errors = observer.innovations(Y[:first], W[:first], head)[1]
    states, errors = observer.innovations(Y, W, forces, observer.likeliest_start(errors, sizes))
    return observer.smooth(states, errors)


def _start_sizes(model: MechanicalModel, scales: Scales, amplitude: float) -> Array:
    """Return what free displacements and velocities may be at the start, roughly.

    No coordinate holds much more energy than the softest one does at the measured amplitude, and
    none moves much faster than its displacement and the bandwidth allow. This holds still what
    the outputs hardly show, a stiff mass that is not measured.
    """
    m = model.matrices
    mass, stiffness = np.diag(m.M)[m.free], np.diag(m.K)[m.free]
    elastic = np.where(stiffness > 0, stiffness, mass * scales.bandwidth**2)
    if amplitude == 0 or not elastic.size:
        return np.full(2 * len(elastic), np.inf)
    energy = np.min(elastic) * (_START * amplitude) ** 2
    q = np.where(stiffness > 0, np.sqrt(energy / elastic), np.inf)
    v = np.minimum(np.sqrt(energy / mass), _START * scales.bandwidth * q)
    return np.concatenate([q, v])


def motion_of(model: MechanicalModel, states: Array, W: Array) -> tuple[Array, Array]:
    """Return displacements and velocities of all coordinates, shape (coordinates, samples)."""
    Lq, Lv, Rq, Rv = model.matrices.motion_map()
    s = states[:, : Lq.shape[1]].T
    return Lq @ s + Rq @ W.T, Lv @ s + Rv @ W.T


def _accelerations(
    model: MechanicalModel,
    q: Array,
    v: Array,
    W: Array,
    forces: PortForces | None,
) -> Array:
    # The missing force is left out: with it, errors of the masses could explain it away.
    m = model.matrices
    total = m.B @ W[:, : m.B.shape[1]].T - m.K @ q - m.C @ v
    if forces is not None:
        total = total + forces.rows.T @ forces.values
    mass = np.diag(m.M)
    a = np.divide(total, mass[:, None], out=np.zeros_like(total), where=mass[:, None] > 0)
    return a
