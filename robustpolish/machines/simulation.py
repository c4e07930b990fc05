"""Run a mechanical model with its physical effects over samples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from robustpolish.base.arrays import AnyArray, Array
from robustpolish.base.checks import invalid, matrix, misfit
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.evaluate import compiled_law, first_order_lag
from robustpolish.machines.effects.kind import Timing
from robustpolish.machines.loop import (
    LoopCourse,
    asked_columns,
    loop_matrices,
    loop_steps,
    still_course,
    waiting,
)
from robustpolish.machines.mechanical.data import (
    MechanicalData,
    context_values,
    dynamic_effects,
    effect_ports,
    port_rows,
)
from robustpolish.machines.mechanical.equations import fastest_rate
from robustpolish.machines.mechanical.parts import DISPLACEMENT, VELOCITY
from robustpolish.machines.stepper import (
    KernelMatrices,
    LoopMatrices,
    kernel_matrices,
    run_pieces,
    run_steps,
    step_matrices,
)

# What inputs are between their samples: held, linear or smooth, and late or not.
#
# A run takes every input for a line over each of its steps. One that is not gets the line with the
# same mean and the same first moment in that step. So the velocity of a mass at the end of it is
# right, and its displacement, whatever the force did in between: it matters where in a step a force
# acts to second order only, by what springs and dampers do meanwhile.

HELD, LINEAR, SMOOTH = 0.0, 1.0, 3.0
_DIGITS = 9
"""Of a delay in samples: a whole number of them is one in spite of rounding."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(3)


class IntersampleLines(NamedTuple):
    """What signals are at the beginning and the end of the step after each sample.

    Attributes
    ----------
    begin, end : ndarray, shape (samples, signals)
        The step after the last sample is not run.
    """

    begin: Array
    end: Array


def linear_interpolation(W: Array) -> IntersampleLines:
    """Return the lines between the samples of signals that are linear, W of shape (samples, n)."""
    return IntersampleLines(W, np.concatenate([W[1:], W[-1:]]))


def intersample_signal(
    u: Array, step: float, order: float, delay: float
) -> tuple[Array, Array, Array]:
    """Return a signal as it acts, from its record.

    Parameters
    ----------
    u : ndarray, shape (samples,)
        The record.
    step : float
        Time between samples in s.
    order : float
        0 if it is held until the next sample, 1 if it is linear, 3 if it is smooth.
    delay : float
        Time in s by which it acts later, moved as a whole. What was before the record is its first
        sample.

    Returns
    -------
    at_samples, begin, end : ndarray, shape (samples,)
        At the samples, and the line over the step after each of them.

    Examples
    --------
    >>> at, begin, end = intersample_signal(np.array([0.0, 1.0, 0.0]), 1.0, 0.0, 0.0)
    >>> begin.round(9).tolist(), end.round(9).tolist()
    ([0.0, 1.0, 0.0], [0.0, 1.0, 0.0])
    """
    signal = _signal(u, order)
    samples = np.arange(u.size, dtype=float)
    late = float(np.round(delay / step, _DIGITS))
    kink = late % 1.0  # where in a step the record has its samples
    mean, slope = np.zeros(u.size), np.zeros(u.size)
    for a, b in ((0.0, kink), (kink, 1.0)):
        for node, weight in zip(_NODES, _WEIGHTS, strict=True):
            x = (a + b) / 2 + (b - a) / 2 * node
            value = (b - a) / 2 * weight * signal(samples + (x - late))
            mean += value
            slope += 12 * (x - 0.5) * value
    return signal(samples - late), mean - slope / 2, mean + slope / 2


def _signal(u: Array, order: float) -> Callable[[Array], Array]:
    """Return a record as a function of the number of samples that have passed."""
    last = u.size - 1
    if order == HELD:
        return lambda k: u[np.clip(np.floor(k), 0, last).astype(int)]
    if order == SMOOTH:
        spline = CubicSpline(np.arange(u.size), u)
        return lambda k: np.asarray(spline(np.clip(k, 0, last)))
    return lambda k: np.interp(k, np.arange(u.size), u)


# What effects on inputs and outputs make of signals, and how measured outputs lose it again.

# How much of the signal may be left over when output effects are put on again; it is rounding.
_LINEARITY_TOLERANCE = 1e-6


