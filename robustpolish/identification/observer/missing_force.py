"""Estimation of the missing force by a Kalman smoother on the measured outputs."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.identification.observer.kalman import (
    Level,
    LinearObserver,
    PortForces,
    Scales,
    scales_of,
)
from robustpolish.identification.observer.runs import InitialState, Runner, StartedPiece, rest
from robustpolish.identification.record import Record, least_samples
from robustpolish.machines.effects.evaluate import force_with
from robustpolish.machines.mechanical.data import dynamic_effects, motion_at, port_pairs, port_rows
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.simulation import IntersampleLines, NonlinearResponse

_INITIAL_AMPLITUDE = 3.0
# Samples to which the start is fitted: many swings of every machine, and quick.
_START_SAMPLES = 4000
# Levels of a model that may be nearly right, to predict with and to see the motion.
_OBSERVER_LEVELS = tuple(Level(share) for share in (0.01, 0.03, 0.1, 0.3, 1.0))


@dataclass(frozen=True, eq=False)
class SmoothedMotion:
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
    internal : ndarray, shape (samples, nz)
        Internal states of the effects, from the forward pass.
    """

    q: Array
    v: Array
    a: Array
    force: Array
    inputs: Array
    outputs: Array
    internal: Array

    def start(self, model: MechanicalModel, sample: int) -> InitialState:
        """Return the state at a sample."""
        free = model.matrices.free
        state = np.concatenate([self.q[free, sample], self.v[free, sample]])
        return InitialState(state, self.internal[sample])


def known_forces(
    model: MechanicalModel, q: Array, v: Array, time: Array, dt: float, inputs: Array
) -> PortForces | None:
    """Return the forces of a model's effects along a motion."""
    effects = [effect for _, effect in dynamic_effects(model)]
    if not effects:
        return None
    motions = ((e, motion_at(model, e, time, q, v, dt / 4, inputs)) for e in effects)
    values = [force_with(effect.definition, effect.values, motion) for effect, motion in motions]
    pairs = [pair for effect in effects for pair in port_pairs(effect)]
    return PortForces(np.vstack([port_rows(model, e) for e in effects]), pairs, np.vstack(values))


_DIVERGED_AMPLITUDE = 1e3
"""Times the amplitude of a motion beyond which what was smoothed is none."""


