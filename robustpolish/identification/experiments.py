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
from robustpolish.identification.findings import IndistinguishablePair
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
    effects = list(model.effects)

    def place(effect: Effect) -> int | None:
        same = (i for i, e in enumerate(effects) if (e.kind, e.at) == (effect.kind, effect.at))
        return next(same, None)

    there, other, first = pair.first, pair.second, model
    if place(there) is None and place(other) is not None:
        there, other = other, there
    if place(there) is None:
        effects.append(there)
        first = replace(model, effects=tuple(effects))
    effects.pop(place(there) or 0)
    same = place(other)
    if same is None:
        effects.append(other)
    else:  # friction of unlike size in both directions: a number more of what is there already
        effects[same] = effects[same].with_values({**effects[same].values, **other.parameters})
    return first, replace(model, effects=tuple(effects))


def describe_difference(first: MechanicalModel, second: MechanicalModel) -> tuple[str, str]:
    """Return what tells two models from each other: effects that only one has, else their names."""

    def own(model: MechanicalModel, other: MechanicalModel, nth: str) -> str:
        others = [str(effect) for effect in other.effects]
        only = [str(effect) for effect in model.effects if str(effect) not in others]
        return " and ".join(only) or f"{model.name or 'the model'} ({nth})"

    return own(first, second, "first"), own(second, first, "second")


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


# What experiments are tried, and when one tells two machines apart.

# Amplitudes, as multiples of those of the record: forces that grow with different powers of the
# motion, that saturate or that need a least motion show within a decade and a half.
_TIMES = (0.3, 1.0, 3.0, 10.0)
# Longest experiment: 8000 samples hold some dozen swings of most machines, and all experiments
# together take seconds.
_SAMPLES = 8000
# Swings of the slowest mode within one to and fro of a slow one: fewer, and inertia and damping
# join in. And its turns: one to leave the start behind, one and a half to see both ways.
_SLOW, _FRO = 20.0, 2.5
# Swings of the slowest mode that a free decay and a sweep have time for.
_SWINGS = 30.0
# Where a sweep begins and ends, as multiples of the lowest and of the highest frequency.
_BELOW, _ABOVE = 0.3, 2.0
# Share of the sampling rate above which nothing is excited: ten samples per turn.
_NYQUIST = 0.1
# Times its largest value in the record that an output may reach: ten for the largest amplitude, and
# a little for what a resonance adds. A machine has stops.
REACH = 12.0
# Share of the difference that may come from a start which errs by that share of the amplitude, a
# good sensor's noise; beyond, an experiment tells nothing because nobody could repeat it.
_REPEATS, _START = 0.3, 1e-4
# Steps that the numbers of the second machine may take towards the first on each stretch, and how
# many stretches there are, each twice as long as the one before: over the whole of thirty swings a
# stiffness that is 2 % off is a turn off.
_ROUNDS, _STRETCHES = 3, 5
# Share of the sum of squares that a step has to come below to be followed by another.
_SETTLED = 0.97
# Change of a number for a derivative, as a share of it, where its error is not known; and the share
# by which a step may move it: beyond, nothing is linear in it.
_STEP, _WIDEST = 0.01, 0.1
# Times the noise that the difference should be for an experiment to be recommended at an amplitude;
# larger amplitudes cost wear, and are proposed only where smaller ones fall short.
SURE = 3.0
# Times the noise from which the wrong machine errs visibly more than the right one: its error is
# noise and difference together, and a diagnosis calls a fall by `visible_fall` visible.
CLEAR = float(np.sqrt(POLICY.at_noise_floor**2 - 1))


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
        size, on = f"{shown(self.amplitude, 3)} {self.unit}", self.channel
        many = f"({self.times:g} times that of the record)"
        band = " to ".join(f"{f:.3g}" for f in self.band)
        return {
            "record": f"the record's own excitation times {self.times:g}, up to {size} on {on}",
            "step": f"a step of {size} on {on} {many}",
            "decay": f"a free decay after {on} is let go at {size} {many}",
            "to and fro": f"slowly to and fro on {on}, up to {size} {many} at {band} Hz",
            "sweep": f"a sweep on {on}, up to {size} {many} from {band} Hz",
        }[self.kind]


