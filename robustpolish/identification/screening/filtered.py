"""A record seen through the observer of one level, the model's own errors taken out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.signal import lfilter

from robustpolish.arrays import Array
from robustpolish.identification.fit.parameters import free_parameters
from robustpolish.identification.fit.prepared import PreparedRecord
from robustpolish.identification.observer.kalman import Level
from robustpolish.identification.observer.linear_observer import LinearObserver
from robustpolish.identification.observer.missing_force import Smoothed, known_forces
from robustpolish.identification.policy import Policy
from robustpolish.identification.record import Record
from robustpolish.identification.screening.candidates import Columns
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.ports import port_row
from robustpolish.simulation.between import Lines, lines_through


class FilteredRecord:
    """A part of a record seen through the observer of one level.

    Parameters
    ----------
    model : MechanicalModel
    prepared : PreparedRecord
    record : Record
        The part.
    level : Level
    motion : Smoothed
        Along the part.
    """

    def __init__(
        self,
        model: MechanicalModel,
        prepared: PreparedRecord,
        record: Record,
        level: Level,
        motion: Smoothed,
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
        self.raw, self.ridge = own_errors(model, self.policy, self.observer, motion, record)
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

    def respond(self, entry: Columns) -> Array:
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
                if resonates(a, self.policy.own_damping):
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


def own_errors(
    model: MechanicalModel,
    policy: Policy,
    observer: LinearObserver,
    motion: Smoothed,
    record: Record,
) -> tuple[Array, Array]:
    """Return innovations left by errors of the model's own numbers and of the start.

    Returns
    -------
    columns : ndarray, shape (count, samples, ny)
    ridge : ndarray, shape (count,)
        The inverse of how far each number may be off; 0 where nothing is known.
    """
    rows, pairs, forces, ridge = [], [], [], []

    def add(row: Array, pair: tuple[str, ...], force: Array, prior: float) -> None:
        if np.any(force):
            rows.append(row)
            pairs.append(pair)
            forces.append(force)
            ridge.append(prior)

    for spring in model.springs:
        row = port_row(model, spring.between)
        add(row, spring.between, -(row @ motion.q), _ridge(spring.stiffness, policy.spring_share))
    for damper in model.dampers:
        row = port_row(model, damper.between)
        add(row, damper.between, -(row @ motion.v), _ridge(damper.damping, policy.damper_share))
    m = model.matrices
    for name in model.free:
        i = model.dof_names.index(name)
        row = port_row(model, (name,))
        add(row, (name, "ground"), -motion.a[i], 1 / (policy.mass_prior * m.M[i, i]))
    columns = []
    for row, pair, force in zip(rows, pairs, forces, strict=True):
        columns.append(observer.respond(row[None], [pair], force[None, None])[0])
    lines = record.own_lines(record.lines(model)) or lines_through(motion.inputs)
    nothing = np.zeros((record.samples, len(model.outputs)))
    for j in range(m.B.shape[1]):
        only = np.arange(motion.inputs.shape[1]) == j
        force = Lines(only * lines.begin, only * lines.end)
        columns.append(-observer.innovations(nothing, only * motion.inputs, None, lines=force)[1])
        ridge.append(1 / policy.gain_prior)
    for column in _effect_columns(model, policy, observer, motion, record):
        columns.append(column)
        ridge.append(0.0)
    starts = observer.respond_start(record.samples)[: 2 * len(model.free)]
    columns += list(starts)
    ridge += [0.0] * len(starts)
    if not columns:
        return np.zeros((0, record.samples, len(model.outputs))), np.zeros(0)
    return np.stack(columns), np.array(ridge)


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
    motion: Smoothed,
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


def resonates(a: Array, least: float) -> bool:
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
