"""Simulation of a model over a record, freely or with observer corrections."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from robustpolish.base.arrays import Array
from robustpolish.base.budget import parallel_map
from robustpolish.identification.observer import kalman
from robustpolish.identification.record import Record, joined_lines, output_sizes
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.loop import LoopCourse, straight
from robustpolish.machines.mechanical.data import MechanicalData, connected, dynamic_effects
from robustpolish.machines.mechanical.equations import slopes_at
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Input
from robustpolish.machines.simulation import (
    InputCourse,
    IntersampleLines,
    NonlinearResponse,
    NonlinearSystem,
    Stepper,
    build_system,
    loop_poles,
    needed_substeps,
)

# Runs over a record.


@dataclass(frozen=True, eq=False)
class InitialState:
    """State of a model at the first sample of a record: mechanical and internal."""

    state: Array
    internal: Array

    @property
    def vector(self) -> Array:
        """Free displacements, their velocities, then internal states of the effects."""
        return np.concatenate([self.state, self.internal])

    def with_vector(self, vector: Array) -> InitialState:
        """Return a start with other values."""
        return InitialState(vector[: self.state.size], vector[self.state.size :])


@dataclass(frozen=True, eq=False)
class StartedPiece:
    """A contiguous piece of record and the state at its first sample."""

    record: Record
    start: InitialState

    def with_start(self, vector: Array) -> StartedPiece:
        """Return the piece with another start."""
        return StartedPiece(self.record, self.start.with_vector(vector))


class Runner:
    """Makes models ready to run, led by the data at one level.

    The steps per sample and the observer's gain are chosen once, for the model it is made with,
    and kept for all models that are tried with it.

    Parameters
    ----------
    model : MechanicalModel
    dt : float
        Sampling step in s.
    amplitude : float
        Displacement amplitude in m or rad; decides on the steps.
    level : Level, optional
        Free by default.
    scales : Scales, optional
        Needed for every level but the free one.
    substeps : int, optional
        Steps per sample; as many as the amplitude asks for by default.
    spend : callable, optional
        Told the steps of every run; runs may be made in several threads.
    """

    def __init__(
        self,
        model: MechanicalModel,
        dt: float,
        amplitude: float,
        level: kalman.Level = kalman.FREE,
        scales: kalman.Scales | None = None,
        substeps: int | None = None,
        spend: Callable[[float], None] = lambda _: None,
    ) -> None:
        self.dt, self.level, self.spend = dt, level, spend
        self.substeps = substeps or needed_substeps(model, dt, amplitude)
        self._leak = None if level.free or scales is None else scales.leak
        self._moves_inputs = any(e.definition.domain == "input" for e in model.effects)
        self._signals: tuple[object, object, Array, IntersampleLines | None] | None = None
        self._course: tuple[object, object, InputCourse, Array] | None = None
        self._followed: tuple[object, object, LoopCourse | None] | None = None
        self.gain: kalman.Gain | None = None
        if self._leak is not None and scales is not None:
            self.gain = kalman.observer_gain(self._system(model), dt, level, scales)

    def run(self, model: MechanicalModel) -> RecordRun:
        """Return a model ready to run."""
        return RecordRun(self, model, Stepper(model, self._system(model), self.dt, self.substeps))

    def _system(self, model: MechanicalModel) -> NonlinearSystem:
        plain = build_system(model, self.dt / self.substeps)
        return plain if self._leak is None else kalman.with_missing_force(model, plain, self._leak)

    def inputs(self, model: MechanicalModel, record: Record) -> Array:
        """Return the model's input signals over a record, shape (samples, signals)."""
        return record.own(self._known(model, record)[2])

    def lines(self, model: MechanicalModel, records: Sequence[Record]) -> IntersampleLines | None:
        """Return what the signals do between the samples of records, None if all are linear."""
        return joined_lines([r.own_lines(self._known(model, r)[3]) for r in records])

    def course(
        self, model: MechanicalModel, records: tuple[Record, ...]
    ) -> tuple[InputCourse, Array]:
        """Return what acts on a model over several pieces of record, and what was measured there.

        The pieces stand one behind the other in the arrays; of those asked for last the answer is
        kept.

        Parameters
        ----------
        model : MechanicalModel
        records : tuple of Record

        Returns
        -------
        course : InputCourse
        measured : ndarray, shape (samples, ny)
        """
        mover = model if self._moves_inputs else model.feedback
        known = self._course
        if known is None or known[0] != records or known[1] is not mover:
            signals = np.concatenate([self.inputs(model, record) for record in records])
            time = np.concatenate([record.time for record in records])
            marks = np.cumsum([0, *(record.samples for record in records)])
            loop = self.loop_course(model, records)
            course = InputCourse.of(signals, self.lines(model, records), time, marks, loop)
            known = self._course = (records, mover, course, np.concatenate([r.Y for r in records]))
        return known[2:]

    def loop_course(self, model: MechanicalModel, records: Sequence[Record]) -> LoopCourse | None:
        """Return what controllers in the loop are told over pieces of record, None without any."""
        known, sets = self._followed, records[0].sets
        if known is None or known[0] is not sets or known[1] is not model.feedback:
            known = self._followed = (sets, model.feedback, records[0].loop_course(model))
        if known[2] is None:
            return None
        samples = [np.arange(r.first, r.first + r.samples) for r in records]
        return known[2].at([r.first for r in records], np.concatenate(samples))

    def _known(
        self, model: MechanicalModel, record: Record
    ) -> tuple[object, object, Array, IntersampleLines | None]:
        mover = model if self._moves_inputs else None
        known = self._signals
        if known is None or known[0] is not record.sets or known[1] is not mover:
            known = (record.sets, mover, record.signals(model), record.lines(model))
            self._signals = known
        return known