def signals(model: MechanicalData, data: xr.Dataset) -> Array:
    """Return the columns of `MechanicalMatrices.signals`, effects on inputs applied.

    Parameters
    ----------
    model : MechanicalData
    data : xarray.Dataset
        Holds every input over ``time``.

    Returns
    -------
    ndarray, shape (samples, signals)
        At the samples.

    Raises
    ------
    InvalidInputError
        If an input is missing.
    """
    return _signals(model, data)[0]


def lines(model: MechanicalData, data: xr.Dataset) -> IntersampleLines | None:
    """Return what signals do between the samples, None if all are linear.

    Parameters
    ----------
    model : MechanicalData
    data : xarray.Dataset
        As of :func:`signals`.

    Returns
    -------
    Lines or None
        See :mod:`robustpolish.machines.simulation.intersample_signal`.
    """
    return _signals(model, data)[1]


def _signals(model: MechanicalData, data: xr.Dataset) -> tuple[Array, IntersampleLines | None]:
    """Return the signals at the samples, and between them where one of them is not linear."""
    idle = {name: loop.delay for loop in model.feedback for name in loop.drives}
    for name in model.input_names:
        if name not in data and name not in idle:
            raise misfit("data", f"no column {name!r}", "every input", "Check the column names.")
    time = np.asarray(data["time"].values, dtype=float)
    step = (time[-1] - time[0]) / (time.size - 1)
    m = model.matrices
    columns = [
        np.asarray(data[name].values, dtype=float) if name in data else np.zeros(time.size)
        for name in m.force_inputs
    ]
    for signal in m.imposed_signals:
        if signal.name in data:
            columns.append(np.asarray(data[signal.name].values, dtype=float))
        else:
            order = 1 if signal.quantity == VELOCITY else 2
            columns.append(CubicSpline(time, data[signal.source].values)(time, order))
    W = np.column_stack(columns) if columns else np.zeros((time.size, 0))
    sides: dict[int, tuple[Array, Array]] = {}
    straight = True
    for j, (name, source) in enumerate(zip(m.signals, m.sources, strict=True)):
        # an imposed motion has a velocity, so that it is smooth
        order = LINEAR if j < len(m.force_inputs) else SMOOTH
        delay, lags, timed = 0.0, [], source in idle
        if timed and source not in data:
            continue
        if timed:  # commands are held, and late
            order, delay = HELD, idle[source]
        for effect in _effects_on(model, "input"):
            if source != effect.at[0]:
                continue
            if effect.definition.timing is None:
                W[:, j] = _apply_effect(effect, W[:, j], time, derivative=name != source)
                continue
            when, timed = Timing(*effect.definition.timing(effect.values)), True
            order = order if when.order is None else when.order
            delay += when.delay
            lags += [when.lag] if when.lag > 0 else []
        if not timed:
            continue
        at_once = (order, delay) == (LINEAR, 0.0)
        straight = straight and (bool(lags) or at_once)  # a lag makes lines, too
        at, (begin, end) = W[:, j], linear_interpolation(W[:, j])
        if not at_once:
            at, begin, end = intersample_signal(W[:, j], step, order, delay)
        for lag in lags:
            at = first_order_lag(begin, end, step, lag)
            begin, end = linear_interpolation(at)
        W[:, j], sides[j] = at, (begin, end)
    if straight:
        return np.ascontiguousarray(W), None
    begin, end = (side.copy() for side in linear_interpolation(W))
    for j, side in sides.items():
        begin[:, j], end[:, j] = side
    return np.ascontiguousarray(W), IntersampleLines(begin, end)


def _apply_effect(effect: Effect, signal: Array, time: Array, derivative: bool) -> Array:
    """Return what an effect makes of a signal; a constant that it adds has no derivative."""
    changed = effect.on_signal(signal, time)
    if not derivative:
        return changed
    rest = effect.on_signal(np.zeros(time.size), time)
    twice = effect.on_signal(2 * signal, time) - rest
    if np.max(np.abs(twice - 2 * (changed - rest))) > _LINEARITY_TOLERANCE * np.max(np.abs(twice)):
        remedy = "Of a motion that an input imposes its velocity would have to change, too."
        raise invalid(f"{effect.kind}.at", effect.at[0], "an input that is a force", remedy)
    return changed - rest


