"""Screen every effect at every place for the one that makes the innovations white."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from robustpolish.base.arrays import Array
from robustpolish.base.budget import parallel_map
from robustpolish.identification.fit.parameters import connected, free_parameters, is_guessed
from robustpolish.identification.fit.prepared import PreparedRecord, has_integrator
from robustpolish.identification.observer.kalman import FREE, Level, LinearObserver, force_sites
from robustpolish.identification.observer.missing_force import SmoothedMotion, known_forces
from robustpolish.identification.policy import Policy
from robustpolish.identification.record import Record
from robustpolish.machines.effects.effect import Effect, kinds
from robustpolish.machines.effects.evaluate import shapes_along
from robustpolish.machines.effects.kind import CONSTANT, EffectKind, Motion, Shape
from robustpolish.machines.mechanical.data import motion_at, port_pairs, port_row, port_rows
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.simulation import IntersampleLines, linear_interpolation

# Places of effects, and their forces along a known motion.


@dataclass(frozen=True, eq=False)
class CandidateColumns:
    """Candidate columns: forces along rows, or additions to outputs."""

    kind: EffectKind
    at: tuple[str, ...]
    shape: Shape
    rows: Array | None
    pairs: list[tuple[str, ...]]
    values: Array


def places(model: MechanicalModel, kind: EffectKind) -> list[tuple[str, ...]]:
    """Return where a kind of effect can act in a model."""
    channels = model.channels
    free, all_names = model.free, [name for name in model.dof_names if name not in channels]
    if not set(dict(kind.channels)) <= set(model.imposed):
        return []
    if kind.domain == "input":
        return [(i.name,) for i in model.inputs if i.imposes is None]
    if kind.domain == "output":
        return [(o.name,) for o in model.outputs]
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
    for pair in found:
        if turning.get(pair[0], turning.get(pair[1])) != turning.get(pair[1], turning.get(pair[0])):
            continue  # a displacement less an angle, which an inertia may couple, is no motion
        unique.setdefault(frozenset(pair), (pair[0], pair[1]))
    if "spring_stiffness" in kind.context:
        springs = {frozenset(s.between) for s in model.springs}
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
    if any(e.kind == kind.kind or mutually_exclusive(e, kind) for e in here):
        return []
    if kind.domain in ("input", "output"):
        return _signal_columns(model, kind, at, motion, record.time)
    effect = Effect.of(kind, at)
    # along a known motion no step has to be resolved
    here = motion_at(model, effect, record.time, motion.q, motion.v)
    if not here.q.any():
        return []
    _, sites = force_sites(model)
    force = None
    if kind.domain == "dof" and (at[0], "ground") in sites:
        force = motion.force[sites.index((at[0], "ground"))][None]
    if "clearance" in dict(kind.gives) and _needs_clearance(model, at):
        return _clearances(model, kind, at, motion, record)
    rows, pairs = port_rows(model, effect), port_pairs(effect)
    return [
        CandidateColumns(kind, at, shape, rows, pairs, shape.columns)
        for shape in shapes_along(kind, replace(here, force=force))
    ]


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
    along = (motion.q, motion.v, record.time, record.dt)
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
        ends = [(name, "ground") for name in model.dof_names]
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
        self.level, self.policy = level, prepared.policy
        self.model = model
        self.observer = LinearObserver(model, record.dt, level, prepared.scales)
        forces = known_forces(model, motion.q, motion.v, record.time, record.dt)
        Y = record.raw_outputs(model)
        lines = record.own_lines(record.lines(model))
        _, errors = self.observer.innovations(Y, motion.inputs, forces, lines=lines)
        self.errors = errors
        self.sigma = np.ones(errors.shape[1])
        own = nuisance_columns(model, self.policy, self.observer, motion, record)
        self.raw, self.ridge, self.keys = own
        # a mean that no constant explains is no constant's alone: it hides what else is missing
        for column in (self.respond(entry) for entry in constants):
            if np.any(column) and np.isfinite(column).all():
                self.raw = np.concatenate([self.raw, column])
                self.ridge = np.concatenate([self.ridge, np.zeros(len(column))])
        self.reweigh(np.std(errors[len(errors) // 20 :], axis=0))
        for _ in range(2):
            rest = self.residual(None)[0]
            self.reweigh(np.std(rest, axis=0))

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

    def residual(self, X: Array | None) -> tuple[Array, Array]:
        """Return the residual in the outputs' units and the coefficients of X."""
        if X is None:
            rest = self.e - self.N.T @ (self.factor @ self.Ne)
            return rest.reshape(self.errors.shape) * self.sigma, np.zeros(0)
        NX = self.N @ X.T
        gram = X @ X.T
        projected = gram - NX.T @ self.factor @ NX
        target = X @ self.e - NX.T @ self.factor @ self.Ne
        size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        scaled = projected / np.outer(size, size)
        # hidden behind the model's own parameters, or of a motion that no observer could follow
        if not np.all(np.diag(scaled) >= 1e-4):
            return self.errors, np.full(len(X), np.nan)
        c = np.linalg.lstsq(scaled, target / size, rcond=1e-8)[0] / size
        beta = self.factor @ (self.Ne - NX @ c)
        rest = self.e - self.N.T @ beta - X.T @ c
        return rest.reshape(self.errors.shape) * self.sigma, c

    def respond(self, entry: CandidateColumns) -> Array:
        """Return the innovations that an entry's columns leave."""
        if entry.rows is None:
            return self.observer.respond_outputs(entry.values)
        return self.observer.respond(entry.rows, entry.pairs, entry.values)

    def scores(self, rest: Array, coefficients: int, orders: Sequence[int]) -> dict[int, float]:
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
            found[order] = total + (coefficients + order * rest.shape[1]) * np.log(samples)
        return found

    def null_scores(self, orders: Sequence[int]) -> dict[int, float]:
        """Return the same of the model as it is, with no force added."""
        return self.scores(self.residual(None)[0], 0, orders)


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
    for name in model.free:
        i = model.dof_names.index(name)
        key, row = ".".join(model.dof(name).key), port_row(model, (name,))
        add(key, row, (name, "ground"), -motion.a[i], 1 / (policy.mass_prior * m.M[i, i]))
    columns = []
    for row, pair, force in zip(rows, pairs, forces, strict=True):
        columns.append(observer.respond(row[None], [pair], force[None, None])[0])
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
    # masses and gains are weighed, springs and dampers may be off by decades
    sure = [j < len(seen.keys) and not is_guessed(seen.keys[j]) for j in columns]
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
    along = (motion.q, motion.v, record.time, record.dt)
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