@dataclass(frozen=True, eq=False)
class RecordRun:
    """A model ready to be run again and again, from any start over any piece of record."""

    runner: Runner
    model: MechanicalModel
    run: Stepper

    @property
    def linear(self) -> bool:
        """Whether no effect makes a force, and nothing in a loop is limited."""
        return not self.run.system.effects and straight(self.model)

    def finer(self) -> RecordRun:
        """Return the free run of the model in steps half as long."""
        runner = self.runner
        twice = Runner(self.model, runner.dt, 0.0, substeps=2 * runner.substeps, spend=runner.spend)
        return twice.run(self.model)

    def over(self, piece: StartedPiece, keep: bool = False) -> NonlinearResponse:
        """Return what the model predicts for a piece of record.

        Parameters
        ----------
        piece : StartedPiece
        keep : bool, optional
            Whether the states are wanted too; those of a run that the data lead end with the
            missing forces.

        Returns
        -------
        NonlinearResponse
        """
        record, start, gain = piece.record, piece.start, self.runner.gain
        state = np.zeros(self.run.system.states)
        state[: start.state.size] = start.state
        inputs = self.runner.inputs(self.model, record)
        lines = self.runner.lines(self.model, [record])
        led = (None, None) if gain is None else (record.Y, gain.filter)
        loop = self.runner.loop_course(self.model, [record]) if gain is None else None
        self.runner.spend(record.samples * self.run.substeps)
        return self.run.over(inputs, state, start.internal, record.time, *led, keep, lines, loop)

    def over_all(self, pieces: Sequence[StartedPiece], keep: bool = False) -> NonlinearResponse:
        """Return what the model predicts for several pieces, one after the other in the arrays."""
        starts = np.array([piece.start.vector for piece in pieces])
        return self.along(tuple(piece.record for piece in pieces), starts, keep)

    def all_errors(self, pieces: Sequence[StartedPiece]) -> Array:
        """Return measured minus predicted outputs of several pieces, shape (samples, ny)."""
        starts = np.array([piece.start.vector for piece in pieces])
        return self.errors_along(tuple(piece.record for piece in pieces), starts)

    def along(
        self, records: tuple[Record, ...], starts: Array, keep: bool = False
    ) -> NonlinearResponse:
        """Return what the model predicts for several pieces, one after the other in the arrays.

        Parameters
        ----------
        records : tuple of Record
        starts : ndarray, shape (pieces, n)
            One vector of :class:`InitialState` each.
        keep : bool, optional
            As in :meth:`over`.
        """
        system = self.run.system
        states = starts.shape[1] - system.internal
        if self.runner.gain is not None:
            begins = (InitialState(row[:states], row[states:]) for row in starts)
            pieces = (StartedPiece(*each) for each in zip(records, begins, strict=True))
            runs = [self.over(piece, keep) for piece in pieces]
            return NonlinearResponse(*(np.concatenate(part) for part in zip(*runs, strict=True)))
        course, _ = self.runner.course(self.model, records)
        self.runner.spend(course.time.size * self.run.substeps)
        return self.run.over_pieces(course, starts[:, :states], starts[:, states:], keep)

    def errors_along(self, records: tuple[Record, ...], starts: Array) -> Array:
        """Return measured minus predicted outputs of :meth:`along`, shape (samples, ny)."""
        return self.runner.course(self.model, records)[1] - self.along(records, starts).outputs


def free_run(model: MechanicalModel, record: Record) -> RecordRun:
    """Return a model ready to run freely over a record."""
    peak = 0.0
    if model.effects:
        peak = kalman.displacement_peak(model, record, kalman.excited_bandwidth(model, record))
    return Runner(model, record.dt, peak).run(model)


