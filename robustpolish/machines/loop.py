"""The sampled controllers of a model, as its runs take them: built, and followed along a record."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.base.arrays import Array
from robustpolish.base.checks import described, invalid, misfit
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.kind import Timing
from robustpolish.machines.mechanical.data import MechanicalData
from robustpolish.machines.mechanical.feedback import Feedback
from robustpolish.machines.stepper import LoopMatrices, replay_loops

_MOST_PARTS = 64
"""Parts of a sampling step of a record, at most, of which periods of controllers are multiples."""
_SAME = 1e-6
"""Relative difference between a period and a multiple that rounding makes."""
_EXACT = 1e-9
"""Part of a step of which a delay of whole steps may lack by rounding."""
_TOLD, _ROUNDS = 500, 4
"""Samples that tell how controllers began, and rounds of a search for that."""
_LATE = 4
"""Steps per sample, at least, where commands change within a step."""


def loop_steps(model: MechanicalData, dt: float, least: int = 1) -> int:
    """Return steps per sample, `least` or more, at whose ends all controllers sample.

    Raises
    ------
    InvalidInputError
        If a period does not suit the sampling step.
    """
    parts = 1
    for i, loop in enumerate(model.feedback):
        ratio = Fraction(loop.period / dt).limit_denominator(_MOST_PARTS)
        if not ratio or abs(float(ratio) * dt / loop.period - 1) > _SAME:
            shown = described(f"{loop.period:.6g} s at samples {dt:.6g} s apart")
            want = f"a multiple of these, or of a part down to 1/{_MOST_PARTS}"
            remedy = "Resample the record, or correct the period."
            raise invalid(("feedback", i, "period"), shown, want, remedy)
        parts = math.lcm(parts, ratio.denominator)
    late = [
        _delay(model, loop, name) / dt * parts % 1
        for loop in model.feedback
        for name in loop.drives
    ]
    moves = any("delay" in loop.unknown for loop in model.feedback)
    if moves or any(min(part, 1 - part) > _SAME for part in late):
        least = max(least, _LATE)
    return parts * math.ceil(least / parts)


def _effects_on(model: MechanicalData, name: str) -> list[Effect]:
    return [e for e in model.effects if e.definition.domain == "input" and e.at[0] == name]


def _delay(model: MechanicalData, loop: Feedback, name: str) -> float:
    return loop.delay + sum(timing.delay for timing in _timings(model, name))


def _timings(model: MechanicalData, name: str) -> list[Timing]:
    known = [(e.definition.timing, e.values) for e in _effects_on(model, name)]
    return [Timing(*timing(values)) for timing, values in known if timing is not None]


def straight(model: MechanicalData) -> bool:
    """Return whether loops are linear, actuators that they drive included."""
    plain = all(loop is loop.linear for loop in model.feedback)
    return plain and not any(_effects_on(model, name) for name in model.driven)


def loop_matrices(
    model: MechanicalData, step: float, seen: Array, rounds: bool = True
) -> LoopMatrices:
    """Return the controllers of a model for substeps of `step` seconds.

    Parameters
    ----------
    model : MechanicalData
    step : float
        In s.
    seen : ndarray, shape (2, ny)
        Gain and offset of the sensors.
    rounds : bool, optional
        Whether converters round.
    """
    loops, outputs = model.feedback, model.output_names
    names, asked = model.commands, model.references
    known = {name: i for i, name in enumerate((*asked, *(f"\0{o}" for o in outputs), *names))}
    parts = [loop.discrete() for loop in loops]
    count, nc, nv = len(loops), len(names), len(known)
    nx = max((len(matrices[0]) for matrices, _ in parts), default=0)
    A, W = np.zeros((count, nx, nx)), np.zeros((count, nx, nc))
    B, C, D = np.zeros((count, nx, nv)), np.zeros((count, nc, nx)), np.zeros((count, nc, nv))
    owner, steps = np.zeros(nc, dtype=np.int64), np.zeros((3, len(outputs)))
    steps[:2] = seen
    limits, actuator = np.zeros((4, nc)), np.zeros((4, nc))
    signals = model.matrices.signals
    signal = np.array([signals.index(n) if n in signals else -1 for n in names], dtype=np.int64)
    late, first = np.zeros(count), 0
    for k, (loop, ((a, b, c, d), gain)) in enumerate(zip(loops, parts, strict=True)):
        n, nu = len(a), len(loop.drives)
        own = slice(first, first + nu)
        see = np.zeros((b.shape[1], nv))  # errors, then what is added, from all that is seen
        for i, term in enumerate(loop.terms):
            see[i, known[f"\0{term.of}"]] = -1.0
            if term.reference:
                see[i, known[term.reference]] += 1.0
            j = outputs.index(term.of)
            steps[2, j] = max(steps[2, j], term.quantum * rounds)
        for i, name in enumerate(loop.feedforward, len(loop.terms)):
            see[i, known[name]] = 1.0
        A[k, :n, :n], B[k, :n], C[k, own, :n], D[k, own] = a, b @ see, c, d @ see
        W[k, :n, own] = gain
        owner[own] = k
        rise = math.inf if loop.rate_limit is None else loop.rate_limit * loop.period
        limits[:2, own] = loop.bounds
        limits[2:, own] = np.array([[rise], [loop.quantum * rounds]])
        late[k] = _delay(model, loop, loop.drives[0]) / step
        for i, name in enumerate(loop.drives, first):
            actuator[:, i] = _actuator(model, name, step)
        first += nu
    every = np.array([round(loop.period / step) for loop in loops], dtype=np.int64)
    whole = np.floor(late + _EXACT)
    part = np.maximum(late - whole, 0.0)
    low, high, rise, rounds_to = limits
    return LoopMatrices(
        every, whole.astype(np.int64), part, A, B, C, D, W, owner, signal, low, high, rise,
        rounds_to, steps, actuator,
    )  # fmt: skip


def _actuator(model: MechanicalData, name: str, step: float) -> tuple[float, float, float, float]:
    """Return gain, dead zone and limit of what a loop drives, and what its lag leaves of a step."""
    found = {"gain": 1.0, "width": 0.0, "limit": math.inf}
    for effect in _effects_on(model, name):
        for key, value in effect.values.items():
            if effect.definition.timing is None and key not in found:
                shown = described(f"{effect} on {name!r}, which a loop drives")
                want = "a gain, a dead zone, a limit, a delay or a lag there"
                raise invalid(effect.kind, shown, want, "Leave the effect out.")
            if key in found:
                found[key] = found[key] * value if key == "gain" else value
    lags = [timing.lag for timing in _timings(model, name) if timing.lag > 0]
    return *found.values(), math.exp(-step / sum(lags)) if lags else 0.0  # type: ignore[return-value]


class LoopCourse(NamedTuple):
    """What controllers are told along pieces of record, and how they are at the first samples.

    Attributes
    ----------
    asked : ndarray, shape (samples, references)
    phase : ndarray of int, shape (pieces,)
        Samples since the controllers began.
    states, sent : ndarray
        States of the controllers, and rings of their commands, one for each piece.
    commands : ndarray, shape (samples, nc)
        Along measured outputs.
    """

    asked: Array
    phase: NDArray[np.int64]
    states: Array
    sent: Array
    commands: Array

    def at(self, rows: Sequence[int], samples: NDArray[np.int64]) -> LoopCourse:
        """Return pieces that begin at rows of a course with states for every sample."""
        chosen = (self.phase[rows], self.states[rows], self.sent[rows], self.commands[samples])
        return LoopCourse(np.ascontiguousarray(self.asked[samples]), *chosen)


def still_course(asked: Array, loops: LoopMatrices) -> LoopCourse:
    """Return a course of one piece along which controllers begin with nothing."""
    ring, (count, nx, _) = waiting(loops), loops.A.shape
    states, sent = np.zeros((1, count, nx)), np.zeros((1, len(loops.owner), ring))
    return LoopCourse(asked, np.zeros(1, dtype=np.int64), states, sent, np.zeros((0, 0)))


def waiting(loops: LoopMatrices) -> int:
    """Return how many commands of each loop are waiting at most, and the two last ones."""
    return int(np.max(-(-(loops.whole + 2) // np.maximum(loops.every, 1)), initial=0)) + 2


def followed(model: MechanicalData, data: xr.Dataset) -> LoopCourse:
    """Follow the controllers of a model along measured outputs: a piece begins at every sample.

    They begin as what they commanded says, where all of that was recorded. What they did before a
    record is not known otherwise, and they begin settled at its first sample.

    Parameters
    ----------
    model : MechanicalData
    data : xarray.Dataset
        With references and outputs over ``time``.
    """
    time = np.asarray(data["time"].values, dtype=float)
    dt = (time[-1] - time[0]) / (time.size - 1)
    steps = loop_steps(model, dt)
    sensors = np.outer([1.0, 0.0], np.ones(len(model.outputs)))  # what is measured has them in it
    loops = loop_matrices(model, dt / steps, sensors, rounds=False)
    asked = asked_columns(model, data)
    Y = _columns(data, model.output_names)
    still = still_course(asked, loops)
    v = np.concatenate([asked[0], Y[0], np.zeros(len(loops.owner))])
    states, sent = still.states[0].copy(), still.sent[0].copy()
    for k in range(len(loops.every)):
        own, n = np.flatnonzero(loops.owner == k), states.shape[1]
        pull = np.eye(n) - loops.A[k]
        states[k] = np.linalg.lstsq(pull, loops.B[k] @ v, rcond=1e-9)[0] if n else 0.0
        command = loops.C[k][own] @ states[k] + loops.D[k][own] @ v
        command = np.clip(command, loops.low[own], loops.high[own])
        v[v.size - len(loops.owner) + own] = command
        sent[own] = command[:, None]
    if states.size and all(name in data for name in model.commands):
        told = _columns(data, model.commands)
        states = _told_states(loops, asked, Y, states, sent, steps, told)
    found = replay_loops(loops, asked, Y, states, sent, steps)
    return LoopCourse(asked, np.arange(time.size), *found)


def _told_states(
    loops: LoopMatrices,
    asked: Array,
    Y: Array,
    states: Array,
    sent: Array,
    steps: int,
    told: Array,
) -> Array:
    """Return the first states of controllers with which their commands are those that were told."""
    head = slice(0, _TOLD)

    def left(x: Array) -> Array:
        found = replay_loops(loops, asked[head], Y[head], x.reshape(states.shape), sent, steps)
        return np.ravel(found[2] - told[head])

    x, now = states.ravel(), left(states)
    for _ in range(_ROUNDS):  # limits bend it
        columns = [left(x + unit) - now for unit in np.eye(x.size)]
        tried = x - np.linalg.lstsq(np.column_stack(columns), now, rcond=1e-6)[0]
        after = left(tried)
        if not after @ after < now @ now:
            break
        x, now = tried, after
    return x.reshape(states.shape)


def asked_columns(model: MechanicalData, data: xr.Dataset) -> Array:
    """Return the references of a model's loops, shape (samples, references)."""
    for name in model.references:
        if name not in data:
            raise misfit(
                "data", f"no column {name!r}", "every reference", "Check the column names."
            )
    return _columns(data, model.references)


def _columns(data: xr.Dataset, names: Sequence[str]) -> Array:
    columns = [np.asarray(data[name].values, dtype=float) for name in names]
    return np.column_stack([np.zeros((data.sizes["time"], 0)), *columns])


def with_commands(model: MechanicalData, data: xr.Dataset) -> xr.Dataset:
    """Return data with the commands of loops that they lack, as these follow from the outputs."""
    missing = [name for name in model.driven if name not in data]
    if not missing:
        return data
    course = followed(model, data)
    units: dict[str, Any] = {item.name: model.unit_of(item) for item in model.inputs}
    columns = {
        name: ("time", course.commands[:, model.commands.index(name)], {"units": units[name]})
        for name in missing
    }
    return data.assign(columns)