@dataclass(frozen=True, eq=False)
class ScreenedEffect:
    """An effect that might be missing, as far as screening can tell.

    Attributes
    ----------
    effect : Effect
        With first values of its parameters.
    score : float
        Half the fall of the Bayesian information criterion against no effect: log odds.
    fall : float
        Share by which the innovations fall at the level without effect.
    remark : str
        Why its signs or values cannot be physical, if they cannot.
    """

    effect: Effect
    score: float
    fall: float
    remark: str = ""

    @property
    def sensible(self) -> bool:
        """Whether signs and values are physical."""
        return not self.remark

    @property
    def place(self) -> tuple[str, tuple[str, ...]]:
        """Kind and place."""
        return self.effect.kind, self.effect.at

    @property
    def constant(self) -> bool:
        """Whether it never changes, as an offset or a preload."""
        return self.effect.definition.family == CONSTANT


@dataclass(frozen=True, eq=False)
class Screening:
    """All candidates, best first, and what the data says without any.

    Attributes
    ----------
    candidates : tuple of ScreenedEffect
        By their odds, the sensible ones first.
    finalists : tuple of Columns
        The shapes of the likeliest, and of those that are large, for a look at free runs; and all
        that have one shape only, for where the smoothed motion is poor (accelerometers with
        coloured noise) it names none.
    level : Level
        At which the model is likeliest without any.
    free : FilteredRecord or None
        The run that the data do not lead, or hardly.
    """

    candidates: tuple[ScreenedEffect, ...]
    finalists: tuple[CandidateColumns, ...]
    level: Level
    free: FilteredRecord | None = None