class Chains:
    """The chain of coordinates, decoupled from the others, to which each number of a model belongs.

    A number changes the outputs of its own chain only, so that derivatives to numbers of different
    chains come from one run (A. R. Curtis, M. J. D. Powell and J. K. Reid 1974, On the estimation
    of sparse Jacobian matrices, IMA Journal of Applied Mathematics 13, 117-119).

    Parameters
    ----------
    model : MechanicalModel
    """

    def __init__(self, model: MechanicalModel) -> None:
        self.model = model
        chains = connected(model, signals=True)
        self.of_name = {name: i for i, chain in enumerate(chains) for name in chain}
        self.outputs = np.array([self._of(output.of) for output in model.outputs])
        forces = [effect for _, effect in dynamic_effects(model)]
        internal = [chain for e in forces for chain in [self.effect(e)] * e.definition.states]
        self.states = [self.of_name[name] for name in model.free] * 2 + internal

    def _of(self, names: Sequence[str]) -> int:
        chains = {self.of_name[name] for name in names if name in self.of_name}
        return chains.pop() if len(chains) == 1 else -1

    def effect(self, effect: Effect) -> int:
        """Return the chain of an effect of the model or another; -1 if it joins several."""
        signals = {"input": self.model.inputs, "output": self.model.outputs}
        for signal in signals.get(effect.definition.domain, ()):
            if signal.name == effect.at[0]:
                return self._of(signal.on if isinstance(signal, Input) else signal.of)
        return self._of(effect.at)

    def parameter(self, key: str) -> int:
        """Return the chain of a parameter by its key; -1 if it may belong to several."""
        model, (what, *rest) = self.model, key.split(".")
        if what == "dof":
            return self._of(rest[:1])
        if what == "input":
            return self._of(next(i.on for i in model.inputs if i.name == rest[0]))
        table, _, number = what.rstrip("]").partition("[")
        if not number:
            return -1
        if table == "feedback":
            loop = model.feedback[int(number)]
            return self._of(next(o.of for o in model.outputs if o.name == loop.terms[0].of))
        if table != "effect":
            return self._of(getattr(model, f"{table}s")[int(number)].between)
        return self.effect(model.effects[int(number)])

    @staticmethod
    def groups(chains: Sequence[int]) -> list[list[int]]:
        """Return the positions of numbers, those together whose chains differ."""
        each: dict[int, list[int]] = {}
        for j, chain in enumerate(chains):
            each.setdefault(chain, []).append(j)
        alone = [[j] for j in each.pop(-1, [])]
        together = zip_longest(*each.values())
        return alone + [[j for j in row if j is not None] for row in together]

    def changes(
        self, chains: Sequence[int], change: Callable[[Sequence[int]], Array]
    ) -> list[Array]:
        """Return the change of the outputs by each number, shape (samples, ny).

        Parameters
        ----------
        chains : sequence of int
            Chain of each number.
        change : callable
            Makes a run with numbers of different chains moved, by their positions, and returns what
            that changes.
        """
        groups = self.groups(chains)
        found = zip(groups, parallel_map(change, groups), strict=True)
        runs = {j: run for group, run in found for j in group}
        own = [chain < 0 or self.outputs == chain for chain in chains]
        return [np.where(mask, runs[j], 0.0) for j, mask in enumerate(own)]


def rest(model: MechanicalData) -> InitialState:
    """Return a start at rest."""
    internal = np.zeros(sum(effect.definition.states for _, effect in dynamic_effects(model)))
    state = np.zeros(2 * len(model.free))
    for item in model.equations:  # rests where it says
        for name, value in item.start.items():
            if name in item.coordinates:
                state[model.free.index(name)] = value
        internal[: len(item.states)] = slopes_at(item).z
    return InitialState(state, internal)


# Reproducibility of free runs (sensitivity to the initial state).
#
# Backlash and stops in lightly damped systems are chaotic: two runs of the true model from nearly
# the same start part company, while its parameters may be right to a fraction of a percent.

_TINY = 1e-6
_DIRECTIONS = 3
# Samples over which runs have to stay apart.
_LASTS = 3
# Share of an output's size below which a change matters to nobody, however quiet the sensor.
_VISIBLE = 1e-3


@dataclass(frozen=True)
class Reproducibility:
    """Whether a free run can be repeated at all.

    Attributes
    ----------
    reproducible : bool
        False if a tiny change of the start grows beyond the noise, or the run diverges.
    growth : float
        Largest change of an output over the change at the beginning.
    diverged_after : float or None
        Time in s until the change exceeds the noise.
    reason : str
        In words.
    """

    reproducible: bool
    growth: float
    diverged_after: float | None
    reason: str