def measured(model: MechanicalData, outputs: Array, time: Array) -> Array:
    """Return outputs as the sensors show them: with the effects on outputs.

    Parameters
    ----------
    model : MechanicalData
    outputs : ndarray, shape (samples, ny)
    time : ndarray, shape (samples,)
        In s.

    Returns
    -------
    ndarray, shape (samples, ny)
    """
    result = outputs.copy()
    for effect in _effects_on(model, "output"):
        j = model.output_names.index(effect.at[0])
        result[:, j] = effect.on_signal(result[:, j], time)
    return result


def raw_outputs(model: MechanicalData, Y: Array, time: Array) -> Array:
    """Take the effects on outputs out of measured outputs.

    Parameters
    ----------
    model : MechanicalData
    Y : ndarray, shape (samples, ny)
    time : ndarray, shape (samples,)
        In s.

    Returns
    -------
    ndarray, shape (samples, ny)

    Raises
    ------
    InvalidInputError
        If an effect is not linear and sample by sample, apart from a constant.
    """
    effects = _effects_on(model, "output")
    if not effects:
        return Y
    zero = measured(model, np.zeros_like(Y), time)
    gain = measured(model, np.ones_like(Y), time) - zero
    raw = (Y - zero) / np.where(gain == 0, 1.0, gain)
    left_over = np.abs(measured(model, raw, time) - Y) * (gain != 0)
    size = np.max(np.abs(Y) + np.abs(zero), axis=0, initial=0.0)
    for effect in effects:
        j = model.output_names.index(effect.at[0])
        if np.max(left_over[:, j], initial=0.0) > _LINEARITY_TOLERANCE * size[j]:
            shown = f"an effect on {effect.at[0]!r} that measured data cannot be freed of"
            want = "each sample times a factor plus a constant"
            remedy = "Such an effect can be simulated only."
            raise misfit(f"{effect.kind}.on_signal", shown, want, remedy)
    return np.ascontiguousarray(raw)


def _effects_on(model: MechanicalData, domain: str) -> list[Effect]:
    return [effect for effect in model.effects if effect.definition.domain == domain]


# A mechanical model with its effects as a linear system with nonlinear ports.

_MOST_SUBSTEPS = 32
_FADING = 4.0


