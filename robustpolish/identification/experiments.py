"""Experiment design for model discrimination: candidate excitations and their distances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from scipy.signal import chirp

from robustpolish.base.arrays import Array
from robustpolish.base.results import shown
from robustpolish.errors import InvalidInputError
from robustpolish.identification.diagnosis.findings import IndistinguishablePair
from robustpolish.identification.fit.result import Refit
from robustpolish.identification.observer.kalman import displacement_amplitude, excited_bandwidth
from robustpolish.identification.observer.runs import rest
from robustpolish.identification.policy import POLICY
from robustpolish.identification.record import Record, poles_of
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import ACCELERATION, DISPLACEMENT, VELOCITY, Input
from robustpolish.machines.simulation import needed_substeps, simulate_model

# Machines of an indistinguishable pair.


def machine_pair(
    model: MechanicalModel, pair: IndistinguishablePair
) -> tuple[MechanicalModel, MechanicalModel]:
    """Return a model with one effect of a pair, and with the other in its place.

    Parameters
    ----------
    model : MechanicalModel
        What a diagnosis ended with.
    pair : IndistinguishablePair

    Returns
    -------
    first, second : MechanicalModel
        The effect that the model has already comes first.
    """
    there, other = pair.first, pair.second
    if _place(model, there) is None and _place(model, other) is not None:
        there, other = other, there
    first = model
    if _place(model, there) is None:
        first = replace(model, effects=(*model.effects, there))
    place = _place(first, there)
    rest = [e for i, e in enumerate(first.effects) if i != place]
    bare = replace(first, effects=tuple(rest))
    same = _place(bare, other)
    if same is None:
        return first, replace(bare, effects=(*rest, other))
    # friction of unlike size in both directions: a number more of what is there already
    rest[same] = rest[same].with_values({**rest[same].values, **other.parameters})
    return first, replace(bare, effects=tuple(rest))


def _place(model: MechanicalModel, effect: Effect) -> int | None:
    same = (i for i, e in enumerate(model.effects) if (e.kind, e.at) == (effect.kind, effect.at))
    return next(same, None)


def describe_difference(first: MechanicalModel, second: MechanicalModel) -> tuple[str, str]:
    """Return what tells two models from each other: effects that only one has, else their names."""
    own = [[str(e) for e in model.effects] for model in (first, second)]
    found = []
    for mine, others, nth, model in (
        (own[0], own[1], "first", first), (own[1], own[0], "second", second),
    ):  # fmt: skip
        only = [text for text in mine if text not in others]
        found.append(" and ".join(only) or f"{model.name or 'the model'} ({nth})")
    return found[0], found[1]


def precision_of(covariance: xr.DataArray) -> Array:
    """Return the inverse of a covariance; zero for what it leaves open.

    Parameters
    ----------
    covariance : xarray.DataArray
        Infinite variances for numbers that were not seen.

    Examples
    --------
    >>> both = xr.DataArray([[4.0, 0.0], [0.0, np.inf]], dims=("parameter", "other"))
    >>> precision_of(both)
    array([[0.25, 0.  ],
           [0.  , 0.  ]])
    """
    values = covariance.values
    seen = np.flatnonzero(np.isfinite(np.diag(values)) & (np.diag(values) > 0)).tolist()
    found = np.zeros_like(values)
    block = values[np.ix_(seen, seen)]
    size = np.sqrt(np.diag(block))
    inverse = np.linalg.pinv(block / np.outer(size, size), rcond=1e-10, hermitian=True)
    found[np.ix_(seen, seen)] = inverse / np.outer(size, size)
    return found


def parameter_precision(fitted: Refit) -> tuple[dict[str, float], Array]:
    """Return the standard errors of a refit's numbers, and their precision together."""
    return {key: float(error) for key, error in fitted.stderr.items()}, precision_of(
        fitted.covariance
    )


# Settings of the experiment search.


