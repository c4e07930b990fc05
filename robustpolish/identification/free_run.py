"""Free runs of a model on measured inputs, from starts that are estimated."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.measurements import sampling_time
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.simulation.signals import measured, signals
from robustpolish.simulation.step import run_steps
from robustpolish.simulation.system import build_system, needed_substeps

Array = NDArray[np.float64]
ErrorOf = Callable[[Array], Array]

_ROUNDS = 8


class FreeRun:
    """A model made ready to be run again and again on one record.

    A start is the vector of free displacements and velocities, followed by the internal states
    of the effects.

    Parameters
    ----------
    model : MechanicalModel
    data : xarray.Dataset
        Checked: inputs and outputs over uniform ``time``.
    """

    def __init__(self, model: MechanicalModel, data: xr.Dataset) -> None:
        self.model = model
        self.time = np.asarray(data["time"].values, dtype=float)
        self.step = sampling_time(data)
        self.inputs = signals(model, data)
        self.measured = np.column_stack(
            [np.asarray(data[name].values, dtype=float) for name in model.output_names]
        )
        amplitude = float(np.max(np.percentile(np.abs(self.measured), 99, axis=0), initial=0.0))
        self.substeps = needed_substeps(model, self.step, amplitude)
        self.system = build_system(model, self.step / self.substeps)
        self._steps = self.system.steps(self.step / self.substeps)
        self.linear = not self.system.effects

    @property
    def samples(self) -> int:
        """Number of samples of the record."""
        return self.time.size

    @property
    def start_size(self) -> int:
        """Length of a start."""
        return self.system.states + self.system.internal

    def without_effects(self) -> FreeRun:
        """Return the linear part on the same record."""
        other = copy(self)
        other.model = self.model.without_effects()
        other.substeps = 1
        other.system = build_system(other.model, self.step)
        other._steps = other.system.steps(self.step)
        other.linear = True
        return other

    def run(self, start: Array, first: int = 0, last: int | None = None) -> Array:
        """Return the outputs of a free run over samples `first` to `last`, shape (samples, ny)."""
        return self.states(start, first, last)[0]

    def states(
        self, start: Array, first: int = 0, last: int | None = None
    ) -> tuple[Array, Array, Array]:
        """Return outputs, states and internal states of a free run."""
        system, n, ny = self.system, self.system.states, self.measured.shape[1]
        raw, states, internal = run_steps(
            self._steps,
            system.motion,
            (system.C, system.D, system.H),
            system.laws,
            system.layout,
            system.values,
            np.ascontiguousarray(self.inputs[first:last]),
            np.zeros((1, ny)),
            np.zeros((n, ny)),
            np.ascontiguousarray(start[:n]),
            np.ascontiguousarray(start[n:]),
            self.time[first],
            self.step,
            self.substeps,
            True,
        )
        return measured(self.model, raw, self.time[first:last]), states, internal


@dataclass(frozen=True, eq=False)
class EstimatedRun:
    """An estimated start and the run from it.

    Attributes
    ----------
    state : ndarray, shape (n,)
        Free displacements and velocities, then internal states of the effects.
    outputs : ndarray, shape (samples, ny)
    """

    state: Array
    outputs: Array


def estimate_start(
    run: FreeRun, first: int = 0, last: int | None = None, guess: Array | None = None
) -> EstimatedRun:
    """Find the start from which a free run comes closest to the measured outputs.

    For a linear model that is one least-squares problem, over the whole of the stretch, as in
    MATLAB's ``compare``. With effects it is solved by damped Gauss-Newton steps on stretches that
    grow: errors over a short stretch depend smoothly on the start even where those over a long one
    do not.

    Parameters
    ----------
    run : FreeRun
    first, last : int, optional
        Samples of the stretch; the whole record by default.
    guess : ndarray, shape (n,), optional
        Where to begin the search, for a model with effects; the best of it, of the start of the
        linear part, and of rest is taken.

    Returns
    -------
    EstimatedRun
    """
    last = run.samples if last is None else last
    state = np.zeros(run.start_size)
    if not run.start_size:
        return EstimatedRun(state, run.run(state, first, last))
    stretches = _stretches(run, first, last)
    weights = _weights(run.measured[first:last])
    if run.linear:
        scale = _scale(run, first, last, weights)
    else:
        state, scale = _first_guess(run, first, stretches[0], weights, guess)
    for end in stretches:
        state = _fit(run, state, scale, first, end, weights)
    return EstimatedRun(state, run.run(state, first, last))


def _weights(outputs: Array) -> Array:
    """One over the size of each output, so that units do not matter."""
    size = np.sqrt(np.mean((outputs - outputs.mean(axis=0)) ** 2, axis=0))
    return 1 / np.where(size > 0, size, 1.0)


def _stretches(run: FreeRun, first: int, last: int) -> list[int]:
    """Return the ends of the stretches to fit: one for a linear model, growing ones for others."""
    if run.linear:
        return [last]
    rates = np.abs(np.linalg.eigvals(run.system.A)) if run.system.states else np.zeros(0)
    slow = rates[rates > 1e-9 * np.max(rates, initial=0.0)]
    period = 2 * np.pi / float(np.min(slow)) / run.step if slow.size else 100.0
    length = int(np.clip(2 * period, 10 * run.start_size, max(last - first, 10)))
    ends = []
    while first + length < last and len(ends) < 3:
        ends.append(first + length)
        length *= 4
    return [*ends, last]


def _first_guess(
    run: FreeRun, first: int, last: int, weights: Array, guess: Array | None
) -> tuple[Array, Array]:
    """Return the best start at hand, and the scale of its entries from the linear part."""
    linear = run.without_effects()
    scale = _scale(linear, first, last, weights)
    rest = np.zeros(run.start_size)
    of_linear = rest.copy()
    of_linear[: scale.size] = _fit(linear, rest[: scale.size], scale, first, last, weights)
    starts = [rest, of_linear, *([] if guess is None else [guess])]
    costs = [_sum_of_squares(run, start, first, last, weights) for start in starts]
    best = starts[int(np.argmin(costs))]
    internal = run.states(best, first, last)[2]
    with np.errstate(over="ignore", invalid="ignore"):
        memory = np.nan_to_num(np.std(internal, axis=0), nan=0.0, posinf=0.0)
    return best, np.concatenate([scale, memory])


def _scale(run: FreeRun, first: int, last: int, weights: Array) -> Array:
    """Return for each entry of a linear model's start what would make outputs of unit size."""
    zero = np.zeros(run.start_size)
    base = run.run(zero, first, last)
    scale = np.ones(run.start_size)
    for i in range(run.start_size):
        unit = zero.copy()
        unit[i] = 1.0
        change = np.nan_to_num((run.run(unit, first, last) - base) * weights)
        size = float(np.max(np.abs(change)))
        scale[i] = 1 / size if size > 0 else 1.0
    return scale