def screen(
    model: MechanicalModel, prepared: PreparedRecord, allowed: Sequence[Effect] | None = None
) -> Screening:
    """Score every effect of the catalogue at every place it can act.

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
    levels = policy.screening
    tried_at = [(e.definition, e.at) for e in allowed or ()]
    if allowed is None:
        tried_at = [(kind, at) for kind in kinds().values() for at in places(model, kind)]
    at_each = parallel_map(lambda where: candidate_columns(model, *where, motion, record), tried_at)
    entries = [entry for found in at_each for entry in found]
    constants = [e for e in entries if e.kind.family == CONSTANT] if allowed is None else []
    beside = [e for e in entries if e not in constants]
    seen = parallel_map(
        lambda at: FilteredRecord(model, prepared, record, at, motion, constants), levels
    )
    filtered = dict(zip(levels, seen, strict=True))
    if not all(np.isfinite(f.errors).all() for f in filtered.values()):
        # along the smoothed motion an effect of the model diverges: nothing can be said beside it
        return Screening((), (), FREE)
    alone = parallel_map(lambda f: f.null_scores(policy.noise_orders), seen)
    nulls = {
        (level, order): score
        for level, scores in zip(levels, alone, strict=True)
        for order, score in scores.items()
    }
    best_level = min(nulls, key=lambda key: nulls[key])[0]
    null = min(nulls.values())
    coarse = dict.fromkeys([best_level, *policy.coarse])
    hardly = dict.fromkeys(policy.weak_guidance)
    rough, wide = _FirstScreening(), _FirstScreening()
    first = {level: filtered[level] for level in {**coarse, **hardly}}
    for entry, tried in zip(beside, _score_entries(first, beside, (0,)), strict=True):
        rough.add(entry, [(tried[level][0][0], tried[level][1]) for level in coarse])
        wide.add(
            entry, [(tried[level][0][0] - nulls[level, 0], tried[level][1]) for level in hardly]
        )
    found = []
    chosen: dict[int, CandidateColumns] = {}
    _select_finalists(chosen, rough.right, policy.finalists, 2)
    _select_finalists(chosen, wide.right, policy.further_finalists, 1)
    _select_finalists(chosen, rough.wrong, policy.further_finalists, 1)
    finalists = list(chosen.values())
    looked = _score_entries(filtered, finalists, policy.noise_orders)
    for entry, tried in zip(finalists, looked, strict=True):
        right = {level: t for level, t in tried.items() if not _has_wrong_sign(entry, t[1])}
        score, level = min(
            (
                (score, level)
                for level, (scores, _) in (right or tried).items()
                for score in scores.values()
            ),
            key=lambda o: o[0],
        )
        odds = (null - score) / 2
        found.append(_candidate(entry, odds, tried[level][1], filtered[level]))
    found.sort(key=lambda c: (-c.sensible, -c.score))
    shapes = Counter((entry.kind.kind, entry.at) for entry in entries)
    plain = [e for e in entries if id(e) not in chosen and shapes[e.kind.kind, e.at] == 1]
    # the free run of a plant that integrates shows its drift and nothing else
    drifts = has_integrator(model, record.samples * record.dt)
    level = policy.weak_guidance[0] if drifts else FREE
    free = FilteredRecord(model, prepared, record, level, motion)
    return Screening(_best_per_place(found), (*finalists, *plain), best_level, free)


def _score_entries(
    filtered: Mapping[Level, FilteredRecord],
    entries: Sequence[CandidateColumns],
    orders: Sequence[int],
) -> list[dict[Level, tuple[dict[int, float], Array]]]:
    """Return for each entry what :func:`_score_entry` finds at some levels."""
    return parallel_map(
        lambda entry: {level: _score_entry(f, entry, orders) for level, f in filtered.items()},
        entries,
    )


def _score_entry(
    f: FilteredRecord, entry: CandidateColumns, orders: Sequence[int]
) -> tuple[dict[int, float], Array]:
    """Return the information criterion with an entry's columns, and their coefficients."""
    raw = f.respond(entry)
    bad = dict.fromkeys(orders, np.inf)
    if not np.isfinite(raw).all():
        return bad, np.full(len(raw), np.nan)
    rest, c = f.residual(f.weighted(raw))
    if (
        not np.isfinite(c).all()
        or not entry.shape.valid(c)
        or exceeds_machine_mass(entry, c, f.model)
    ):
        return bad, c
    samples = len(f.errors)
    scores = f.scores(rest, len(c), orders)
    if entry.kind.domain == "output":
        # scaling the data down makes every error smaller: the density of the data pays for it
        effect = Effect.of(entry.kind, entry.at, entry.shape.values(c))
        gain = entry.kind.signal_slope(effect.values).gain
        if abs(1 - 1 / gain) > f.policy.sensor_gain:
            return bad, c
        scores = {order: score + 2 * samples * np.log(gain) for order, score in scores.items()}
    return scores, c


