"""Screen every effect at every place for the one that makes the innovations white."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from robustpolish.base.arrays import Array
from robustpolish.base.budget import parallel_map
from robustpolish.identification.fit.least_squares import independent_errors
from robustpolish.identification.fit.parameters import free_parameters, is_guessed
from robustpolish.identification.fit.prepared import PreparedRecord, has_integrator
from robustpolish.identification.observer.kalman import (
    FREE,
    Level,
    LinearObserver,
    force_sites,
    rounding,
)
from robustpolish.identification.observer.starts import SmoothedMotion, known_forces
from robustpolish.identification.policy import Policy
from robustpolish.identification.record import Record
from robustpolish.machines.effects.effect import Effect, kinds
from robustpolish.machines.effects.evaluate import force_with, shapes_along
from robustpolish.machines.effects.kind import (
    CONSTANT,
    GROUND,
    SPRING,
    EffectKind,
    Motion,
    Shape,
)
from robustpolish.machines.mechanical.data import (
    connected,
    dynamic_effects,
    heaviest,
    inertia_of,
    motion_at,
    port_pairs,
    port_row,
    port_rows,
)
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import DISPLACEMENT, FORCE
from robustpolish.machines.simulation import IntersampleLines, linear_interpolation

# Places of effects, and their forces along a known motion.

_STEPS_OF_WAVE = 3.0
"""Steps of a sensor in the shortest force periodic in the displacement that is sought."""
_DERIVATIVE_STEP = 1e-4
"""Share of a number of an equation by which it is moved for a derivative."""


@dataclass(frozen=True, eq=False)
class CandidateColumns:
    """Candidate columns: forces along rows, or additions to outputs."""

    kind: EffectKind
    at: tuple[str, ...]
    shape: Shape
    rows: Array | None
    pairs: list[tuple[str, ...]]
    values: Array

    @property
    def numbers(self) -> int:
        """Coefficients to be found."""
        return len(self.values)


def effect_from(entry: CandidateColumns, c: Array) -> Effect:
    """Return a candidate with the parameters that its coefficients tell, within their bounds."""
    values = dict(entry.shape.values(c))
    for name, value in values.items():
        parameter = entry.kind.parameter(name)
        values[name] = float(np.clip(value, parameter.lower, parameter.upper))
    return Effect.of(entry.kind, entry.at, values)


def places(model: MechanicalModel, kind: EffectKind) -> list[tuple[str, ...]]:
    """Return where a kind of effect can act in a model."""
    channels = model.channels
    free, all_names = model.free, [x for x in model.frame.coordinates if x not in channels]
    if not set(dict(kind.channels)) <= set(model.imposed):
        return []
    if kind.domain == "input":
        return [(i.name,) for i in model.inputs if i.imposes is None]
    if kind.domain == "output":
        return [(o.name,) for o in model.outputs]
    if kind.domain == "path":
        pushing = [i.name for i in model.inputs if i.imposes is None]
        return [(i, o.name) for i in pushing for o in model.outputs if o.quantity != FORCE]
    if kind.domain == "dof":
        return [(name,) for name in free]
    if kind.domain == "axes":
        return _axes(model)
    _, sites = force_sites(model)
    found: list[tuple[str, ...]] = []
    for name in all_names:
        if name in free or (name, "ground") in sites:
            found.append((name, "ground"))
    found += [s.between for s in model.springs if "ground" not in s.between]
    found += [d.between for d in model.dampers if "ground" not in d.between]
    found += [s for s in sites if "ground" not in s]
    for i, a in enumerate(all_names):
        found += [(b, a) for b in all_names[i + 1 :] if a in free or b in free]
    unique: dict[frozenset[str], tuple[str, ...]] = {}
    turning = {dof.name: dof.rotational for dof in model.dofs}
    axis = {dof.name: dof.axis for dof in model.dofs if dof.axis}
    for pair in found:
        if frozenset(pair) not in model.frame.ratios and (
            len({axis[name] for name in pair if name in axis}) > 1
            or len({turning[name] for name in pair if name in turning}) > 1
        ):
            continue  # a displacement less an angle, which an inertia may couple, is no motion
        unique.setdefault(frozenset(pair), (pair[0], pair[1]))
    springs = {frozenset(s.between) for s in model.springs}
    if kind.family == SPRING:  # those of the model are of the family
        return [pair for key, pair in unique.items() if key not in springs and GROUND in pair]
    if "spring_stiffness" in kind.context:
        return [
            pair for key, pair in unique.items() if key in springs or _needs_clearance(model, pair)
        ]
    return list(unique.values())


def _axes(model: MechanicalModel) -> list[tuple[str, ...]]:
    """Return pairs of coordinates that can be two axes of one body: of different chains, if any."""
    groups = connected(model)
    free = model.free
    joined = {frozenset(p.between) for p in (*model.springs, *model.dampers)}
    pairs: list[tuple[str, ...]] = [(a, b) for i, a in enumerate(free) for b in free[i + 1 :]]
    pairs = [pair for pair in pairs if frozenset(pair) not in joined]
    if len(groups) > 1:
        pairs = [p for p in pairs if not any(set(p) <= group for group in groups)]
    return pairs


def candidate_columns(
    model: MechanicalModel,
    kind: EffectKind,
    at: tuple[str, ...],
    motion: SmoothedMotion,
    record: Record,
) -> list[CandidateColumns]:
    """Return the candidate columns of a kind at a place, none if one of its family is there."""
    here = [e.definition for e in model.effects if set(e.at) == set(at)]
    # of a force periodic in the displacement, each order is an effect of its own
    if any((e.kind == kind.kind and not kind.wave) or mutually_exclusive(e, kind) for e in here):
        return []
    if kind.domain in ("input", "output"):
        return _signal_columns(model, kind, at, motion, record.time)
    effect = Effect.of(kind, at)
    # along a known motion no step has to be resolved
    here = motion_at(model, effect, record.time, motion.q, motion.v, 0.0, motion.inputs)
    if not here.q.any():
        return []
    _, sites = force_sites(model)
    force = None
    if kind.domain == "dof" and (at[0], "ground") in sites:
        force = motion.force[sites.index((at[0], "ground"))][None]
    if kind.domain == "path":
        force = np.sum(motion.force, axis=0)[None]
    if kind.wave:
        along = port_rows(model, effect)[0]
        total = force_sites(model)[0].T @ motion.force
        force = (along @ total / (along @ along))[None]
    if "clearance" in dict(kind.gives) and _needs_clearance(model, at):
        return _clearances(model, kind, at, motion, record)
    rows, pairs = port_rows(model, effect), port_pairs(effect)
    shapes = shapes_along(kind, replace(here, force=force))
    if kind.wave:  # a wave as short as the steps in which a sensor counts is these steps
        sensors = zip(model.outputs, record.Y.T, strict=True)
        steps = [12**0.5 * rounding(y) for o, y in sensors if o.quantity == DISPLACEMENT]
        least = _STEPS_OF_WAVE * max(steps, default=0.0)
        shapes = [s for s in shapes if s.values(np.ones(len(s.signs)))[kind.wave] > least]
    return [CandidateColumns(kind, at, shape, rows, pairs, shape.columns) for shape in shapes]


def mutually_exclusive(one: EffectKind, other: EffectKind) -> bool:
    """Return whether a place has at most one of two kinds."""
    return bool(one.family) and one.family == other.family and one.domain == other.domain


def _needs_clearance(model: MechanicalModel, at: tuple[str, ...]) -> bool:
    """Return whether an effect at a place asks for the clearance there."""
    return any("clearance" in e.definition.context and set(e.at) == set(at) for e in model.effects)


def _clearances(
    model: MechanicalModel,
    kind: EffectKind,
    at: tuple[str, ...],
    motion: SmoothedMotion,
    record: Record,
) -> list[CandidateColumns]:
    """Return what clearances would change about the forces of the effects that are there."""
    along = (motion.q, motion.v, record.time, record.dt, motion.inputs)
    base = known_forces(model, *along)
    amplitude = float(np.percentile(np.abs(port_rows(model, Effect.of(kind, at)) @ motion.q), 95))
    name, found = kind.parameters[0].name, []
    # with a clearance, the elastic part has to be stiffer than it seemed without
    for share, ratio in itertools.product((0.03, 0.07, 0.15, 0.3, 0.5), (1.0, 2.0)):
        gap = share * amplitude
        stiffer = _with_stiffer_elements(model, at, ratio)
        moved = known_forces(stiffer.with_effect(kind.kind, at, {name: gap}), *along)
        if base is None or moved is None:
            return []
        change = moved.values.copy()
        change[: len(base.values)] -= base.values
        shape = Shape(change[None], lambda c, g=gap: {name: g}, (1,))
        found.append(CandidateColumns(kind, at, shape, moved.rows, moved.pairs, change[None]))
    return found


def _with_stiffer_elements(
    model: MechanicalModel, at: tuple[str, ...], ratio: float
) -> MechanicalModel:
    """Return the model with stiffer elements that ask for the clearance at a place."""
    changes = {
        f"effect[{i}].stiffness": ratio * e.values["stiffness"]
        for i, e in enumerate(model.effects)
        if "clearance" in e.definition.context and set(e.at) == set(at) and "stiffness" in e.values
    }
    return model.with_parameters(changes)


def _signal_columns(
    model: MechanicalModel,
    kind: EffectKind,
    at: tuple[str, ...],
    motion: SmoothedMotion,
    time: Array,
) -> list[CandidateColumns]:
    """Return the columns of an effect on an input or an output."""
    found = []
    if kind.domain == "input":
        m = model.matrices
        j = m.force_inputs.index(at[0])
        u = motion.inputs[:, j]
        du = CubicSpline(time, u)(time, 1)
        ends = [(name, "ground") for name in m.coordinates]
        for shape in shapes_along(kind, Motion(time, u[None], du[None])):
            forces = m.B[:, j][None, :, None] * shape.columns
            found.append(CandidateColumns(kind, at, shape, np.eye(len(m.B)), ends, forces))
        return found
    i = model.output_names.index(at[0])
    y = motion.outputs[:, i]
    for shape in shapes_along(kind, Motion(time, y[None], np.gradient(y, time)[None])):
        full = np.zeros((len(shape.columns), len(model.outputs), len(time)))
        full[:, i] = shape.columns[:, 0]
        found.append(CandidateColumns(kind, at, shape, None, [], full))
    return found


def _by_place(entries: Sequence[CandidateColumns]) -> list[list[int]]:
    """Return the numbers of the entries whose forces act along the same rows."""
    found: dict[object, list[int]] = {}
    for i, entry in enumerate(entries):
        rows = None if entry.rows is None else entry.rows.tobytes()
        found.setdefault((rows, *entry.pairs), []).append(i)
    return list(found.values())


HIDDEN = 1e-4
"""Share of a column's power below which the model's own numbers and starts do it all."""
LEAST_LEFT = 1e-6
"""Share of the errors' power that is never explained before it is tried."""