@dataclass(frozen=True)
class ExperimentPolicy:
    """What experiments are tried, and when one tells two machines apart.

    Attributes
    ----------
    times : tuple of float
        Amplitudes, as multiples of those of the record: forces that grow with different powers of
        the motion, that saturate or that need a least motion show within a decade and a half.
    samples : int
        Longest experiment; 8000 samples hold some dozen swings of most machines, and all
        experiments together take seconds.
    slow : float
        Swings of the slowest mode within one to and fro of a slow one: fewer, and inertia
        and damping join in.
    fro : float
        Turns of a slow to and fro: one to leave the start behind, one and a half to see both ways.
    swings : float
        Of the slowest mode that a free decay and a sweep have time for.
    below, above : float
        Where a sweep begins and ends, as multiples of the lowest and of the highest frequency.
    nyquist : float
        Share of the sampling rate above which nothing is excited: ten samples per turn.
    reach : float
        Times its largest value in the record that an output may reach: ten for the largest
        amplitude, and a little for what a resonance adds. A machine has stops.
    repeats : float
        Share of the difference that may come from a start which errs by `start` of the amplitude;
        beyond, an experiment tells nothing because nobody could repeat it.
    start : float
        See `repeats`; a hundredth of a per cent of the motion is a good sensor's noise.
    rounds, stretches : int
        Steps that the numbers of the second machine may take towards the first on each stretch,
        and how many stretches there are, each twice as long as the one before: over the whole of
        thirty swings a stiffness that is 2 % off is a turn off.
    settled : float
        Share of the sum of squares that a step has to come below to be followed by another.
    step : float
        Change of a number for a derivative, as a share of it, where its error is not known.
    widest : float
        Share by which such a step may move a number: beyond, nothing is linear in it.
    sure : float
        Times the noise that the difference should be for an experiment to be recommended at an
        amplitude; larger amplitudes cost wear, and are proposed only where smaller ones fall short.
    """

    times: tuple[float, ...] = (0.3, 1.0, 3.0, 10.0)
    samples: int = 8000
    slow: float = 20.0
    fro: float = 2.5
    swings: float = 30.0
    below: float = 0.3
    above: float = 2.0
    nyquist: float = 0.1
    reach: float = 12.0
    repeats: float = 0.3
    start: float = 1e-4
    rounds: int = 3
    stretches: int = 5
    settled: float = 0.97
    step: float = 0.01
    widest: float = 0.1
    sure: float = 3.0

    @property
    def clear(self) -> float:
        """Times the noise from which the wrong machine errs visibly more than the right one.

        Its error is noise and difference together, and a diagnosis calls a fall by `visible_fall`
        visible.
        """
        return float(np.sqrt(1 / (1 - POLICY.visible_fall) ** 2 - 1))


EXPERIMENTS = ExperimentPolicy()
"""What `tell_apart` goes by."""


KINDS = ("record", "step", "to and fro", "sweep", "decay")


@dataclass(frozen=True, eq=False)
class Experiment:
    """An excitation of a machine that begins at rest.

    Attributes
    ----------
    kind : str
        ``record`` (the inputs of the record, scaled), ``step``, ``to and fro`` (slow), ``sweep``
        or ``decay`` (free, from an initial displacement).
    channel : str
        The input that is driven, or the coordinate that is pulled and let go.
    times : float
        Amplitude as a multiple of the record's.
    amplitude : float
        Largest value of the channel, in `unit`.
    unit : str
    band : tuple of float
        Lowest and highest frequency that is driven, in Hz; empty for a step, a decay and the
        record.
    inputs : xarray.Dataset
        All inputs of the model over ``time``.
    initial_state : ndarray, shape (n,)
        Free displacements, then velocities.
    motion : float
        Displacements to expect, in m or rad.
    """

    kind: str
    channel: str
    times: float
    amplitude: float
    unit: str
    band: tuple[float, ...]
    inputs: xr.Dataset
    initial_state: Array
    motion: float

    def __str__(self) -> str:
        size = f"{shown(self.amplitude, 3)} {self.unit}"
        many = f"{self.times:g} times that of the record"
        if self.kind == "record":
            return (
                f"the record's own excitation times {self.times:g}, up to {size} on {self.channel}"
            )
        if self.kind == "step":
            return f"a step of {size} on {self.channel} ({many})"
        if self.kind == "decay":
            return f"a free decay after {self.channel} is let go at {size} ({many})"
        low, high = (f"{f:.3g}" for f in (self.band[0], self.band[-1]))
        if self.kind == "to and fro":
            return f"slowly to and fro on {self.channel}, up to {size} ({many}) at {low} Hz"
        return f"a sweep on {self.channel}, up to {size} ({many}) from {low} to {high} Hz"