def best_observer_level(
    model: MechanicalModel, record: Record, scales: Scales, levels: Sequence[Level]
) -> tuple[Level, NonlinearResponse]:
    """Return the level at which an observer predicts the record best, and what it saw.

    The observer begins at rest: what it does in the first samples is not counted.

    Parameters
    ----------
    model : MechanicalModel
    record : Record
    scales : Scales
    levels : sequence of Level
        The first of them if the observer diverges at all.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the observer's equation has no solution at any level.
    """
    best, chosen, unsolved = np.inf, None, None
    piece = StartedPiece(record, rest(model))
    for level in levels:
        try:
            run = Runner(model, record.dt, scales.amplitude, level, scales).run(model)
        except np.linalg.LinAlgError as error:
            unsolved = error
            continue
        found = run.over(piece, keep=True)
        tail = (record.Y - found.outputs)[record.samples // 20 :]
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            # minus infinity where nothing is left: data that this very model has made
            score = float(np.sum(np.log(np.mean(tail**2, axis=0))))
        if chosen is None or score < best:
            chosen = level, found
            best = np.inf if np.isnan(score) else score
    if chosen is None:
        assert unsolved is not None
        raise unsolved
    return chosen


def smooth(
    model: MechanicalModel, record: Record, scales: Scales, levels: Sequence[Level]
) -> SmoothedMotion:
    """Return motion and missing force along a record, led by the data as far as they ask for.

    Effects of the model enter as known forces along the motion that a forward pass of the
    nonlinear observer finds. Each of several records is smoothed by itself. Arguments as of
    :func:`best_observer_level`.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # no level may follow the record
        each = [_smooth(model, part, scales, levels) for part in record.parts]
    if len(each) == 1:
        return each[0]
    rows = ("inputs", "outputs", "internal")  # have a row for each sample, others a column
    return SmoothedMotion(
        **{
            name: np.concatenate([getattr(s, name) for s in each], 0 if name in rows else 1)
            for name in SmoothedMotion.__dataclass_fields__
        }
    )


def _smooth(
    model: MechanicalModel, record: Record, scales: Scales, levels: Sequence[Level]
) -> SmoothedMotion:
    """Smooth one record, or a contiguous part of one."""
    level, seen = best_observer_level(model, record, scales, levels)
    W, Y, nf = record.own(record.signals(model)), record.raw_outputs(model), len(model.free)
    observer = LinearObserver(model, record.dt, level, scales)
    sizes, m = _start_sizes(model, scales), model.matrices
    lines = record.own_lines(record.lines(model))
    first = min(len(Y), _START_SAMPLES)
    begin = None if lines is None else IntersampleLines(*(side[:first] for side in lines))
    # The force of a law far stronger than the springs is none that is known from a motion that
    # lacks it: where it leaves all bounds it is left out.
    bound, travels = _DIVERGED_AMPLITUDE * scales.amplitude or np.inf, model.frame.sizes[m.free]

    def along(forces: PortForces | None) -> Array:
        head = None if forces is None else forces._replace(values=forces.values[:, :first])
        errors = observer.innovations(Y[:first], W[:first], head, lines=begin)[1]
        start = observer.likeliest_start(errors, sizes)
        return observer.smooth(*observer.innovations(Y, W, forces, start, lines))

    q, v = (np.nan_to_num(part) for part in motion_of(model, seen.states, W))
    forces = s = None
    for _ in range(2):  # along the motion that the forward pass found, then the smoothed one
        forces = known_forces(model, q, v, record.time, record.dt, W)
        s = None
        if forces is None or not np.isfinite(forces.values).all():
            break
        with suppress(np.linalg.LinAlgError):
            s = along(forces)
        if s is None or not np.max(np.abs(s[:, :nf] / travels), initial=0.0) <= bound:
            s = None
            break
        q, v = motion_of(model, s, W)
    if s is None:
        forces, s = None, along(None)
        q, v = motion_of(model, s, W)
    A, B, _, _ = m.first_order()
    # The missing force is left out: with it, errors of the masses could explain it away.
    a = np.zeros_like(q)
    a[m.free] = A[nf:] @ np.concatenate([q[m.free], v[m.free]]) + B[nf:] @ W.T
    outputs = s @ observer.system.C.T + W @ observer.system.D.T
    if forces is not None:
        a[m.free] += m.inverse_mass @ (forces.rows.T @ forces.values)[m.free]
        outputs = outputs + (observer.port_steps(forces.rows, forces.pairs)[2] @ forces.values).T
    return SmoothedMotion(q, v, a, s[:, 2 * nf :].T, W, outputs, seen.internal)


def best_observer_run(model: MechanicalModel, record: Record) -> NonlinearResponse:
    """Return the predictions and states of the observer that predicts a record best."""
    return best_observer_level(model, record, scales_of(model, record), _OBSERVER_LEVELS)[1]


def smoothed_motion(model: MechanicalModel, record: Record) -> SmoothedMotion | None:
    """Return the smoothed motion of a record; None if it is too short or cannot be followed."""
    if min(part.samples for part in record.parts) < least_samples(model):
        return None
    found = smooth(model, record, scales_of(model, record), _OBSERVER_LEVELS)
    finite = all(np.isfinite(part).all() for part in (found.q, found.force, found.internal))
    return found if finite else None


def _start_sizes(model: MechanicalModel, scales: Scales) -> Array:
    """Return what free displacements and velocities may be at the start, roughly.

    No coordinate holds much more energy than the softest one does at the measured amplitude, and
    none moves much faster than its displacement and the bandwidth allow. This holds still what
    the outputs hardly show, a stiff mass that is not measured.
    """
    m, sizes = model.matrices, model.frame.sizes
    mass, stiffness = (np.diag(part * sizes**2)[m.free] for part in (m.M, m.K))
    elastic = np.where(stiffness > 0, stiffness, mass * scales.bandwidth**2)
    if scales.amplitude == 0 or not elastic.size:
        return np.full(2 * len(elastic), np.inf)
    energy = np.min(elastic) * (_INITIAL_AMPLITUDE * scales.amplitude) ** 2
    q = np.where(stiffness > 0, np.sqrt(energy / elastic), np.inf)
    v = np.minimum(np.sqrt(energy / mass), _INITIAL_AMPLITUDE * scales.bandwidth * q)
    return np.concatenate([q, v]) * np.tile(sizes[m.free], 2)


def motion_of(model: MechanicalModel, states: Array, W: Array) -> tuple[Array, Array]:
    """Return displacements and velocities of all coordinates, shape (coordinates, samples)."""
    Lq, Lv, Rq, Rv = model.matrices.motion_map
    s = states[:, : Lq.shape[1]].T
    return Lq @ s + Rq @ W.T, Lv @ s + Rv @ W.T
