"""How well a model runs freely: starts, errors, and whether a free run means anything."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robustpolish.identification.following import following
from robustpolish.identification.least_squares import Piece, Residuals, fit
from robustpolish.identification.missing_force import Smoothed, smooth
from robustpolish.identification.observer import Level, Scales
from robustpolish.identification.prediction import Predictor, Start, zero_start
from robustpolish.identification.record import Record
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.ports import dynamic_effects

Array = NDArray[np.float64]
FREE = Level()
GUIDED = Level(0.03)
_SHORTEST = 50


def state_scale(model: MechanicalModel, motion: Smoothed) -> Array:
    """Return the size of each free displacement and velocity."""
    index = [model.dof_names.index(name) for name in model.free]
    sizes = np.concatenate([np.std(motion.q[index], axis=1), np.std(motion.v[index], axis=1)])
    largest = np.max(sizes, initial=0.0)
    return np.maximum(sizes, 1e-6 * largest) if largest > 0 else np.ones(len(sizes))


def pieces_of(
    model: MechanicalModel, record: Record, ranges: Sequence[tuple[int, int]], motion: Smoothed
) -> list[Piece]:
    """Return pieces that start from the smoothed motion, internal states at rest."""
    index = [model.dof_names.index(name) for name in model.free]
    rest = zero_start(model).internal
    found = []
    for begin, end in ranges:
        state = np.concatenate([motion.q[index, begin], motion.v[index, begin]])
        found.append(Piece(record.part(begin, end), Start(state, rest.copy())))
    return found


def with_rest(model: MechanicalModel, pieces: Sequence[Piece]) -> list[Piece]:
    """Return the pieces with internal states that suit a model, at rest where they are new."""
    rest = zero_start(model).internal
    found = []
    for piece in pieces:
        internal = rest.copy()
        known = min(rest.size, piece.start.internal.size)
        internal[:known] = piece.start.internal[:known]
        found.append(Piece(piece.record, Start(piece.start.state, internal)))
    return found


def full_scale(model: MechanicalModel, states: Array) -> Array:
    """Append a scale for internal states to that of the states."""
    half = len(states) // 2
    q, v = np.max(states[:half], initial=1e-12), np.max(states[half:], initial=1e-12)
    sizes: list[float] = []
    for _, effect in dynamic_effects(model):
        kind = effect.definition
        known = kind.state_sizes(effect.values, float(q), float(v))
        sizes += [size or 1.0 for size in known] if known else [1.0] * kind.states
    return np.concatenate([states, np.array(sizes, dtype=float)])


def fitted_starts(
    model: MechanicalModel, pieces: Sequence[Piece], predictor: Predictor, scale: Array
) -> list[Piece]:
    """Return the pieces with the starts that suit a model best.

    They are fitted to the first samples, then to more and more: over a long run of a lightly
    damped or amplitude-dependent model a wrong start is a wrong phase, and many phases fit a
    little.
    """
    found = []
    for piece in pieces:
        length = piece.record.samples
        current = piece
        for samples in _growing(length):
            part = piece.record.part(0, samples)
            trial = [Piece(part, current.start)]
            residuals = Residuals(model, trial, predictor, [], True, full_scale(model, scale))
            fitted = fit(residuals, iterations=3, tolerance=1e-4)
            current = Piece(piece.record, fitted.pieces[0].start)
        found.append(current)
    return found


def _growing(length: int) -> list[int]:
    """Return lengths that grow fourfold up to the whole."""
    found = [length]
    while found[0] > 4 * _SHORTEST:
        found.insert(0, found[0] // 4)
    return found


def free_errors(
    model: MechanicalModel,
    pieces: Sequence[Piece],
    scales: Scales,
    dt: float,
    amplitude: float,
    scale: Array,
) -> Array:
    """Return the free-run errors of all pieces, starts fitted, shape (samples, ny)."""  # fmt: skip
    predictor = Predictor(model, dt, FREE, scales, amplitude)
    ready = with_rest(model, pieces)
    if ready[0].start.vector.size:
        ready = fitted_starts(model, ready, predictor, scale)
    return np.vstack(
        [p.record.Y - predictor.predict(model, p.record, p.start).outputs for p in ready]
    )


def guided_errors(
    model: MechanicalModel, pieces: Sequence[Piece], scales: Scales, dt: float, amplitude: float,
    level: Level = GUIDED,
) -> Array:  # fmt: skip
    """Return the errors of a run that is led by the data a little, shape (samples, ny)."""
    predictor = Predictor(model, dt, level, scales, amplitude)
    ready = with_rest(model, pieces)
    return np.vstack(
        [p.record.Y - predictor.predict(model, p.record, p.start).outputs for p in ready]
    )


def reproducible(
    model: MechanicalModel, piece: Piece, scales: Scales, dt: float, amplitude: float, scale: Array
) -> bool:
    """Return whether a tiny change of the start stays below the noise of a free run."""
    predictor = Predictor(model, dt, FREE, scales, amplitude)
    ready = with_rest(model, [piece])[0]
    moved = ready.start.vector.copy()
    moved[: scale.size] += 1e-6 * scale
    one = predictor.predict(model, ready.record, ready.start).outputs
    two = predictor.predict(model, ready.record, ready.start.with_vector(moved)).outputs
    if not np.isfinite(one).all():
        return False
    late = slice(len(one) // 2, None)
    growth = np.sqrt(np.mean((two - one)[late] ** 2, axis=0))
    return bool(np.all(growth < 0.1 * np.maximum(scales.noise, 1e-3 * np.std(one, axis=0))))


def motion_along(
    model: MechanicalModel, record: Record, scales: Scales, amplitude: float
) -> Smoothed:
    """Return the smoothed motion, led by the data as far as the innovations ask for."""
    return smooth(model, record, following(model, record, scales), scales, amplitude)