def experiments(
    model: MechanicalModel,
    record: Record,
    places: Sequence[str] = (),
    limits: Mapping[str, float] | None = None,
) -> list[Experiment]:
    """Return the experiments that the inputs of a model allow.

    Parameters
    ----------
    model : MechanicalModel
    record : Record
        Says how large inputs and motions are.
    places : sequence of str, optional
        Coordinates that may be pulled; those of the effects in question. All by default.
    limits : mapping of str to float, optional
        Largest value that an input may take, in its unit.

    Returns
    -------
    list of Experiment
    """
    made = [*_driven(model, record), *_decays(model, record, places)]
    allowed = dict(limits or {})
    return [e for e in made if e.amplitude <= allowed.get(e.channel, np.inf) * (1 + 1e-9)]


def _driven(model: MechanicalModel, record: Record) -> list[Experiment]:
    """Return the experiments with inputs: each alone, and those of the record together."""
    low, high = _frequencies(model, record)
    motion = displacement_amplitude(model, record, excited_bandwidth(model, record))
    drives = [item for item in model.inputs if _drives(model, item)]
    sizes = {item.name: float(np.max(np.abs(record.data[item.name].values))) for item in drives}
    drives = [item for item in drives if sizes[item.name] > 0]
    found = []
    for times in EXPERIMENTS.times:
        common = {"times": times, "motion": times * motion, "initial_state": _still(model)}
        if drives:
            first = drives[0]
            found.append(
                Experiment(
                    kind="record", channel=first.name, amplitude=times * sizes[first.name],
                    unit=model.unit_of(first), band=(),
                    inputs=_scaled(model, record, times), **common,
                )
            )  # fmt: skip
        for item in drives:
            for kind, band, wave in _waves(item, record.dt, low, high):
                found.append(
                    Experiment(
                        kind=kind, channel=item.name, amplitude=times * sizes[item.name],
                        unit=model.unit_of(item), band=band,
                        inputs=_single_input(model, record, item, times * sizes[item.name] * wave),
                        **common,
                    )
                )  # fmt: skip
    return found


def _drives(model: MechanicalModel, item: Input) -> bool:
    """Whether an input moves the machine by itself; derivatives follow their displacement."""
    return item.imposes in (None, DISPLACEMENT) and item.on[0] not in model.channels


