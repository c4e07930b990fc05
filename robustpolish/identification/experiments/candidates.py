"""Experiments that might tell two machines apart, made of what the inputs of a record can do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.signal import chirp

from robustpolish.arrays import Array
from robustpolish.display import shown
from robustpolish.identification.experiments.policy import EXPERIMENTS, ExperimentPolicy
from robustpolish.identification.observer.kalman import amplitude_of, excited_bandwidth
from robustpolish.identification.record import Record
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.parts import ACCELERATION, DISPLACEMENT, VELOCITY, Input

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
    policy: ExperimentPolicy = EXPERIMENTS,
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
    policy : ExperimentPolicy, optional

    Returns
    -------
    list of Experiment
    """
    made = [*_driven(model, record, policy), *_decays(model, record, places, policy)]
    allowed = dict(limits or {})
    return [e for e in made if e.amplitude <= allowed.get(e.channel, np.inf) * (1 + 1e-9)]


def _driven(model: MechanicalModel, record: Record, policy: ExperimentPolicy) -> list[Experiment]:
    """Return the experiments with inputs: each alone, and those of the record together."""
    low, high = _frequencies(model, record, policy)
    motion = amplitude_of(model, record, excited_bandwidth(model, record))
    drives = [item for item in model.inputs if _drives(model, item)]
    sizes = {item.name: float(np.max(np.abs(record.data[item.name].values))) for item in drives}
    drives = [item for item in drives if sizes[item.name] > 0]
    found = []
    for times in policy.times:
        common = {"times": times, "motion": times * motion, "initial_state": _still(model)}
        if drives:
            first = drives[0]
            found.append(
                Experiment(
                    kind="record", channel=first.name, amplitude=times * sizes[first.name],
                    unit=model.unit_of(first), band=(),
                    inputs=_scaled(model, record, times, policy), **common,
                )
            )  # fmt: skip
        for item in drives:
            for kind, band, wave in _waves(item, record.dt, low, high, policy):
                found.append(
                    Experiment(
                        kind=kind, channel=item.name, amplitude=times * sizes[item.name],
                        unit=model.unit_of(item), band=band,
                        inputs=_alone(model, record, item, times * sizes[item.name] * wave),
                        **common,
                    )
                )  # fmt: skip
    return found


def _drives(model: MechanicalModel, item: Input) -> bool:
    """Whether an input moves the machine by itself; derivatives follow their displacement."""
    return item.imposes in (None, DISPLACEMENT) and item.on[0] not in model.channels


def _waves(
    item: Input, dt: float, low: float, high: float, policy: ExperimentPolicy
) -> list[tuple[str, tuple[float, ...], Array]]:
    """Return kind, band and samples of the waves that an input can make, of size 1.

    A motion cannot jump, nor have corners.
    """
    longest = policy.samples * dt
    slow = max(low / policy.slow, policy.fro / longest)
    turn = np.arange(round(policy.fro / slow / dt)) * dt * slow
    time = np.arange(min(policy.samples, max(500, round(policy.swings / low / dt)))) * dt
    band = max(policy.below * low, 1 / time[-1]), min(policy.above * high, policy.nyquist / dt)
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


def _scaled(
    model: MechanicalModel, record: Record, times: float, policy: ExperimentPolicy
) -> xr.Dataset:
    """Return the inputs of the record times a factor; other signals stay as they were."""
    part = record.data.isel(time=slice(0, policy.samples))
    columns = {
        item.name: part[item.name] * (1.0 if item.on[0] in model.channels else times)
        for item in model.inputs
    }
    return xr.Dataset(columns, {"time": part["time"].values - part["time"].values[0]})


def _alone(model: MechanicalModel, record: Record, driven: Input | None, wave: Array) -> xr.Dataset:
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


def _decays(
    model: MechanicalModel, record: Record, places: Sequence[str], policy: ExperimentPolicy
) -> list[Experiment]:
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
    size = amplitude_of(model, record, excited_bandwidth(model, record))
    low = _frequencies(model, record, policy)[0]
    samples = min(policy.samples, max(500, round(policy.swings / low / record.dt)))
    still = _alone(model, record, None, np.zeros(samples))
    found = []
    for name in names:
        i = list(model.free).index(name)
        if shapes[i, i] <= 0:
            continue
        for times in policy.times:
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


def _frequencies(
    model: MechanicalModel, record: Record, policy: ExperimentPolicy
) -> tuple[float, float]:
    """Return the lowest and the highest frequency of interest in Hz.

    Those of the modes; of a machine without any that swings, where the record moves.
    """
    top = policy.nyquist / record.dt
    found = [excited_bandwidth(model, record) / (2 * np.pi)]
    if model.free:
        poles = np.linalg.eigvals(model.matrices.first_order()[0])
        swinging = [float(f) for f in np.abs(poles[poles.imag > 0]) / (2 * np.pi) if f < top]
        found = swinging or found
    return min(min(found), top / 2), min(max(found), top)
