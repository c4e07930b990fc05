"""Screen every effect at every place for the one that makes the innovations white."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from robustpolish.effects import Effect, kinds
from robustpolish.identification.candidates import Columns, columns_at, places
from robustpolish.identification.missing_force import (
    LinearObserver,
    Smoothed,
    known_forces,
    smooth,
)
from robustpolish.identification.observer import Level, Scales
from robustpolish.identification.parameters import GAIN_PRIOR, MASS_PRIOR
from robustpolish.identification.record import Record
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.simulation.nonlinear import raw_outputs, signals
from robustpolish.simulation.nonlinear_system import port_row

Array = NDArray[np.float64]

FOLLOWING = (Level(10.0), Level(3.0), Level(1.0), Level(0.3), Level(0.1))
LEVELS = (
    Level(3.0), Level(1.0), Level(0.3), Level(0.1), Level(0.03), Level(0.01), Level(0.002),
    Level(0.0), Level(0.0, 0.03), Level(0.0, 0.12),
)  # fmt: skip
ORDERS = (0, 1, 2, 4)
SPRING_SHARE = 0.1
DAMPER_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class Candidate:
    """An effect that might be missing, as far as screening can tell.

    Attributes
    ----------
    effect : Effect
        With first values of its parameters.
    score : float
        Half the fall of the Bayesian information criterion against no effect: log odds.
    fall : float
        Share by which the innovations fall at the level without effect.
    level : Level
        Level of guidance at which it does best: small if it explains everything.
    sensible : bool
        Whether signs and values are physical.
    """

    effect: Effect
    score: float
    fall: float
    level: Level
    sensible: bool = True
    remark: str = ""


@dataclass(frozen=True, eq=False)
class Screening:
    """All candidates, best first, and what the data says without any."""

    candidates: tuple[Candidate, ...]
    level: Level
    order: int
    motion: Smoothed
    levels: dict[Level, float] = field(default_factory=dict)


class Filtered:
    """Everything seen through the observer of one level."""

    def __init__(
        self, model: MechanicalModel, record: Record, level: Level, scales: Scales,
        motion: Smoothed, time: Array,
    ) -> None:  # fmt: skip
        self.level = level
        self.observer = LinearObserver(model, record.dt, level, scales)
        forces = known_forces(model, motion.q, motion.v, time, record.dt)
        Y = raw_outputs(model, record.Y)
        _, errors = self.observer.innovations(Y, motion.inputs, forces)
        self.errors = errors
        self.sigma = np.ones(errors.shape[1])
        nuisance, self.ridge = _nuisance(model, self.observer, motion, time, record.dt)
        self.raw = nuisance
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
        projected = X @ X.T - NX.T @ self.factor @ NX
        target = X @ self.e - NX.T @ self.factor @ self.Ne
        size = np.sqrt(np.maximum(np.diag(X @ X.T), 1e-300))
        scaled = projected / np.outer(size, size)
        if np.any(np.diag(scaled) < 1e-4):  # hidden behind the model's own parameters
            return self.errors, np.full(len(X), np.nan)
        c = np.linalg.lstsq(scaled, target / size, rcond=1e-8)[0] / size
        beta = self.factor @ (self.Ne - NX @ c)
        rest = self.e - self.N.T @ beta - X.T @ c
        return rest.reshape(self.errors.shape) * self.sigma, c

    def respond(self, entry: Columns) -> Array:
        """Return the innovations that an entry's columns leave."""
        if entry.rows is None:
            return self.observer.respond_outputs(entry.values)
        return self.observer.respond(entry.rows, entry.pairs, entry.values)

    def scores(
        self, rest: Array, coefficients: int, orders: Sequence[int] = ORDERS
    ) -> dict[int, float]:
        """Return the information criterion for noise of several autoregressive orders."""
        samples, found = len(rest), {}
        for order in orders:
            total = 0.0
            for e in rest.T:
                a = autoregression(e, order)
                if resonates(a):
                    total = np.inf
                    break
                white = np.asarray(lfilter(a, [1.0], e)) if order else e
                total += samples * np.log(max(float(np.mean(white**2)), 1e-300))
            found[order] = total + (coefficients + order * rest.shape[1]) * np.log(samples)
        return found


def resonates(a: Array) -> bool:
    """Return whether a noise model has a lightly damped mode: that is a machine, not a sensor."""
    roots = np.roots(a)
    roots = roots[(np.abs(roots) > 0.3) & (np.abs(roots.imag) > 1e-3)]
    s = np.log(roots.astype(complex))
    return bool(np.any(-np.real(s) / np.abs(s) < 0.35))


