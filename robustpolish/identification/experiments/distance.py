"""How far two machines are apart in an experiment, before and after one takes after the other."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from robustpolish.arrays import Array
from robustpolish.errors import InvalidInputError
from robustpolish.identification.experiments.candidates import Experiment
from robustpolish.identification.experiments.policy import EXPERIMENTS, ExperimentPolicy
from robustpolish.identification.observer.run import rest
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.simulation.run import simulate
from robustpolish.simulation.system import needed_substeps


@dataclass(frozen=True, eq=False)
class Machines:
    """Two machines that a record does not tell apart.

    Attributes
    ----------
    first, second : MechanicalModel
        With the same coordinates, inputs and outputs.
    names : (str, str)
        What tells them apart, in words.
    noise : ndarray, shape (ny,)
        Of each output, in its unit.
    known : mapping of str to float
        Standard errors of the numbers of `second` that a fit may move; infinite ones for numbers
        that the record says nothing about.
    precision : ndarray, shape (p, p)
        How well the record knows these numbers together: the inverse of their covariance.
    """

    first: MechanicalModel
    second: MechanicalModel
    names: tuple[str, str]
    noise: Array
    known: dict[str, float]
    precision: Array


@dataclass(frozen=True, eq=False)
class Distance:
    """How far two machines are apart in one experiment.

    Attributes
    ----------
    first, second : ndarray, shape (samples, ny)
        Outputs.
    adapted : ndarray, shape (samples, ny)
        Outputs of the second after its numbers were moved towards the first, as far as the
        record allows.
    """

    first: Array
    second: Array
    adapted: Array

    @property
    def apart(self) -> Array:
        """Root mean square of the difference as the two are, shape (ny,)."""
        return np.sqrt(np.mean((self.first - self.second) ** 2, axis=0))

    @property
    def left(self) -> Array:
        """Root mean square of the difference after the second took after the first."""
        return np.sqrt(np.mean((self.first - self.adapted) ** 2, axis=0))


class UnusableError(Exception):
    """Why an experiment tells nothing, or cannot be made."""


def distance(
    machines: Machines, experiment: Experiment, reach: Array, policy: ExperimentPolicy = EXPERIMENTS
) -> Distance:
    """Simulate an experiment on both machines.

    Parameters
    ----------
    machines : Machines
    experiment : Experiment
    reach : ndarray, shape (ny,)
        Largest value that each output may take.
    policy : ExperimentPolicy, optional

    Returns
    -------
    Distance

    Raises
    ------
    UnusableError
        If a machine leaves its range or diverges, or nobody could repeat the experiment.
    """
    both = (machines.first, machines.second)
    if experiment.kind == "decay" and machines.first.inputs and any(map(_remembers, both)):
        raise UnusableError("what has a memory also keeps how it was pulled")
    steps = max(needed_substeps(model, _step(experiment), experiment.motion) for model in both)
    first = _run(machines.first, experiment, steps)
    second = _run(machines.second, experiment, steps)
    for run in (first, second):
        if not np.isfinite(run).all():
            raise UnusableError("the machine would run away")
        over = np.max(np.abs(run), axis=0) / reach
        if np.any(over > 1):
            name = machines.first.output_names[int(np.argmax(over))]
            raise UnusableError(f"{name} would reach {over.max():.3g} times its limit")
    found = Distance(first, second, second)
    if np.all(found.apart < policy.clear * machines.noise):
        return found  # nothing that the numbers of the second could do would matter
    push = np.zeros(experiment.initial_state.size)
    push[: push.size // 2] = policy.start * experiment.motion
    moved = replace(experiment, initial_state=experiment.initial_state + push)
    again = Distance(first, _run(machines.first, moved, steps), first)
    if not np.any(again.apart < policy.repeats * found.apart):
        raise UnusableError("a tiny change of the start changes the run as much")
    return replace(found, adapted=_adapted(machines, experiment, first, second, steps, policy))


def _remembers(model: MechanicalModel) -> bool:
    return rest(model).internal.size > 0


def _step(experiment: Experiment) -> float:
    time = experiment.inputs["time"].values
    return float((time[-1] - time[0]) / (time.size - 1))


def _run(model: MechanicalModel, experiment: Experiment, substeps: int) -> Array:
    with np.errstate(all="ignore"):
        data: xr.Dataset = experiment.inputs
        return simulate(model, data, experiment.initial_state, substeps=substeps).outputs


def _adapted(
    machines: Machines,
    experiment: Experiment,
    wanted: Array,
    begin: Array,
    substeps: int,
    policy: ExperimentPolicy,
) -> Array:
    """Return the run of the second machine that comes closest to the first.

    Its numbers move by Gauss-Newton steps on stretches that grow twofold, as over a long run a
    wrong number is a wrong phase; leaving what the record knows of them costs as it does in a fit
    to both experiments.
    """
    if not machines.known:
        return begin
    values = start = np.array([machines.second.parameters[key] for key in machines.known])
    samples, cost = len(wanted), np.inf
    for halvings in range(policy.stretches - 1, -1, -1):
        length = max(samples >> halvings, 2)
        head = replace(experiment, inputs=experiment.inputs.isel(time=slice(0, length)))
        stretch = _Stretch(machines, head, wanted[:length], start, substeps)
        values, cost = _closer(stretch, values, policy)
    whole = _Stretch(machines, experiment, wanted, start, substeps)
    found = whole.run(values)
    if found is None or not cost < whole.cost(begin, start):
        return begin
    return found


@dataclass(frozen=True, eq=False)
class _Stretch:
    """The beginning of an experiment, and what the second machine should do in it."""

    machines: Machines
    experiment: Experiment
    wanted: Array
    start: Array
    substeps: int

    def run(self, values: Array) -> Array | None:
        """Return the outputs with other numbers; None for numbers that cannot be."""
        keys = self.machines.known
        try:
            tried = self.machines.second.with_parameters(
                dict(zip(keys, values.tolist(), strict=True))
            )
        except InvalidInputError:  # a negative mass
            return None
        run = _run(tried, self.experiment, self.substeps)
        return run if np.isfinite(run).all() else None

    def error(self, run: Array) -> Array:
        """Return what the run leaves, over the noise."""
        return ((self.wanted - run) / self.machines.noise).ravel()

    def cost(self, run: Array | None, values: Array) -> float:
        """Return the sum of squares, and what it costs to leave what the record knows."""
        if run is None:
            return np.inf
        moved = values - self.start
        return float(np.sum(self.error(run) ** 2) + moved @ self.machines.precision @ moved)


def _closer(stretch: _Stretch, values: Array, policy: ExperimentPolicy) -> tuple[Array, float]:
    """Return numbers with which the second machine is closer to the first, and their cost."""
    start, precision = stretch.start, stretch.machines.precision
    known = np.array(list(stretch.machines.known.values()))
    sizes = np.abs(start)
    error = np.where(np.isfinite(known), known, 0.0)
    widest = np.maximum(policy.widest * sizes, 3 * error)
    small = policy.step * np.where(sizes > 0, sizes, error)
    small = np.where((error > 0) & (error < small), error, small)
    scaled = precision * np.outer(small, small)
    best = stretch.run(values)
    cost = stretch.cost(best, values)
    for _ in range(policy.rounds):
        if best is None:
            break
        slopes = np.zeros((best.size, values.size))
        for j in np.flatnonzero(small > 0).tolist():
            ahead = values.copy()
            ahead[j] += small[j]
            run = stretch.run(ahead)
            if run is not None:
                slopes[:, j] = ((run - best) / stretch.machines.noise).ravel()
        moved = np.divide(values - start, small, out=np.zeros_like(values), where=small > 0)
        pull = slopes.T @ stretch.error(best) - scaled @ moved
        change = small * (np.linalg.pinv(slopes.T @ slopes + scaled, 1e-10, hermitian=True) @ pull)
        before = cost
        for share in (1.0, 0.5, 0.2, 0.05):
            there = start + np.clip(values + share * change - start, -widest, widest)
            run = stretch.run(there)
            if stretch.cost(run, there) < cost:
                values, best, cost = there, run, stretch.cost(run, there)
                break
        if not cost < policy.settled * before:
            break
    return values, cost