@dataclass(frozen=True, eq=False)
class NonlinearSystem:
    """``s' = A s + B w + G f``, ``y = C s + D w + H f`` with port forces f of the effects.

    States s are the free displacements, then their velocities; signals w are those of
    `MechanicalMatrices.signals`; ``motion`` = (Qs, Qw, Vs, Vw) gives the relative
    displacements ``Qs s + Qw w`` and velocities ``Vs s + Vw w`` at the ports.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    G: Array
    H: Array
    motion: tuple[Array, Array, Array, Array]
    effects: tuple[Effect, ...]
    layout: NDArray[np.int64]
    values: Array
    internal: int

    @cached_property
    def laws(self) -> tuple[Any, ...]:
        """The compiled laws; their addresses hold as long as they are kept here."""
        return tuple(compiled_law(effect.definition) for effect in self.effects)

    @cached_property
    def addresses(self) -> NDArray[np.int64]:
        """Where the compiled laws are in memory."""
        return np.array([law.address for law in self.laws], dtype=np.int64)

    @property
    def states(self) -> int:
        """Number of states without the internal ones."""
        return self.A.shape[0]

    def steps(self, step: float) -> KernelMatrices:
        """Return the matrices of a substep."""
        matrices = (self.A, self.B, self.G, *self.motion)
        parts = tuple((part.shape, part.tobytes()) for part in matrices)
        return _cached_kernel_matrices(parts, step)


@lru_cache(maxsize=64)
def _cached_kernel_matrices(
    parts: tuple[tuple[tuple[int, ...], bytes], ...], step: float
) -> KernelMatrices:
    """Return the matrices of a substep; fits ask again and again, with other forces only."""
    A, B, G, *motion = (np.frombuffer(data).reshape(shape) for shape, data in parts)
    return kernel_matrices(step_matrices(A, B, G, step), motion)


def build_system(model: MechanicalData, step: float) -> NonlinearSystem:
    """Build the system of a model, for substeps of `step` seconds."""
    effects, rows, (G, H, motion) = effect_ports(model)
    layout, values = [], []
    port = state = parameter = 0
    for effect in effects:
        kind, known = effect.definition, effect.values
        context = context_values(model, effect, step)
        dry = False
        # ideal where a step cannot resolve how it turns over, unless inertias change meanwhile
        if kind.turns_over and not any(item.varies for item in model.equations):
            largest = max(abs(known[p.name]) for p in kind.parameters if p.dimension == "F")
            dry = known[kind.turns_over] < largest * context[kind.context.index("mobility")]
        if dry:
            known = {**known, kind.turns_over: 0.0}
            context = [0.0] * len(context)
        p = [*known.values(), *context]
        layout.append((port, kind.ports, state, kind.states, parameter, len(p), dry))
        values += p
        port, state, parameter = port + kind.ports, state + kind.states, parameter + len(p)
    if model.equations:  # their law is called last, and sees the forces of all others
        at = [model.frame.coordinates.index(name) for name in effects[0].at[: len(model.free)]]
        others = np.vstack([np.zeros((0, len(model.frame.coordinates))), *rows[1:]]).T[at]
        known = layout[0][5]
        tail = [float(others.shape[1]), *others.ravel().tolist()]
        values = [*values[: known - 1], *tail, *values[known:]]
        more = len(tail) - 1
        layout = [(*x[:4], x[4] + more, *x[5:]) for x in layout[1:]] + [
            (*layout[0][:5], known + more, False)
        ]
        effects = [*effects[1:], effects[0]]
    linear = (*model.matrices.first_order(), G, H)
    return NonlinearSystem(
        *(np.ascontiguousarray(part) for part in linear),
        motion=tuple(np.ascontiguousarray(part) for part in motion),  # type: ignore[arg-type]
        effects=tuple(effects),
        layout=np.array(layout, dtype=np.int64).reshape(-1, 7),
        values=np.array(values, dtype=float),
        internal=state,
    )


def needed_substeps(model: MechanicalData, dt: float, amplitude: float, edges: bool = True) -> int:
    """Return steps per sample that resolve the effects' own stiffness and damping.

    Parameters
    ----------
    model : MechanicalData
    dt : float
        Sampling step in s.
    amplitude : float
        Displacement amplitude in m or rad, of those that a ratio joins in that of the first.
    edges : bool, optional
        Whether some steps are taken for the edges of forces, whatever the sampling.
    """
    if not dynamic_effects(model):
        return loop_steps(model, dt)
    fastest, least, m = 0.0, 1, model.matrices
    for item in model.equations:
        at = [m.coordinates.index(name) for name in item.coordinates]
        fastest = fastest_rate(item, m.M[np.ix_(at, at)])
    omega = np.sqrt(max(np.max(np.abs(np.diag(m.K) / np.maximum(np.diag(m.M), 1e-300))), 0.0))
    for _, effect in dynamic_effects(model):
        with np.errstate(over="ignore"):  # a rate beyond doubles is as fast as any
            moved = amplitude * model.frame.travel(effect.at)
            stiffness, damping, rate = effect.definition.steepness(
                effect.values, moved, min(omega, 1 / dt) * moved
            )
        rows = port_rows(model, effect)[:, m.free]
        inverse = np.trace(rows @ m.inverse_mass @ rows.T)
        # laws see to it that no memory fades faster than a step; a few are enough for its rate
        fading = min(0.3 * rate, (_FADING if model.free else _MOST_SUBSTEPS) / dt)
        fastest = max(fastest, np.sqrt(abs(stiffness) * inverse), abs(damping) * inverse, fading)
        least = max(least, 4 if effect.definition.sharp else 2) if edges else 1
    steps = int(np.clip(np.ceil(2.0 * dt * fastest), least, _MOST_SUBSTEPS))
    return loop_steps(model, dt, steps)


class NonlinearResponse(NamedTuple):
    """Outputs (samples, ny), states (samples, n) and internal states of effects (samples, nz).

    ``commands`` (samples, nc) are those of controllers in the loop as they act, one after the
    other as `MechanicalModel.feedback` drives them; no samples without a loop.
    """

    outputs: Array
    states: Array
    internal: Array
    commands: Array = np.zeros((0, 0))


class InputCourse(NamedTuple):
    """Pieces of record that follow each other in the arrays, and what acts on a machine there.

    Attributes
    ----------
    begin, end : ndarray, shape (samples, signals)
        Signals at the ends of the line over the step after each sample.
    beside : ndarray, shape (samples, signals), or None
        What signals are at the samples, more than at the beginning of those lines; None if nowhere.
    time : ndarray, shape (samples,)
        In s.
    marks : ndarray of int, shape (pieces + 1,)
        Where pieces begin and end.
    loop : LoopCourse or None
        What controllers in the loop are told; without it their commands are as recorded.
    """

    begin: Array
    end: Array
    beside: Array | None
    time: Array
    marks: NDArray[np.int64]
    loop: LoopCourse | None = None

    @classmethod
    def of(
        cls,
        inputs: Array,
        lines: IntersampleLines | None,
        time: Array,
        marks: NDArray[np.int64],
        loop: LoopCourse | None = None,
    ) -> InputCourse:
        """Return a course of signals at the samples, linear between them unless lines are given."""
        begin, end = linear_interpolation(inputs) if lines is None else lines
        beside = None if lines is None else inputs - begin
        begin, end, time = (np.ascontiguousarray(part) for part in (begin, end, time))
        return cls(begin, end, beside, time, marks, loop)


@dataclass(frozen=True, eq=False)
class Stepper:
    """Steps a model over samples, freely or led by data, as often as wanted.

    Parameters
    ----------
    model : MechanicalData
        Its effects on outputs are applied to what comes out.
    system : NonlinearSystem
        Of the model, built for ``step / substeps``; it may have more states.
    step : float
        Time between samples in s.
    substeps : int
        Steps of the integration per sample.
    rounds : bool, optional
        Whether converters of controllers in the loop round.
    """

    model: MechanicalData
    system: NonlinearSystem
    step: float
    substeps: int
    rounds: bool = False

    @cached_property
    def matrices(self) -> KernelMatrices:
        """Matrices of a substep."""
        return self.system.steps(self.step / self.substeps)

    @cached_property
    def loops(self) -> LoopMatrices:
        """Controllers of the model for a substep."""
        seen = sensor_gains(self.model)
        return loop_matrices(self.model, self.step / self.substeps, seen, self.rounds)

    def over(
        self,
        inputs: Array,
        state: Array,
        internal: Array,
        time: Array,
        led_by: Array | None = None,
        gain: Array | None = None,
        keep: bool = True,
        lines: IntersampleLines | None = None,
        loop: LoopCourse | None = None,
    ) -> NonlinearResponse:
        """Return outputs as the sensors show them, states and internal states.

        Parameters
        ----------
        inputs : ndarray, shape (samples, signals)
            See :func:`robustpolish.machines.simulation.signals`.
        state, internal : ndarray, shapes (n,) and (nz,)
            At the first sample.
        time : ndarray, shape (samples,)
            In s.
        led_by, gain : ndarray, shapes (samples, ny) and (n, ny), optional
            Measured outputs, and what of the prediction error is added to the states after every
            sample; a free run by default.
        keep : bool, optional
            Whether states are kept; otherwise they have no samples.
        lines : Lines, optional
            What the inputs do between the samples, see
            :func:`robustpolish.machines.simulation.lines`; linear by default.
        loop : LoopCourse, optional
            Of one piece; without it commands are as in the inputs.

        Returns
        -------
        NonlinearResponse
        """
        system = self.system
        ny = len(system.C)
        course = InputCourse.of(inputs, lines, time, np.array([0, time.size]), loop)
        Y = np.zeros((1, ny))
        if led_by is not None:
            Y = raw_outputs(self.model, led_by, time) - self._beside(course)
        K = np.zeros((system.states, ny)) if gain is None else gain
        *given, phase, states, sent = self._given(course)
        found = run_steps(
            *given, phase[0], states[0], sent[0], Y, K,
            np.ascontiguousarray(state), np.ascontiguousarray(internal),
            time[0], self.step, self.substeps, keep,
        )  # fmt: skip
        return self._shown(course, *found)

    def over_pieces(
        self, course: InputCourse, starts: Array, internal: Array, keep: bool = False
    ) -> NonlinearResponse:
        """Return what :meth:`over` does freely, of pieces that follow each other in the arrays.

        Parameters
        ----------
        course : InputCourse
        starts, internal : ndarray, shapes (pieces, n) and (pieces, nz)
            At the first sample of each piece.
        keep : bool, optional
            Whether states are kept; otherwise they have no samples.

        Returns
        -------
        NonlinearResponse
        """
        found = run_pieces(
            *self._given(course), np.ascontiguousarray(starts), np.ascontiguousarray(internal),
            course.time[course.marks[:-1]], course.marks, self.step, self.substeps, keep,
        )  # fmt: skip
        return self._shown(course, *found)

    def _given(self, course: InputCourse) -> tuple[Any, ...]:
        """Return the first arguments of the kernels."""
        s = self.system
        laws = s.addresses, s.layout, s.values
        loop, loops = course.loop, self.loops if course.loop is not None else _no_loops(len(s.C))
        if loop is None:
            pieces = len(course.marks) - 1
            still = still_course(np.zeros((len(course.begin), 0)), loops)
            each = np.zeros((pieces, 0, 0))
            loop = still._replace(phase=np.zeros(pieces, dtype=np.int64), states=each, sent=each)
        begun = loop.phase, loop.states.copy(), loop.sent.copy()  # runs change them
        signals = course.begin, course.end, loops, loop.asked, *begun
        return self.matrices, (s.C, s.D, s.H), *laws, *signals

    def _shown(
        self, course: InputCourse, y: Array, s: Array, z: Array, c: Array
    ) -> NonlinearResponse:
        y = measured(self.model, y + self._beside(course), course.time)
        return NonlinearResponse(y, s, z, c)

    def _beside(self, course: InputCourse) -> Array | float:
        """Return what outputs see of a sample that is no end of a line.

        An accelerometer sees a held force as it is.
        """
        if course.beside is None:
            return 0.0
        D = self.system.D
        if course.loop is not None:  # what a loop drives, outputs have seen in the run
            mine = np.isin(self.model.matrices.sources, self.model.driven)
            D = np.where(mine, 0.0, D)
        return course.beside @ D.T


def loop_poles(model: MechanicalData) -> AnyArray:
    """Return the poles in rad/s of the linear part of a model in its loops.

    Of a period so long that each loop samples, and all commands that wait are others: the map from
    its beginning to its end is that of as many runs as there are states, controllers' included.
    """
    model = replace(model, effects=(), feedback=tuple(loop.linear for loop in model.feedback))
    dt = min(loop.period for loop in model.feedback)
    steps = loop_steps(model, dt)
    stepper = Stepper(model, build_system(model, dt / steps), dt, steps)
    loops, s = stepper.loops, stepper.system
    ring, (count, nx, _), nc = waiting(loops), loops.A.shape, len(loops.owner)
    samples = int(np.lcm.reduce(np.append(loops.every, steps))) * ring // steps
    parts = [s.states, count * nx, nc * ring]
    each = np.split(np.eye(sum(parts)), np.cumsum(parts)[:-1], axis=1)
    pieces, ends = sum(parts), []
    for n in (samples + 1, samples):  # machines go on until the last sample, controllers act at it
        begun = each[1].reshape(pieces, count, nx).copy(), each[2].reshape(pieces, nc, ring).copy()
        none = np.zeros((pieces * n, s.B.shape[1]))
        asked = np.zeros((pieces * n, loops.B.shape[2] - nc - len(s.C)))
        kept = run_pieces(
            stepper.matrices, (s.C, s.D, s.H), s.addresses[:0], s.layout[:0], s.values,  # linear
            none, none, loops, asked, np.zeros(pieces, dtype=np.int64), *begun, each[0].copy(),
            np.zeros((pieces, 0)), np.zeros(pieces), n * np.arange(pieces + 1), dt, steps, True,
        )[1]  # fmt: skip
        ends.append((kept.reshape(pieces, n, -1)[:, -1], *begun))
    found = np.hstack([ends[0][0], *(part.reshape(pieces, -1) for part in ends[1][1:])])
    values = np.linalg.eigvals(found).astype(complex)
    return np.log(values[np.abs(values) > 0]) / (samples * dt)


@lru_cache(maxsize=16)
def _no_loops(outputs: int) -> LoopMatrices:
    """Return the matrices of no controllers at all."""
    whole, none, empty = np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros((0, 0, 0))
    each = (empty, empty, empty, empty, empty)
    seen, actuator = np.zeros((3, outputs)), np.zeros((4, 0))
    return LoopMatrices(
        whole, whole, none, *each, whole, whole, none, none, none, none, seen, actuator
    )


def sensor_gains(model: MechanicalData) -> Array:
    """Return gain and offset of what sensors show, shape (2, ny).

    Raises
    ------
    InvalidInputError
        If an effect on an output that a loop sees does more than that.
    """
    ny, time = len(model.outputs), np.zeros(2)
    offset, unit = (measured(model, np.full((2, ny), x), time) for x in (0.0, 1.0))
    raw_outputs(model, unit, time)  # refuses others
    return np.array([unit[0] - offset[0], offset[0]])


def simulate_model(
    model: MechanicalData,
    data: xr.Dataset,
    initial_state: ArrayLike | None = None,
    internal_state: ArrayLike | None = None,
    substeps: int | None = None,
) -> NonlinearResponse:
    """Run a model freely on measured inputs.

    Parameters
    ----------
    model : MechanicalData
    data : xarray.Dataset
        Uniform ``time`` in s and the model's inputs by name, in SI units; references instead of
        what its feedback drives. Outputs are used only for their amplitude, which decides on
        substeps.
    initial_state : array_like, shape (n,), optional
        Free displacements, then their velocities; zero by default.
    internal_state : array_like, shape (nz,), optional
        Internal states of the effects; zero by default.
    substeps : int, optional
        Steps per sample; chosen from the effects' stiffness at the amplitude by default, that of
        a first run if no displacement is measured.

    Returns
    -------
    NonlinearResponse

    Raises
    ------
    InvalidInputError
        If an input is missing or a state has the wrong size.

    Examples
    --------
    >>> import numpy as np, xarray as xr
    >>> import robustpolish as rp
    >>> model = rp.MechanicalModel(
    ...     [rp.Dof("x", 1.0)],
    ...     [rp.Spring(("x", "ground"), 4.0)],
    ...     outputs=[rp.Output("x", ("x", "ground"))],
    ... )
    >>> data = xr.Dataset(coords={"time": np.arange(101) * 0.01})
    >>> response = simulate_model(model, data, initial_state=[1.0, 0.0])
    >>> bool(np.allclose(response.outputs[:, 0], np.cos(2 * data.time)))
    True
    """
    time = np.asarray(data["time"].values, dtype=float)
    dt = (time[-1] - time[0]) / max(time.size - 1, 1)

    def stepped(n: int) -> NonlinearResponse:
        stepper = Stepper(model, build_system(model, dt / n), dt, n, rounds=True)
        s0 = _state("initial_state", initial_state, stepper.system.states)
        z0 = _state("internal_state", internal_state, stepper.system.internal)
        W, between = signals(model, data), lines(model, data)
        loop = still_course(asked_columns(model, data), stepper.loops) if model.feedback else None
        return stepper.over(W, s0, z0, time, lines=between, loop=loop)

    shown = [
        float(np.percentile(np.abs(data[o.name].values), 99)) / model.frame.travel(o.of)
        for o in model.outputs
        if o.name in data and o.quantity == DISPLACEMENT
    ]
    amplitude = max(shown, default=0.0)
    n = loop_steps(model, dt, substeps) if substeps else needed_substeps(model, dt, amplitude)
    found = stepped(n)
    if substeps is None and amplitude == 0:  # none is measured: that of the run, if it is finite
        sizes = model.frame.sizes[model.matrices.free]
        moved = np.abs(found.states[:, : len(model.free)] / sizes)
        if moved.size and np.isfinite(moved).all():
            amplitude = float(np.max(np.percentile(moved, 99, axis=0)))
        needed = needed_substeps(model, dt, amplitude)
        found = found if needed == n else stepped(needed)
    return found


def _state(argument: str, value: ArrayLike | None, size: int) -> Array:
    if value is None:
        return np.zeros(size)
    return matrix(argument, np.reshape(np.asarray(value, dtype=float), (1, -1)), (1, size))[0]