def reproducibility(
    run: RecordRun,
    piece: StartedPiece,
    outputs: Array,
    span: float | None = None,
    ahead: bool = False,
) -> Reproducibility:
    """Change the start by a millionth and see whether the runs part by more than the noise.

    Parameters
    ----------
    run : RecordRun
        Free.
    piece : StartedPiece
    outputs : ndarray, shape (samples, ny)
        What is judged: a run from that start, or windows and predictions.
    span : float, optional
        Length of the windows or the horizon in s: only so long do runs have to agree.
    ahead : bool, optional
        Whether these are predictions, which need not hold from the first sample on.

    Returns
    -------
    Reproducibility
    """
    record = piece.record
    bad = np.flatnonzero(~np.isfinite(outputs[-1:] if ahead else outputs).all(axis=1))
    if span is None and run.model.feedback and (grows := _unstable_loop(run.model)):
        return Reproducibility(False, np.inf, int(bad[0]) * record.dt if bad.size else None, grows)
    if bad.size:
        after = int(bad[0]) * record.dt
        reason = (
            f"the free run diverges after {after:.4g} s: its error judges nothing; "
            "compare in windows, or check the signs of the model's damping and stiffness"
        )
        return Reproducibility(False, np.inf, after, reason)
    if not piece.start.vector.size:
        return Reproducibility(True, 0.0, None, "")
    length, noise, size = record.samples, 0.0, output_sizes(record.Y)
    if span is not None:
        length = min(length, max(round(span / record.dt), 2))
    change = _largest_change(run, StartedPiece(record.part(0, length), piece.start), size)
    if record.samples >= 64:  # enough for a spectrum: the noise of the quietest output
        sizes = zip(record.Y.T, size, strict=True)
        noise = min(kalman.white_noise(y, record.dt, record.honest) / s for y, s in sizes)
    beyond = np.flatnonzero(~(change <= max(noise, _VISIBLE)))
    growth = float(np.max(change) / _TINY) if np.isfinite(change).all() else np.inf
    if not beyond.size:
        reason = _drift_note(run, record) if span is None else ""
        return Reproducibility(True, growth, None, reason)
    after = float(beyond[0] * record.dt)
    advice = "look ahead" if ahead else f"compare in windows shorter than {after:.3g} s"
    reason = (
        f"the free run is not reproducible: a change of the start by a millionth grows beyond the "
        f"noise within {after:.4g} s, so that its error judges nothing; {advice}"
    )
    return Reproducibility(False, growth, after, reason)


def _unstable_loop(model: MechanicalModel) -> str:
    """Say so if a model is unstable in its loop, without the effects and the limits."""
    worst = max(loop_poles(model).tolist(), key=lambda pole: pole.real)
    if not worst.real > 0:
        return ""
    turns = f", {abs(worst.imag) / (2 * np.pi):.3g} Hz" if worst.imag else ""
    return (
        f"the model is unstable in its loop (a pole at {worst.real:.3g} 1/s{turns}), so that the "
        "error of a free run judges nothing: check signs and sizes of gains, masses and stiffness, "
        "or refit, which begins with short windows"
    )


def _largest_change(run: RecordRun, piece: StartedPiece, size: Array) -> Array:
    """Largest change of an output, as a share of its size, over a few directions.

    What lasts less than three samples does not count: where friction turns round, an acceleration
    jumps, and which sample is the first after the jump decides no more.
    """
    base = run.over(piece, keep=True)
    every = np.hstack([base.states, base.internal])
    with np.errstate(over="ignore"):  # a run may be about to diverge
        typical = np.std(every, axis=0)
    typical = np.maximum(typical, 1e-3 * np.max(np.abs(every), axis=0))
    typical[run.run.system.states :] = 0.0  # the memory of an effect follows from the motion
    start = piece.start.vector
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (_DIRECTIONS, start.size))
    change = np.zeros(len(every))
    for sign in signs:
        moved = piece.start.with_vector(start + _TINY * sign * typical)
        other = run.over(StartedPiece(piece.record, moved)).outputs
        with np.errstate(invalid="ignore", over="ignore"):
            change = np.maximum(change, np.max(np.abs(other - base.outputs) / size, axis=1))
    if change.size < _LASTS:
        return change
    held = np.pad(change, (_LASTS - 1, 0), mode="reflect")
    held = np.pad(held, (0, _LASTS - 1), mode="edge")
    least = np.min(sliding_window_view(held, _LASTS), axis=1)
    return np.max(sliding_window_view(least, _LASTS), axis=1)


def _drift_note(run: RecordRun, record: Record) -> str:
    """Warn of a plant that integrates, whose free run sums up every small error."""
    poles = loop_poles(run.model) if run.model.feedback else np.linalg.eigvals(run.run.system.A)
    poles = np.abs(poles)
    slow = poles * record.samples * record.dt < 1e-3
    if slow.any() and np.max(poles) > 0:
        return "the model integrates: a free run sums up small errors; windows judge it better"
    return ""