# Innovations of a record at one observer level, less the effect of errors of the model's numbers.


class FilteredRecord:
    """A part of a record seen through the observer of one level.

    Parameters
    ----------
    model : MechanicalModel
    prepared : PreparedRecord
    record : Record
        The part.
    level : Level
    motion : SmoothedMotion
        Along the part.
    constants : sequence of CandidateColumns, optional
        Offsets and constant forces, of any size.
    """

    def __init__(
        self,
        model: MechanicalModel,
        prepared: PreparedRecord,
        record: Record,
        level: Level,
        motion: SmoothedMotion,
        constants: Sequence[CandidateColumns] = (),
    ) -> None:
        self.level, self.policy, self.noise = level, prepared.policy, prepared.scales.noise
        self.model = model
        self.observer = LinearObserver(model, record.dt, level, prepared.scales)
        along = (motion.q, motion.v, record.time, record.dt, motion.inputs)
        forces = known_forces(model, *along)
        Y = record.raw_outputs(model)
        lines = record.own_lines(record.lines(model))
        _, errors = self.observer.innovations(Y, motion.inputs, forces, lines=lines)
        self.errors = errors
        self.sigma = np.ones(errors.shape[1])
        own = nuisance_columns(model, self.policy, self.observer, motion, record)
        self.raw, self.ridge, self.keys = own
        # a mean that no constant explains is no constant's alone: it hides what else is missing
        means = self.columns(constants).reshape(-1, *errors.shape)
        means = means[np.any(means, axis=(1, 2)) & np.isfinite(means).all(axis=(1, 2))]
        self.raw = np.concatenate([self.raw, means])
        self.ridge = np.concatenate([self.ridge, np.zeros(len(means))])
        self.reweigh(np.std(errors[len(errors) // 20 :], axis=0))
        for _ in range(2):
            self.reweigh(np.std(self.residual(), axis=0))

    def reweigh(self, sigma: Array) -> None:
        """Weight the outputs and factor the nuisance columns."""
        self.sigma = np.where(sigma > 0, sigma, 1.0)
        N = (self.raw / self.sigma).reshape(len(self.raw), -1)
        size = np.sqrt(np.sum(N**2, axis=1))
        size[size == 0] = 1.0
        self.N = N / size[:, None]
        ridge = (self.ridge / size) ** 2
        # near-collinear start columns are held by a trace of ridge
        gram = self.N @ self.N.T + np.diag(ridge + 1e-9)
        self.factor = np.linalg.inv(gram)
        self.e = (self.errors / self.sigma).ravel()
        self.Ne = self.N @ self.e

    def weighted(self, columns: Array) -> Array:
        """Return columns (count, samples, ny) weighted and flattened."""
        return (columns / self.sigma).reshape(len(columns), -1)

    def residual(self) -> Array:
        """Return what the model's own numbers, starts and constants leave, in outputs' units."""
        rest = self.e - self.N.T @ (self.factor @ self.Ne)
        return rest.reshape(self.errors.shape) * self.sigma

    def columns(self, entries: Sequence[CandidateColumns]) -> Array:
        """Return the weighted innovations that entries leave, shape (coefficients, errors)."""
        ends = np.cumsum([0, *(entry.numbers for entry in entries)])
        found = np.empty((ends[-1], self.errors.size))
        # a column alone would take several times as long
        for here in _by_place(entries):
            first, values = entries[here[0]], np.concatenate([entries[i].values for i in here])
            if first.rows is None:
                left = self.observer.respond_outputs(values)
            else:
                left = self.observer.respond(first.rows, first.pairs, values)
            rows = np.concatenate([np.arange(ends[i], ends[i + 1]) for i in here])
            found[rows] = self.weighted(left)
        return found

    def scores(self, rest: Array, orders: Sequence[int]) -> dict[int, float]:
        """Return the information criterion for noise of several autoregressive orders."""
        samples, found = len(rest), {}
        if not np.isfinite(rest).all():
            return dict.fromkeys(orders, np.inf)
        for order in orders:
            total = 0.0
            for e in rest.T:
                a = autoregression(e, order)
                if has_lightly_damped_mode(a, self.policy.own_damping):
                    total = np.inf
                    break
                white = np.asarray(lfilter(a, [1.0], e)) if order else e
                total += samples * np.log(max(float(np.mean(white**2)), 1e-300))
            found[order] = total + order * rest.shape[1] * np.log(samples)
        return found

    def null_scores(self, orders: Sequence[int]) -> dict[int, float]:
        """Return the same of the model as it is, with no force added."""
        return self.scores(self.residual(), orders)


def null_score(model: MechanicalModel, prepared: PreparedRecord) -> float:
    """Return the information criterion of a model without more effects, at its best level."""
    policy, record = prepared.policy, prepared.screened
    motion = prepared.motion(model, record)
    scores = []
    for level in policy.null_levels:
        seen = FilteredRecord(model, prepared, record, level, motion)
        scores.append(min(seen.null_scores(policy.null_orders).values()))
    return float(min(scores))


def nuisance_columns(
    model: MechanicalModel,
    policy: Policy,
    observer: LinearObserver,
    motion: SmoothedMotion,
    record: Record,
) -> tuple[Array, Array, list[str]]:
    """Return innovations left by errors of the model's own numbers and of the start.

    Returns
    -------
    columns : ndarray, shape (count, samples, ny)
    ridge : ndarray, shape (count,)
        The inverse of how far each number may be off; 0 where nothing is known.
    keys : list of str
        Of the model's own numbers, which stand first.
    """
    rows, pairs, forces, ridge, keys = [], [], [], [], []

    def add(key: str, row: Array, pair: tuple[str, ...], force: Array, prior: float) -> None:
        if np.any(force):
            keys.append(key)
            rows.append(row)
            pairs.append(pair)
            forces.append(force)
            ridge.append(prior)

    for i, spring in enumerate(model.springs):
        row, prior = port_row(model, spring.between), _ridge(spring.stiffness, policy.spring_share)
        add(f"spring[{i}].stiffness", row, spring.between, -(row @ motion.q), prior)
    for i, damper in enumerate(model.dampers):
        row, prior = port_row(model, damper.between), _ridge(damper.damping, policy.damper_share)
        add(f"damper[{i}].damping", row, damper.between, -(row @ motion.v), prior)
    m = model.matrices
    for name, dof in heaviest(model).items():
        if name in model.free and dof.mass:
            key, row = ".".join(dof.key), port_row(model, (dof.name,))
            prior = 1 / (policy.mass_prior * dof.mass)
            add(key, row, (dof.name, "ground"), -(row @ motion.a), prior)
    each = np.zeros((len(rows), len(rows), record.samples))
    for i, force in enumerate(forces):
        each[i, i] = force
    columns = list(observer.respond(np.array(rows), pairs, each)) if rows else []
    for key, column in _equation_columns(model, observer, motion, record):
        columns.append(column)
        keys.append(key)
        ridge.append(_ridge(model.parameters[key], policy.spring_share))
    lines = record.own_lines(record.lines(model)) or linear_interpolation(motion.inputs)
    nothing = np.zeros((record.samples, len(model.outputs)))
    for j in range(m.B.shape[1]):
        only = np.arange(motion.inputs.shape[1]) == j
        force = IntersampleLines(only * lines.begin, only * lines.end)
        columns.append(-observer.innovations(nothing, only * motion.inputs, None, lines=force)[1])
        ridge.append(1 / policy.gain_prior)
        keys.append(f"input.{m.force_inputs[j]}.gain")
    for column in _effect_columns(model, policy, observer, motion, record):
        columns.append(column)
        ridge.append(0.0)
    starts = observer.respond_start(record.samples)[: 2 * len(model.free)]
    columns += list(starts)
    ridge += [0.0] * len(starts)
    if not columns:
        return np.zeros((0, record.samples, len(model.outputs))), np.zeros(0), keys
    return np.stack(columns), np.array(ridge), keys


def numbers_along_motion(
    model: MechanicalModel, reference: MechanicalModel, prepared: PreparedRecord
) -> MechanicalModel:
    """Return a model with the numbers of a linear regression along its smoothed motion.

    However far off the numbers are, the observer follows the measured motion, and what it has to
    add to the forces tells in which direction they are wrong: no run of the model is needed that
    would have to swing as the machine does. The effects of the model stay.

    Parameters
    ----------
    model, reference : MechanicalModel
        As it is, and before any fit.
    prepared : PreparedRecord
    """
    policy, record = prepared.policy, prepared.screened
    motion = prepared.motion(model, record)
    seen = FilteredRecord(model, prepared, record, policy.null_levels[0], motion)
    numbers = free_parameters(model, prepared.scales.bandwidth, policy, reference)
    free = {f.key: f for f in numbers if f.key not in prepared.held}
    columns = [j for j in range(len(seen.raw)) if j >= len(seen.keys) or seen.keys[j] in free]
    own = [j for j in columns if j < len(seen.keys)]
    X = seen.weighted(seen.raw)[columns].T
    if not (own and np.isfinite(X).all() and np.isfinite(seen.e).all()):
        return model
    size = np.sqrt(np.sum(X**2, axis=0))
    size[size == 0] = 1.0
    # masses and gains are weighed, springs and dampers may be off by decades; numbers of equations
    # enter as they like, of which a regression is the first step
    sure = [
        j < len(seen.keys) and (not is_guessed(seen.keys[j]) or seen.keys[j].startswith("param"))
        for j in columns
    ]
    prior = np.diag(np.where(sure, seen.ridge[columns], 0.0) / size)
    A, b = np.vstack([X / size, prior]), np.concatenate([seen.e, np.zeros(len(prior))])
    change = np.linalg.lstsq(A, b, rcond=1e-10)[0] / size
    moved = {}
    for j, by in zip(columns, change.tolist(), strict=True):
        if j in own:
            f = free[seen.keys[j]]
            moved[f.key] = float(np.clip(f.start + by, f.lower, f.upper))
    return model.with_parameters(moved)


def _ridge(value: float, share: float) -> float:
    """Return the inverse of how far a number may be off after the refit.

    Without it, the smoothed motion of masses that are not measured, which follows the missing
    force, could explain that force with an absurd spring or damper.
    """
    return 1 / (share * abs(value)) if value else 0.0


def _effect_columns(
    model: MechanicalModel,
    policy: Policy,
    observer: LinearObserver,
    motion: SmoothedMotion,
    record: Record,
) -> list[Array]:
    """Return the derivatives of the innovations to the parameters of effects in the model."""
    along = (motion.q, motion.v, record.time, record.dt, motion.inputs)
    base = known_forces(model, *along)
    found = []
    for f in free_parameters(model, 1.0, policy):
        if not f.is_effect or base is None:
            continue
        h = 1e-3 * f.scale * (-1 if f.start + 1e-3 * f.scale > f.upper else 1)
        moved = known_forces(model.with_parameters({f.key: f.start + h}), *along)
        if moved is None or moved.values.shape != base.values.shape:
            continue
        change = (moved.values - base.values) / h
        if np.any(change) and np.isfinite(change).all():
            found.append(observer.respond(base.rows, base.pairs, change[None])[0])
    return found


def _equation_columns(
    model: MechanicalModel, observer: LinearObserver, motion: SmoothedMotion, record: Record
) -> Iterator[tuple[str, Array]]:
    """Yield the derivatives of the innovations to the numbers of equations of motion, by key.

    The observer keeps the linear part that it has.
    """
    for item in model.equations:
        law = dynamic_effects(model)[0][1]
        here = motion_at(model, law, record.time, motion.q, motion.v, 0.0, motion.inputs)
        rows, pairs = port_rows(model, law), port_pairs(law)
        for name, value in item.values.items():
            h = _DERIVATIVE_STEP * (abs(value) or 1.0)
            ends = [
                force_with(law.definition, {**item.values, name: x}, here)
                for x in (value + h, value - h)
            ]
            change = (ends[0] - ends[1]) / (2 * h)
            if name not in item.known and np.any(change) and np.isfinite(change).all():
                yield f"parameter.{name}", observer.respond(rows, pairs, change[None])[0]


def has_lightly_damped_mode(a: Array, least: float) -> bool:
    """Return whether a noise model has a mode damped less than `least`: a machine, no sensor."""
    if a.size < 3:
        return False  # one root is real
    roots = np.roots(a)
    roots = roots[(np.abs(roots) > 0.3) & (np.abs(roots.imag) > 1e-3)]
    s = np.log(roots.astype(complex))
    return bool(np.any(-np.real(s) / np.abs(s) < least))


def autoregression(e: Array, order: int) -> Array:
    """Return the whitening filter of an autoregressive fit."""
    if order == 0:
        return np.ones(1)
    n = len(e)
    r = np.array([e[: n - k] @ e[k:] for k in range(order + 1)]) / n
    R = r[np.abs(np.subtract.outer(np.arange(order), np.arange(order)))]
    a = np.linalg.solve(R + 1e-10 * r[0] * np.eye(order), r[1:])
    return np.concatenate([[1.0], -a])


class ScreenedEffect(NamedTuple):
    """An effect that might be missing, as far as screening can tell.

    Attributes
    ----------
    effect : Effect
        With first values of its parameters.
    nats : float
        Gain of the score to be expected of it alone.
    remark : str
        Why its signs cannot be physical, if they cannot.
    """

    effect: Effect
    nats: float
    remark: str

    @property
    def place(self) -> tuple[str, tuple[str, ...]]:
        """Kind and place."""
        return self.effect.kind, self.effect.at


@dataclass(frozen=True, eq=False)
class Screening:
    """All candidates, best first, and what the data says without any.

    Attributes
    ----------
    candidates : tuple of ScreenedEffect
        The likeliest kinds and places, the sensible ones first.
    finalists : tuple of CandidateColumns
        The shapes of the likeliest, those on sensors, and all that have one shape only: where the
        smoothed motion is poor (accelerometers with coloured noise) it names none.
    level : Level
        At which the model is likeliest without any.
    runs : tuple of FilteredRecord
        The run that the data do not lead, or hardly, and the one at this level.
    """

    candidates: tuple[ScreenedEffect, ...]
    finalists: tuple[CandidateColumns, ...]
    level: Level
    runs: tuple[FilteredRecord, ...] = ()


def screen(
    model: MechanicalModel, prepared: PreparedRecord, allowed: Sequence[Effect] | None = None
) -> Screening:
    """Rank every effect of the catalogue at every place it can act.

    Closely led by the data, the innovations show the fine structure of a missing force; what is
    large shows in runs that are hardly led, or not at all.

    Parameters
    ----------
    model : MechanicalModel
        With the effects found so far.
    prepared : PreparedRecord
    allowed : sequence of Effect, optional
        Effects to try, their parameters aside; all kinds at all places by default.
    """
    policy, record = prepared.policy, prepared.screened
    motion = prepared.motion(model, record)
    tried_at = [(e.definition, e.at) for e in allowed or ()]
    if allowed is None:
        tried_at = [(kind, at) for kind in kinds().values() for at in places(model, kind)]
    at_each = parallel_map(lambda where: candidate_columns(model, *where, motion, record), tried_at)
    entries = [entry for found in at_each for entry in found]
    constants = [e for e in entries if e.kind.family == CONSTANT] if allowed is None else []
    seen = parallel_map(
        lambda at: FilteredRecord(model, prepared, record, at, motion, constants), policy.screening
    )
    if not all(np.isfinite(f.errors).all() for f in seen):
        # along the smoothed motion an effect of the model diverges: nothing can be said beside it
        return Screening((), (), FREE)
    nulls = parallel_map(lambda f: min(f.null_scores(policy.noise_orders).values()), seen)
    likeliest = seen[int(np.argmin(nulls))]
    # the free run of a plant that integrates shows its drift and nothing else
    drifts = has_integrator(model, record.samples * record.dt)
    hardly_led = policy.guidance[: 1 if drifts else None]
    looked = dict.fromkeys([*(f for f in seen if f.level in hardly_led), likeliest])
    others = [e for e in entries if e not in constants]
    on_sensors = [e for e in others if e.kind.domain == "output"]
    beside = [e for e in others if e.kind.domain != "output"]
    at_levels = [_gains(f, beside) for f in looked]
    best = [max(alone, key=lambda a: (a.right, a.nats)) for alone in zip(*at_levels, strict=True)]
    chosen = {id(entry): entry for entry in on_sensors}
    # a shape that pulls the wrong way may fit best of all shapes of its effect: it takes no place
    # from the best right one
    for alone in at_levels:
        right = [(found.nats, e) for e, found in zip(beside, alone, strict=True) if found.right]
        _select_finalists(chosen, right, policy.finalists, 2)
    wrong = [(found.nats, e) for e, found in zip(beside, best, strict=True) if not found.right]
    _select_finalists(chosen, wrong, policy.finalists // 2, 1)
    shapes = Counter((entry.kind.kind, entry.at) for entry in entries)
    plain = [e for e in entries if id(e) not in chosen and shapes[e.kind.kind, e.at] == 1]
    candidates: dict[tuple[str, tuple[str, ...]], ScreenedEffect] = {}
    finals = [(e, found) for e, found in zip(beside, best, strict=True) if id(e) in chosen]
    for entry, found in sorted(finals, key=lambda pair: (-pair[1].right, -pair[1].nats)):
        remark = "" if found.right else "its force has the wrong sign"
        one = ScreenedEffect(effect_from(entry, found.sizes), found.nats, remark)
        candidates.setdefault(one.place, one)
    free = FilteredRecord(model, prepared, record, policy.guidance[0] if drifts else FREE, motion)
    runs = (free,) if likeliest.level == free.level else (free, likeliest)
    finalists = (*chosen.values(), *plain)
    return Screening(tuple(candidates.values()), finalists, likeliest.level, runs)


class _Alone(NamedTuple):
    """Sizes of a candidate alone by linear least squares, its gain, and whether signs are right."""

    nats: float
    sizes: Array
    right: bool


def _gains(f: FilteredRecord, entries: Sequence[CandidateColumns]) -> list[_Alone]:
    """Return what each candidate alone would gain in the innovations of one level."""
    rest = (f.residual() / f.sigma).ravel()
    total, samples = float(f.e @ rest), independent_errors(f.residual(), f.noise)
    nothing = _Alone(-np.inf, np.zeros(0), False)

    def alone(here: Sequence[int]) -> dict[int, _Alone]:
        X = f.columns([entries[i] for i in here])
        hidden, target = f.N @ X.T, X @ rest
        found, end = {}, 0
        for i in here:
            own = slice(end, end + entries[i].numbers)
            end = own.stop
            with np.errstate(over="ignore", invalid="ignore"):  # of a run that diverges
                gram = X[own] @ X[own].T
                left = gram - hidden[:, own].T @ f.factor @ hidden[:, own]
            c = _sizes_alone(entries[i], gram, left, target[own], f.model)
            found[i] = nothing
            if c is not None:
                fall = min(float(target[own] @ c) / total, 1 - LEAST_LEFT)
                cost = 0.5 * len(c) * np.log(samples)
                right = all(s * v >= 0 for s, v in zip(entries[i].shape.signs, c, strict=True))
                found[i] = _Alone(-0.5 * samples * float(np.log1p(-fall)) - cost, c, right)
        return found

    found: dict[int, _Alone] = {}
    for some in parallel_map(alone, _by_place(entries)):
        found |= some
    return [found[i] for i in range(len(entries))]


def _sizes_alone(
    entry: CandidateColumns, gram: Array, left: Array, target: Array, model: MechanicalModel
) -> Array | None:
    """Return the coefficients of one candidate, None if they cannot be its own.

    Parameters
    ----------
    entry : CandidateColumns
    gram, left : ndarray, shape (coefficients, coefficients)
        Its columns, and what is left of them beside the model's own numbers and starts.
    target : ndarray, shape (coefficients,)
    model : MechanicalModel
    """
    if not (np.isfinite(gram).all() and np.isfinite(target).all()):
        return None
    size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    scaled = left / np.outer(size, size)
    # hidden behind the model's own parameters, or of a motion that no observer could follow
    if not np.all(np.diag(scaled) >= HIDDEN):
        return None
    c = np.linalg.lstsq(scaled, target / size, rcond=1e-8)[0] / size
    sound = entry.shape.valid(c) and not exceeds_machine_mass(entry, c, model)
    return c if sound else None


def exceeds_machine_mass(entry: CandidateColumns, c: Array, model: MechanicalModel) -> bool:
    """Return whether a mass that an effect attaches would outweigh all that it is attached to.

    A mass that hardly moves turns its spring into one to ground, which another effect is.
    """
    names = [p.name for p in entry.kind.parameters if p.dimension == "M"]
    if not names:
        return False
    values = entry.shape.values(c)
    turns = model.is_rotational(entry.at)
    most = inertia_of(model, turns)
    return any(abs(values[name]) > most for name in names)


def _select_finalists(
    chosen: dict[int, CandidateColumns],
    scored: list[tuple[float, CandidateColumns]],
    most: int,
    shapes: int,
) -> None:
    """Add the best shapes of each effect and place, the best places first, no two much alike."""
    seen: dict[tuple[str, tuple[str, ...]], list[CandidateColumns]] = {}
    for nats, entry in sorted(scored, key=lambda item: -item[0]):
        key = (entry.kind.kind, entry.at)
        full = len(seen) >= most if key not in seen else len(seen[key]) >= shapes
        if (
            full
            or not np.isfinite(nats)
            or any(_nearly_collinear(entry, s) for s in seen.get(key, []))
        ):
            continue
        seen.setdefault(key, []).append(entry)
        chosen[id(entry)] = entry


_COLLINEAR_COSINE = 0.95
"""Cosine of two shapes from which the second would tell nothing that the first does not."""


def _nearly_collinear(one: CandidateColumns, other: CandidateColumns) -> bool:
    a, b = one.shape.columns[0].ravel(), other.shape.columns[0].ravel()
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return abs(float(a @ b)) > _COLLINEAR_COSINE * size