def experiments(
    model: MechanicalModel,
    record: Record,
    places: Sequence[str],
    limits: Mapping[str, float] | None,
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
    still = np.zeros(2 * len(model.free))
    # what moves the machine by itself; derivatives follow their displacement
    drives = [
        (item, float(np.max(np.abs(record.data[item.name].values))))
        for item in model.inputs
        if item.imposes in (None, DISPLACEMENT) and item.on[0] not in model.channels
    ]
    drives = [(item, size) for item, size in drives if size > 0]
    found = []
    for times in _TIMES:
        made: list[tuple[str, Input, float, tuple[float, ...], xr.Dataset]] = [
            ("record", *each, (), _scaled(model, record, times)) for each in drives[:1]
        ]
        made += [
            (kind, item, size, band, _single_input(model, record, item, times * size * wave))
            for item, size in drives
            for kind, band, wave in _waves(item, record.dt, low, high)
        ]
        for kind, item, size, band, inputs in made:
            amplitude = times, times * size, model.unit_of(item)
            experiment = Experiment(
                kind, item.name, *amplitude, band, inputs, still, times * motion
            )
            found.append(experiment)
    return found


def _waves(
    item: Input, dt: float, low: float, high: float
) -> list[tuple[str, tuple[float, ...], Array]]:
    """Return kind, band and samples of the waves that an input can make, of size 1.

    A motion cannot jump, nor have corners.
    """
    longest = _SAMPLES * dt
    slow = max(low / _SLOW, _FRO / longest)
    turn = np.arange(round(_FRO / slow / dt)) * dt * slow
    time = np.arange(min(_SAMPLES, max(500, round(_SWINGS / low / dt)))) * dt
    band = (max(_BELOW * low, 1 / time[-1]), min(_ABOVE * high, _NYQUIST / dt))
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
    part = record.data.isel(time=slice(0, _SAMPLES))
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
    samples = min(_SAMPLES, max(500, round(_SWINGS / low / record.dt)))
    still = _single_input(model, record, None, np.zeros(samples))
    found = []
    for name in names:
        i, unit = list(model.free).index(name), "rad" if model.dof(name).rotational else "m"
        for times in _TIMES if shapes[i, i] > 0 else ():
            amplitude = times * size * model.frame.travel((name,))
            start = np.concatenate([amplitude * shapes[:, i] / shapes[i, i], np.zeros(len(free))])
            found.append(
                Experiment("decay", name, times, amplitude, unit, (), still, start, times * size)
            )
    return found


def _frequencies(model: MechanicalModel, record: Record) -> tuple[float, float]:
    """Return the lowest and the highest frequency of interest in Hz.

    Those of the modes; of a machine without any that swings, where the record moves.
    """
    top = _NYQUIST / record.dt
    found = [excited_bandwidth(model, record) / (2 * np.pi)]
    poles = poles_of(model)
    swinging = np.abs(poles[np.imag(poles) > 0]) / (2 * np.pi)
    found = [float(f) for f in swinging if f < top] or found
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
class SimulatedExperiment:
    """An experiment that was simulated on both machines.

    Attributes
    ----------
    experiment : Experiment
    noise : ndarray, shape (ny,)
    first, second : ndarray, shape (samples, ny)
        Outputs.
    adapted : ndarray, shape (samples, ny)
        Outputs of the second after its numbers were moved towards the first, as far as the
        record allows.
    """

    experiment: Experiment
    noise: Array
    first: Array
    second: Array
    adapted: Array

    @property
    def differences(self) -> Array:
        """Root mean square of the difference as the machines are, and after the second adapted.

        Shape (2, ny).
        """
        runs = (self.second, self.adapted)
        return np.array([np.sqrt(np.mean((self.first - run) ** 2, axis=0)) for run in runs])

    @property
    def apart(self) -> float:
        """Difference over noise, of the output that shows it best, as the machines are."""
        return float(np.max(self.differences[0] / self.noise))

    @property
    def left(self) -> float:
        """The same after the numbers of the second machine were fitted to this experiment too."""
        return float(np.max(self.differences[1] / self.noise))

    @property
    def best_output(self) -> int:
        """Place of the output that shows the difference best."""
        return int(np.argmax(self.differences[1] / self.noise))


class UnusableExperimentError(Exception):
    """Why an experiment tells nothing, or cannot be made."""


def simulate_experiment(
    machines: MachinePair, experiment: Experiment, reach: Array
) -> SimulatedExperiment:
    """Simulate an experiment on both machines.

    Parameters
    ----------
    machines : MachinePair
    experiment : Experiment
    reach : ndarray, shape (ny,)
        Largest value that each output may take.

    Returns
    -------
    SimulatedExperiment

    Raises
    ------
    UnusableExperimentError
        If a machine leaves its range or diverges, or nobody could repeat the experiment.
    """
    both = (machines.first, machines.second)
    memory = any(rest(model).internal.size for model in both)
    if experiment.kind == "decay" and machines.first.inputs and memory:
        raise UnusableExperimentError("what has a memory also keeps how it was pulled")
    time = experiment.inputs["time"].values
    step = float((time[-1] - time[0]) / (time.size - 1))
    steps = max(needed_substeps(model, step, experiment.motion) for model in both)
    first, second = (_run(model, experiment, steps) for model in both)
    for run in (first, second):
        if not np.isfinite(run).all():
            raise UnusableExperimentError("the machine would run away")
        over = np.max(np.abs(run), axis=0) / reach
        if np.any(over > 1):
            name = machines.first.output_names[int(np.argmax(over))]
            raise UnusableExperimentError(f"{name} would reach {over.max():.3g} times its limit")
    found = SimulatedExperiment(experiment, machines.noise, first, second, second)
    apart = found.differences[0]
    if np.all(apart < CLEAR * machines.noise):
        return found  # nothing that the numbers of the second could do would matter
    push = np.zeros(experiment.initial_state.size)
    push[: push.size // 2] = _START * experiment.motion
    moved = replace(experiment, initial_state=experiment.initial_state + push)
    again = replace(found, second=_run(machines.first, moved, steps)).differences[0]
    if not np.any(again < _REPEATS * apart):
        raise UnusableExperimentError("a tiny change of the start changes the run as much")
    return replace(found, adapted=_adapted(machines, found, steps))


def _run(model: MechanicalModel, experiment: Experiment, substeps: int) -> Array:
    with np.errstate(all="ignore"):
        data: xr.Dataset = experiment.inputs
        return simulate_model(model, data, experiment.initial_state, substeps=substeps).outputs


def _adapted(machines: MachinePair, both: SimulatedExperiment, substeps: int) -> Array:
    """Return the run of the second machine that comes closest to the first.

    Its numbers move by Gauss-Newton steps on stretches that grow twofold, as over a long run a
    wrong number is a wrong phase; leaving what the record knows of them costs as it does in a fit
    to both experiments.
    """
    if not machines.known:
        return both.second
    start = np.array([machines.second.parameters[key] for key in machines.known])
    known, sizes = np.array(list(machines.known.values())), np.abs(start)
    error = np.where(np.isfinite(known), known, 0.0)
    widest = np.maximum(_WIDEST * sizes, 3 * error)
    small = _STEP * np.where(sizes > 0, sizes, error)
    small = np.where((error > 0) & (error < small), error, small)
    scaled = machines.precision * np.outer(small, small)

    def run_with(values: Array, samples: int) -> Array | None:
        """Return the first outputs with other numbers; None for numbers that cannot be."""
        changed = dict(zip(machines.known, values.tolist(), strict=True))
        head = both.experiment.inputs.isel(time=slice(0, samples))
        try:
            tried = machines.second.with_parameters(changed)
        except InvalidInputError:  # a negative mass
            return None
        run = _run(tried, replace(both.experiment, inputs=head), substeps)
        return run if np.isfinite(run).all() else None

    def error_of(run: Array) -> Array:
        """Return what a run leaves, over the noise."""
        return ((both.first[: len(run)] - run) / machines.noise).ravel()

    def cost(run: Array, values: Array) -> float:
        """Return the sum of squares, and what it costs to leave what the record knows."""
        moved = values - start
        return float(np.sum(error_of(run) ** 2) + moved @ machines.precision @ moved)

    def closer(values: Array, samples: int) -> tuple[Array, float]:
        """Return numbers with which the second machine is closer to the first, and their cost."""
        best = run_with(values, samples)
        if best is None:
            return values, np.inf
        least = cost(best, values)
        for _ in range(_ROUNDS):
            slopes = np.zeros((best.size, values.size))
            for j in np.flatnonzero(small > 0).tolist():
                ahead = values.copy()
                ahead[j] += small[j]
                if (run := run_with(ahead, samples)) is not None:
                    slopes[:, j] = ((run - best) / machines.noise).ravel()
            moved = np.divide(values - start, small, out=np.zeros_like(values), where=small > 0)
            pull = slopes.T @ error_of(best) - scaled @ moved
            gauss = np.linalg.pinv(slopes.T @ slopes + scaled, 1e-10, hermitian=True)
            change, before = small * (gauss @ pull), least
            for share in (1.0, 0.5, 0.2, 0.05):
                there = start + np.clip(values + share * change - start, -widest, widest)
                run = run_with(there, samples)
                if run is not None and cost(run, there) < least:
                    values, best, least = there, run, cost(run, there)
                    break
            if not least < _SETTLED * before:
                break
        return values, least

    values, least, samples = start, np.inf, len(both.first)
    for halvings in range(_STRETCHES - 1, -1, -1):
        values, least = closer(values, max(samples >> halvings, 2))
    found = run_with(values, samples)
    return found if found is not None and least < cost(both.second, start) else both.second
