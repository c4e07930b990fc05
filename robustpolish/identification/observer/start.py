"""The start from which a free run comes closest to what was measured."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from robustpolish.arrays import Array
from robustpolish.identification.observer.run import RecordRun, Start, StartedPiece
from robustpolish.identification.record import Record
from robustpolish.models.mechanical.data import MechanicalData
from robustpolish.models.mechanical.ports import dynamic_effects

_ROUNDS = 8
_STEP = 1e-4
_SHORTEST = 50


def fitted_start(run: RecordRun, record: Record, guesses: Sequence[Start], sizes: Array) -> Start:
    """Find the start from which a free run comes closest to the measured outputs.

    For a linear model that is one least-squares problem, over the whole of the record, as in
    MATLAB's ``compare``. With effects it is solved by damped Gauss-Newton steps on stretches that
    grow twofold: errors over a short stretch depend smoothly on the start even where those over a
    long one do not, and over a long run a wrong start is a wrong phase.

    Parameters
    ----------
    run : RecordRun
    record : Record
        All of it is run over.
    guesses : sequence of Start
        Where the search may begin: at the best of them.
    sizes : ndarray, shape (n,)
        What matters of each state: see :func:`state_sizes`, or :func:`visible_sizes`.

    Returns
    -------
    Start
    """
    if not sizes.size:
        return guesses[0]
    size = np.std(record.Y, axis=0)  # so that units do not matter
    weights = 1 / np.where(size > 0, size, 1.0)
    growing = [record.samples] if run.linear else lengths(record.samples)
    first = record.part(0, growing[0])
    start = guesses[0]
    if len(guesses) > 1:
        start = min(guesses, key=lambda guess: _sum(_error(run, first, guess, weights)))
    for samples in growing:
        start = _closest(run, record.part(0, samples), start, sizes, weights)
    return start


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


def _error(run: RecordRun, record: Record, start: Start, weights: Array) -> Array:
    """Weighted errors in one vector; a run that diverges has very large ones."""
    with np.errstate(over="ignore", invalid="ignore"):
        error = -run.errors(StartedPiece(record, start)) * weights
    return np.where(np.isfinite(error), np.clip(error, -1e6, 1e6), 1e6).ravel()


def _sum(error: Array) -> float:
    return float(error @ error)


def _closest(run: RecordRun, record: Record, start: Start, sizes: Array, weights: Array) -> Start:
    """Improve a start by damped least squares; it never becomes worse."""

    def error(vector: Array) -> Array:
        return _error(run, record, start.with_vector(vector), weights)

    vector = start.vector
    now = error(vector)
    step, damping = (1.0, 0.0) if run.linear else (_STEP, 1e-3)
    for _ in range(1 if run.linear else _ROUNDS):
        jacobian = _jacobian(error, vector, now, step * sizes) / step
        for attempt in range(5):
            candidate = vector - _damped_step(jacobian, now, damping * 10**attempt) * sizes
            after = error(candidate)
            if _sum(after) < _sum(now):
                break
        else:
            break
        settled = _sum(after) > (1 - 1e-6) * _sum(now)
        vector, now, damping = candidate, after, damping * 10.0 ** (attempt - 1)
        if settled:
            break
    return start.with_vector(vector)


def _jacobian(error: Callable[[Array], Array], at: Array, now: Array, steps: Array) -> Array:
    columns = []
    for i, size in enumerate(steps):
        ahead = at.copy()
        ahead[i] += size
        columns.append(error(ahead) - now)
    return np.column_stack(columns)


def _damped_step(jacobian: Array, error: Array, damping: float) -> Array:
    """Solve for the step; directions that the outputs hardly show are left as they are."""
    values, vectors = np.linalg.eigh(jacobian.T @ jacobian)
    seen = values > 1e-12 * max(values[-1], 1e-300)
    inverse = np.where(seen, 1 / np.where(seen, values + damping * values[-1], 1.0), 0.0)
    return vectors @ (inverse * (vectors.T @ (jacobian.T @ error)))