def autoregression(e: Array, order: int) -> Array:
    """Return the whitening filter of an autoregressive fit."""
    if order == 0:
        return np.ones(1)
    n = len(e)
    r = np.array([e[: n - k] @ e[k:] for k in range(order + 1)]) / n
    R = r[np.abs(np.subtract.outer(np.arange(order), np.arange(order)))]
    a = np.linalg.solve(R + 1e-10 * r[0] * np.eye(order), r[1:])
    return np.concatenate([[1.0], -a])


def _nuisance(
    model: MechanicalModel, observer: LinearObserver, motion: Smoothed, time: Array, dt: float
) -> tuple[Array, Array]:
    """Return innovations left by errors of the model's own numbers and of the start."""
    rows, pairs, forces, ridge = [], [], [], []

    def add(row: Array, pair: tuple[str, ...], force: Array, prior: float) -> None:
        if np.any(force):
            rows.append(row)
            pairs.append(pair)
            forces.append(force)
            ridge.append(prior)

    for spring in model.springs:
        row = port_row(model, spring.between)
        add(row, spring.between, -(row @ motion.q), _ridge(spring.stiffness, SPRING_SHARE))
    for damper in model.dampers:
        row = port_row(model, damper.between)
        add(row, damper.between, -(row @ motion.v), _ridge(damper.damping, DAMPER_SHARE))
    m = model.matrices
    for name in model.free:
        i = model.dof_names.index(name)
        row = port_row(model, (name,))
        add(row, (name, "ground"), -motion.a[i], 1 / (MASS_PRIOR * m.M[i, i]))
    columns = []
    for row, pair, force in zip(rows, pairs, forces, strict=True):
        columns.append(observer.respond(row[None], [pair], force[None, None])[0])
    for j in range(m.B.shape[1]):
        force = np.outer(m.B[:, j], motion.inputs[:, j])
        eye = np.eye(len(m.B))
        ends = [(name, "ground") for name in model.dof_names]
        columns.append(observer.respond(eye, ends, force[None])[0])
        ridge.append(1 / GAIN_PRIOR)
    for column in _effect_columns(model, observer, motion, time, dt):
        columns.append(column)
        ridge.append(0.0)
    starts = observer.respond_start(len(time))[: 2 * len(model.free)]
    columns += list(starts)
    ridge += [0.0] * len(starts)
    if not columns:
        return np.zeros((0, len(time), len(model.outputs))), np.zeros(0)
    return np.stack(columns), np.array(ridge)


def _ridge(value: float, share: float) -> float:
    """Return the inverse of how far a number may be off after the refit.

    Without it, the smoothed motion of masses that are not measured, which follows the missing
    force, could explain that force with an absurd spring or damper.
    """
    return 1 / (share * abs(value)) if value else 0.0


def _effect_columns(
    model: MechanicalModel, observer: LinearObserver, motion: Smoothed, time: Array, dt: float
) -> list[Array]:
    """Return the derivatives of the innovations to the parameters of effects in the model."""
    from robustpolish.identification.parameters import free_parameters

    base = known_forces(model, motion.q, motion.v, time, dt)
    found = []
    for f in free_parameters(model, 1.0):
        if not f.is_effect or base is None:
            continue
        h = 1e-3 * f.scale * (-1 if f.start + 1e-3 * f.scale > f.upper else 1)
        moved = known_forces(
            model.with_parameters({f.key: f.start + h}), motion.q, motion.v, time, dt
        )
        if moved is None or moved.values.shape != base.values.shape:
            continue
        change = (moved.values - base.values) / h
        if np.any(change) and np.isfinite(change).all():
            found.append(observer.respond(base.rows, base.pairs, change[None])[0])
    return found