def _waves(
    item: Input, dt: float, low: float, high: float
) -> list[tuple[str, tuple[float, ...], Array]]:
    """Return kind, band and samples of the waves that an input can make, of size 1.

    A motion cannot jump, nor have corners.
    """
    longest = EXPERIMENTS.samples * dt
    slow = max(low / EXPERIMENTS.slow, EXPERIMENTS.fro / longest)
    turn = np.arange(round(EXPERIMENTS.fro / slow / dt)) * dt * slow
    time = np.arange(min(EXPERIMENTS.samples, max(500, round(EXPERIMENTS.swings / low / dt)))) * dt
    band = (
        max(EXPERIMENTS.below * low, 1 / time[-1]),
        min(EXPERIMENTS.above * high, EXPERIMENTS.nyquist / dt),
    )
    sweep = chirp(time, band[0], time[-1], band[1], "logarithmic", phi=-90)
    if item.imposes is not None:
        begin = np.minimum(1.0, 4 * turn)
        swing = begin * np.sin(2 * np.pi * turn)
        return [("to and fro", (slow,), swing), ("sweep", band, sweep * np.minimum(1, time * low))]
    triangle = 2 / np.pi * np.arcsin(np.sin(2 * np.pi * turn))
    return [
        ("step", (), np.where(np.arange(time.size) < time.size // 20, 0.0, 1.0)),
        ("to and fro", (slow,), triangle),
        ("sweep", band, sweep),
    ]


def _scaled(model: MechanicalModel, record: Record, times: float) -> xr.Dataset:
    """Return the inputs of the record times a factor; other signals stay as they were."""
    part = record.data.isel(time=slice(0, EXPERIMENTS.samples))
    columns = {
        item.name: part[item.name] * (1.0 if item.on[0] in model.channels else times)
        for item in model.inputs
    }
    return xr.Dataset(columns, {"time": part["time"].values - part["time"].values[0]})


def _single_input(
    model: MechanicalModel, record: Record, driven: Input | None, wave: Array
) -> xr.Dataset:
    """Return inputs of which at most one is driven.

    Other signals keep their mean, other forces and motions are zero.
    """
    time = np.arange(wave.size) * record.dt
    columns: dict[str, Array] = {}
    for item in model.inputs:
        columns[item.name] = np.zeros(wave.size)
        if item is driven:
            columns[item.name] = wave
        elif item.on[0] in model.channels:
            columns[item.name] += float(record.data[item.name].mean())
        elif driven is not None and driven.imposes and item.imposes and item.on == driven.on:
            order = {VELOCITY: 1, ACCELERATION: 2}[item.imposes]
            rate = wave * driven.gain
            for _ in range(order):
                rate = np.gradient(rate, record.dt)
            columns[item.name] = rate / item.gain
    return xr.Dataset({k: ("time", v) for k, v in columns.items()}, {"time": time})


def _decays(model: MechanicalModel, record: Record, places: Sequence[str]) -> list[Experiment]:
    """Return free decays after a pull at a coordinate, as a rope makes it."""
    m = model.matrices
    free = m.free.tolist()
    names = [name for name in model.free if name in places] or list(model.free)
    if not free:
        return []
    stiffness = m.K[np.ix_(free, free)]
    if np.linalg.cond(stiffness) > 1e12:
        return []  # nothing holds the machine: it cannot be pulled against anything
    shapes = np.linalg.inv(stiffness)
    size = displacement_amplitude(model, record, excited_bandwidth(model, record))
    low = _frequencies(model, record)[0]
    samples = min(EXPERIMENTS.samples, max(500, round(EXPERIMENTS.swings / low / record.dt)))
    still = _single_input(model, record, None, np.zeros(samples))
    found = []
    for name in names:
        i = list(model.free).index(name)
        if shapes[i, i] <= 0:
            continue
        for times in EXPERIMENTS.times:
            pulled = times * size * shapes[:, i] / shapes[i, i]
            found.append(
                Experiment(
                    kind="decay", channel=name, times=times, amplitude=times * size,
                    unit="rad" if model.dof(name).rotational else "m", band=(), inputs=still,
                    initial_state=np.concatenate([pulled, np.zeros(len(free))]),
                    motion=times * size,
                )
            )  # fmt: skip
    return found


def _still(model: MechanicalModel) -> Array:
    return np.zeros(2 * len(model.free))


def _frequencies(model: MechanicalModel, record: Record) -> tuple[float, float]:
    """Return the lowest and the highest frequency of interest in Hz.

    Those of the modes; of a machine without any that swings, where the record moves.
    """
    top = EXPERIMENTS.nyquist / record.dt
    found = [excited_bandwidth(model, record) / (2 * np.pi)]
    poles = poles_of(model)
    swinging = [float(f) for f in np.abs(poles[poles.imag > 0]) / (2 * np.pi) if f < top]  # pyright: ignore[reportAttributeAccessIssue]
    found = swinging or found
    return min(min(found), top / 2), min(max(found), top)


# Distance of two machines in an experiment, before and after a refit of the second to the first.


@dataclass(frozen=True, eq=False)
class MachinePair:
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


class UnusableExperimentError(Exception):
    """Why an experiment tells nothing, or cannot be made."""


def distance(
    machines: MachinePair,
    experiment: Experiment,
    reach: Array,
) -> Distance:
    """Simulate an experiment on both machines.

    Parameters
    ----------
    machines : MachinePair
    experiment : Experiment
    reach : ndarray, shape (ny,)
        Largest value that each output may take.

    Returns
    -------
    Distance

    Raises
    ------
    UnusableExperimentError
        If a machine leaves its range or diverges, or nobody could repeat the experiment.
    """
    both = (machines.first, machines.second)
    if (
        experiment.kind == "decay"
        and machines.first.inputs
        and any(map(_has_internal_states, both))
    ):
        raise UnusableExperimentError("what has a memory also keeps how it was pulled")
    steps = max(needed_substeps(model, _step(experiment), experiment.motion) for model in both)
    first = _run(machines.first, experiment, steps)
    second = _run(machines.second, experiment, steps)
    for run in (first, second):
        if not np.isfinite(run).all():
            raise UnusableExperimentError("the machine would run away")
        over = np.max(np.abs(run), axis=0) / reach
        if np.any(over > 1):
            name = machines.first.output_names[int(np.argmax(over))]
            raise UnusableExperimentError(f"{name} would reach {over.max():.3g} times its limit")
    found = Distance(first, second, second)
    if np.all(found.apart < EXPERIMENTS.clear * machines.noise):
        return found  # nothing that the numbers of the second could do would matter
    push = np.zeros(experiment.initial_state.size)
    push[: push.size // 2] = EXPERIMENTS.start * experiment.motion
    moved = replace(experiment, initial_state=experiment.initial_state + push)
    again = Distance(first, _run(machines.first, moved, steps), first)
    if not np.any(again.apart < EXPERIMENTS.repeats * found.apart):
        raise UnusableExperimentError("a tiny change of the start changes the run as much")
    return replace(found, adapted=_adapted(machines, experiment, first, second, steps))


def _has_internal_states(model: MechanicalModel) -> bool:
    return rest(model).internal.size > 0


def _step(experiment: Experiment) -> float:
    time = experiment.inputs["time"].values
    return float((time[-1] - time[0]) / (time.size - 1))


def _run(model: MechanicalModel, experiment: Experiment, substeps: int) -> Array:
    with np.errstate(all="ignore"):
        data: xr.Dataset = experiment.inputs
        return simulate_model(model, data, experiment.initial_state, substeps=substeps).outputs


def _adapted(
    machines: MachinePair,
    experiment: Experiment,
    wanted: Array,
    begin: Array,
    substeps: int,
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
    for halvings in range(EXPERIMENTS.stretches - 1, -1, -1):
        length = max(samples >> halvings, 2)
        head = replace(experiment, inputs=experiment.inputs.isel(time=slice(0, length)))
        stretch = _Stretch(machines, head, wanted[:length], start, substeps)
        values, cost = _closer(stretch, values)
    whole = _Stretch(machines, experiment, wanted, start, substeps)
    found = whole.run(values)
    if found is None or not cost < whole.cost(begin, start):
        return begin
    return found


@dataclass(frozen=True, eq=False)
class _Stretch:
    """The beginning of an experiment, and what the second machine should do in it."""

    machines: MachinePair
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


def _closer(stretch: _Stretch, values: Array) -> tuple[Array, float]:
    """Return numbers with which the second machine is closer to the first, and their cost."""
    start, precision = stretch.start, stretch.machines.precision
    known = np.array(list(stretch.machines.known.values()))
    sizes = np.abs(start)
    error = np.where(np.isfinite(known), known, 0.0)
    widest = np.maximum(EXPERIMENTS.widest * sizes, 3 * error)
    small = EXPERIMENTS.step * np.where(sizes > 0, sizes, error)
    small = np.where((error > 0) & (error < small), error, small)
    scaled = precision * np.outer(small, small)
    best = stretch.run(values)
    cost = stretch.cost(best, values)
    for _ in range(EXPERIMENTS.rounds):
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
        if not cost < EXPERIMENTS.settled * before:
            break
    return values, cost