def _error(run: FreeRun, state: Array, first: int, last: int, weights: Array) -> Array:
    """Weighted errors in one vector; a run that diverges has very large ones."""
    with np.errstate(over="ignore", invalid="ignore"):
        error = (run.run(state, first, last) - run.measured[first:last]) * weights
    return np.where(np.isfinite(error), np.clip(error, -1e6, 1e6), 1e6).ravel()


def _sum_of_squares(run: FreeRun, state: Array, first: int, last: int, weights: Array) -> float:
    error = _error(run, state, first, last, weights)
    return float(error @ error)


def _fit(run: FreeRun, state: Array, scale: Array, first: int, last: int, weights: Array) -> Array:
    """Improve a start by damped least squares; it never becomes worse."""
    if not state.size:  # the linear part of a model whose motion is imposed
        return state

    def error(candidate: Array) -> Array:
        return _error(run, candidate, first, last, weights)

    now = error(state)
    damping = 0.0 if run.linear else 1e-3
    length = scale * (1.0 if run.linear else 1e-4)
    for _ in range(1 if run.linear else _ROUNDS):
        columns = [_change(error, state, now, i, length[i]) for i in range(state.size)]
        jacobian = np.column_stack(columns) / (1.0 if run.linear else 1e-4)
        for attempt in range(5):
            candidate = state - _damped_step(jacobian, now, damping * 10**attempt) * scale
            after = error(candidate)
            if after @ after < now @ now:
                break
        else:
            return state
        settled = after @ after > (1 - 1e-6) * (now @ now)
        state, now, damping = candidate, after, damping * 10.0 ** (attempt - 1)
        if settled:
            break
    return state


def _change(error: ErrorOf, state: Array, now: Array, i: int, size: float) -> Array:
    ahead = state.copy()
    ahead[i] += size
    return error(ahead) - now


def _damped_step(jacobian: Array, error: Array, damping: float) -> Array:
    """Solve for the step; directions that the outputs hardly show are left as they are."""
    gram = jacobian.T @ jacobian
    values, vectors = np.linalg.eigh(gram)
    seen = values > 1e-12 * max(values[-1], 1e-300)
    inverse = np.where(seen, 1 / np.where(seen, values + damping * values[-1], 1.0), 0.0)
    return vectors @ (inverse * (vectors.T @ (jacobian.T @ error)))