class _FirstScreening:
    """What a first look found: shapes that pull the right way somewhere, and those that never do.

    A shape that pulls the wrong way may well fit best of all shapes of its effect: the place of the
    best right one is not to be taken by it.
    """

    def __init__(self) -> None:
        self.right: list[tuple[float, CandidateColumns]] = []
        self.wrong: list[tuple[float, CandidateColumns]] = []

    def add(self, entry: CandidateColumns, tried: Sequence[tuple[float, Array]]) -> None:
        """Add a shape with its scores and coefficients at some levels."""
        right = [score for score, c in tried if not _has_wrong_sign(entry, c)]
        where = self.right if right else self.wrong
        where.append((min(right or [score for score, _ in tried]), entry))


def _has_wrong_sign(entry: CandidateColumns, c: Array) -> bool:
    return any(s * v < 0 for s, v in zip(entry.shape.signs, c, strict=True))


def exceeds_machine_mass(entry: CandidateColumns, c: Array, model: MechanicalModel) -> bool:
    """Return whether a mass that an effect attaches would outweigh all that it is attached to.

    A mass that hardly moves turns its spring into one to ground, which another effect is.
    """
    names = [p.name for p in entry.kind.parameters if p.dimension == "M"]
    if not names:
        return False
    values = entry.shape.values(c)
    turning = {dof.name: dof.rotational for dof in model.dofs}
    most = sum(dof.mass for dof in model.dofs if dof.rotational == turning[entry.at[0]])
    return any(abs(values[name]) > most for name in names)


def _select_finalists(
    chosen: dict[int, CandidateColumns],
    scored: list[tuple[float, CandidateColumns]],
    most: int,
    shapes: int,
) -> None:
    """Add the best shapes of each effect and place, the best places first, no two much alike."""
    seen: dict[tuple[str, tuple[str, ...]], list[CandidateColumns]] = {}
    for score, entry in sorted(scored, key=lambda item: item[0]):
        key = (entry.kind.kind, entry.at)
        full = len(seen) >= most if key not in seen else len(seen[key]) >= shapes
        if (
            full
            or not np.isfinite(score)
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


def _candidate(
    entry: CandidateColumns, score: float, c: Array, f: FilteredRecord
) -> ScreenedEffect:
    """Return an entry at one level, with the coefficients that it has there."""
    remark = "its force has the wrong sign" if _has_wrong_sign(entry, c) else ""
    values = dict(entry.shape.values(c)) if np.isfinite(c).all() else {}
    for name, value in values.items():
        parameter = entry.kind.parameter(name)
        values[name] = float(np.clip(value, parameter.lower, parameter.upper))
    effect = Effect.of(entry.kind, entry.at, values)
    before = _size(f.residual(None)[0], entry)
    after = _size(f.residual(f.weighted(f.respond(entry)))[0], entry)
    return ScreenedEffect(effect, score, float(1 - np.min(after / before)), remark)


def _size(errors: Array, entry: CandidateColumns) -> Array:
    """Return the size of errors; their mean is the business of constants alone."""
    if entry.kind.family == CONSTANT:
        return np.sqrt(np.mean(errors**2, axis=0))
    return np.std(errors, axis=0)


def _best_per_place(found: list[ScreenedEffect]) -> tuple[ScreenedEffect, ...]:
    best: dict[tuple[str, tuple[str, ...]], ScreenedEffect] = {}
    for candidate in found:
        best.setdefault(candidate.place, candidate)
    return tuple(best.values())