def screen(
    model: MechanicalModel,
    record: Record,
    scales: Scales,
    amplitude: float,
    allowed: Sequence[Effect] | None = None,
    finalists: int = 24,
) -> Screening:
    """Score every effect of the catalogue at every place it can act.

    Parameters
    ----------
    model : MechanicalModel
        With the effects found so far.
    record : Record
    scales : Scales
    amplitude : float
        Displacement amplitude, for the steps of effects in the model.
    allowed : sequence of Effect, optional
        Effects to try, their parameters aside; all kinds at all places by default.
    finalists : int
        How many are looked at with every level and noise colour.
    """
    time = np.asarray(record.data["time"].values, dtype=float)
    motion = smooth(model, record, following(model, record, scales), scales, amplitude)
    filtered = {level: Filtered(model, record, level, scales, motion, time) for level in LEVELS}
    nulls = {
        (level, order): score
        for level, f in filtered.items()
        for order, score in f.scores(f.residual(None)[0], 0).items()
    }
    best_level, best_order = min(nulls, key=lambda key: nulls[key])
    null = nulls[best_level, best_order]
    tried_at = [(e.definition, e.at) for e in allowed or ()]
    if allowed is None:
        tried_at = [(kind, at) for kind in kinds().values() for at in places(model, kind)]
    entries = [
        c for kind, at in tried_at for c in columns_at(model, kind, at, motion, time, record.dt)
    ]
    coarse = dict.fromkeys([best_level, Level(0.3), Level(0.01)])
    rough: list[tuple[float, Columns]] = []
    for entry in entries:
        scores = [_try(filtered[level], entry, (0,))[0][0] for level in coarse]
        rough.append((min(scores), entry))
    rough.sort(key=lambda item: item[0])
    found = []
    for entry in _finalists(rough, finalists):
        tried = {level: _try(f, entry, ORDERS) for level, f in filtered.items()}
        score, level = min(
            ((score, level) for level, (scores, _) in tried.items() for score in scores.values()),
            key=lambda o: o[0],
        )
        found.append(_candidate(entry, (null - score) / 2, level, tried, filtered))
    found.sort(key=lambda c: (-c.sensible, -c.score))
    levels = {level: min(nulls[level, o] for o in ORDERS) for level in LEVELS}
    return Screening(tuple(_best_of_each(found)), best_level, best_order, motion, levels)


def following(model: MechanicalModel, record: Record, scales: Scales) -> Level:
    """Return the level whose innovations are smallest: it shows the motion best."""
    W = signals(model, record.data)
    Y = raw_outputs(model, record.Y)
    best, least = FOLLOWING[0], np.inf
    for level in FOLLOWING:
        observer = LinearObserver(model, record.dt, level, scales)
        _, errors = observer.innovations(Y, W, None)
        tail = errors[len(errors) // 20 :]
        score = float(np.sum(np.log(np.mean(tail**2, axis=0))))
        if score < least:
            best, least = level, score
    return best


def _try(f: Filtered, entry: Columns, orders: Sequence[int]) -> tuple[dict[int, float], Array]:
    """Return the information criterion with an entry's columns, and their coefficients."""
    raw = f.respond(entry)
    bad = dict.fromkeys(orders, np.inf)
    if not np.isfinite(raw).all():
        return bad, np.full(len(raw), np.nan)
    rest, c = f.residual(f.weighted(raw))
    if not np.isfinite(c).all() or not entry.shape.valid(c):
        return bad, c
    samples = len(f.errors)
    scores = f.scores(rest, len(c), orders)
    if entry.kind.kind == "sensor_gain":
        # scaling the data down makes every error smaller: the density of the data pays for it
        if abs(c[0]) > 0.6:
            return bad, c
        jacobian = -2 * samples * np.log(1.0 - float(c[0]))
        scores = {order: score + jacobian for order, score in scores.items()}
    return scores, c


def _finalists(rough: list[tuple[float, Columns]], count: int) -> list[Columns]:
    """Return the best shape of each effect and place, the best places first."""
    seen: dict[tuple[str, tuple[str, ...]], int] = {}
    chosen = []
    for score, entry in rough:
        key = (entry.kind.kind, entry.at)
        if seen.get(key, 0) >= 2 or not np.isfinite(score):
            continue
        if key not in seen and len(seen) >= count:
            continue
        seen[key] = seen.get(key, 0) + 1
        chosen.append(entry)
    return chosen


def _candidate(
    entry: Columns,
    score: float,
    level: Level,
    tried: dict[Level, tuple[dict[int, float], Array]],
    filtered: dict[Level, Filtered],
) -> Candidate:
    remark, c = "", tried[level][1]
    for sign, value in zip(entry.shape.signs, c, strict=True):
        if sign * value < 0:
            remark = "its force has the wrong sign"
    values = dict(entry.shape.values(c)) if np.isfinite(c).all() else {}
    for name, value in values.items():
        parameter = entry.kind.parameter(name)
        values[name] = float(np.clip(value, parameter.lower, parameter.upper))
    effect = Effect(entry.kind.kind, entry.at, values)
    f = filtered[level]
    before = np.sqrt(np.mean(f.residual(None)[0] ** 2, axis=0))
    after = np.sqrt(np.mean(f.residual(f.weighted(f.respond(entry)))[0] ** 2, axis=0))
    fall = float(1 - np.min(after / before))
    return Candidate(effect, score, fall, level, not remark, remark)


def _best_of_each(found: list[Candidate]) -> list[Candidate]:
    best: dict[tuple[str, tuple[str, ...]], Candidate] = {}
    for candidate in found:
        best.setdefault((candidate.effect.kind, candidate.effect.at), candidate)
    return list(best.values())
