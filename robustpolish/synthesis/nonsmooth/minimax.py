"""A bundle method that sees all active peaks at once.

Each step solves a quadratic programme over all pieces near the maximum, after Apkarian and
Noll, "Nonsmooth H-infinity synthesis" (2006): the model is max_i (f_i + g_i d) + d'Hd/2 with
H a quasi-Newton matrix of the Lagrangian, in a trust region. A rejected step leaves the
frequency that spoiled it in the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from scipy import sparse

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.arrays import AnyVector as Vector
from robustpolish.long_calls import Budget, step_cost
from robustpolish.synthesis.nonsmooth.bfgs import Descent, ended_by
from robustpolish.synthesis.nonsmooth.folded import Bounds
from robustpolish.synthesis.nonsmooth.problem import Model, Problem

# Its type stubs know nothing of what it exports.
clarabel: Any = import_module("clarabel")


def minimax(
    problem: Problem,
    start: Vector,
    budget: Budget,
    iterations: int = 200,
    target: float = -np.inf,
    tolerance: float = 1e-8,
    width: float = 0.05,
    bounds: Bounds | None = None,
    weight: float = 10.0,
) -> Descent:
    """Minimise the largest piece of a problem under its requirements.

    Parameters
    ----------
    problem : Problem
    start : ndarray
        A point with a finite objective; it may violate requirements.
    budget : Budget
        Of evaluations and quadratic programmes.
    iterations : int
        Largest number of quadratic programmes.
    target : float
        Stop when the objective (a logarithm) is below it and nothing is violated.
    tolerance : float
        Stop when the model promises less than this.
    width : float
        Pieces within this share of the largest enter the model.
    bounds : pair of ndarray, optional
        Lower and upper bounds of theta.
    weight : float
        First price of a violated requirement.

    Returns
    -------
    Descent
        Its value is the logarithm of the objective; infinite if a requirement is violated.
    """

    def evaluated(point: Vector, known: Sequence[float] = ()) -> Model | None:
        # Looking for all peaks takes twice as long as for the highest.
        budget.spend(2 * problem.work)
        return problem.model(point, width, known)

    x = np.array(start, dtype=float)
    model = evaluated(x)
    if model is None:
        return Descent(x, np.inf, 0, "stalled")
    if len(x) > _MOST_NUMBERS:
        iterations = 0
    H = np.eye(len(x)) * 1e-3 * max(1e-6, float(np.abs(model.slopes).max()))
    radius = 0.3 * max(1.0, float(np.abs(x).max(initial=0.0)))
    extra: list[float] = []
    kept = (x, model.objective if model.violation == 0 else np.inf)
    reason, steps = "iterations", 0
    while steps < iterations:
        steps += 1
        if budget.over:
            reason = ended_by(budget)
            break
        if model.objective < target and model.violation == 0:
            reason = "target"
            break
        # An interior-point method factorises matrices of this size some ten times.
        budget.spend(step_cost(len(x) // 2))
        step = _quadratic_step(model, x, H, radius, weight, bounds, budget.seconds_left)
        if step is None or step.promise < tolerance:
            if model.violation > 1e-6 and weight < 1e6 and step is not None:
                weight *= 10
                continue
            if step is not None and step.inside:
                reason = "stationary"
                break
            radius *= 0.1 if step is None else 3.0
            if not 1e-12 < radius < 1e12:
                reason = "stalled"
                break
            continue
        trial_point = x + step.d
        marked = [w for w in model.frequencies if w is not None]
        trial = evaluated(trial_point, marked[:10])
        if trial is None:
            radius = 0.25 * float(np.abs(step.d).max())
        else:
            y = _lagrangian_change(model, trial, step)
            gain = _merit(model, weight) - _merit(trial, weight)
            H = _damped(H, step.d, y)
            radius = _next_radius(radius, step, gain)
            if gain > 0.05 * step.promise:
                x, extra = trial_point, []
                model = evaluated(x) or trial
                if model.violation == 0 and model.objective < kept[1]:
                    kept = (x, model.objective)
                continue
            extra = [*extra, *_frequencies(trial)][-12:]
            model = evaluated(x, extra) or model
        if radius < 1e-10 * max(1.0, float(np.abs(x).max())):
            reason = "stalled"
            break
    value = model.objective if model.violation <= 1e-9 else np.inf
    if kept[1] <= value:
        x, value = kept
    return Descent(x, value, steps, reason)


# Beyond this many free numbers one quadratic programme takes longer than many steps of BFGS.
_MOST_NUMBERS = 800


@dataclass(frozen=True, eq=False)
class _Step:
    d: Vector
    promise: float
    weights: Vector
    excess_weights: Vector
    inside: bool


def _merit(model: Model, weight: float) -> float:
    return model.objective + weight * model.violation


def _frequencies(model: Model) -> list[float]:
    return [w for w in model.frequencies if w is not None][:3]


def _next_radius(radius: float, step: _Step, gain: float) -> float:
    size = float(np.abs(step.d).max())
    if gain < 0.25 * step.promise:
        return 0.3 * size
    if gain > 0.6 * step.promise and size > 0.9 * radius:
        return 2.5 * radius
    return radius


def _quadratic_step(
    model: Model,
    x: Vector,
    H: Matrix,
    radius: float,
    weight: float,
    bounds: Bounds | None,
    seconds: float,
) -> _Step | None:
    """Solve min t + weight s + d'Hd/2 over the linearised pieces in the trust region."""
    n, m, p = len(x), len(model.values), len(model.excess)
    low, high = np.full(n, -radius), np.full(n, radius)
    if bounds is not None:
        low, high = np.maximum(low, bounds[0] - x), np.minimum(high, bounds[1] - x)
    rows = np.zeros((m + p + 1 + 2 * n, n + 2))
    rows[:m, :n], rows[:m, n] = model.slopes, -1
    rows[m : m + p, :n], rows[m : m + p + 1, n + 1] = model.excess_slopes, -1
    rows[m + p + 1 :, :n] = np.vstack([np.eye(n), -np.eye(n)])
    right = np.concatenate(
        [model.objective - model.values, -model.excess, [0.0], high, -low],
    )
    P = np.zeros((n + 2, n + 2))
    P[:n, :n] = np.triu(H)
    q = np.concatenate([np.zeros(n), [1.0, weight]])
    solution = _solve(P, q, rows, right, seconds)
    if solution is None:
        return None
    d, duals = np.clip(solution[0][:n], low, high), np.maximum(solution[1], 0.0)
    predicted = float((model.values + model.slopes @ d).max())
    missed = float(max(0.0, (model.excess + model.excess_slopes @ d).max(initial=0.0)))
    curve = 0.5 * float(d @ H @ d)
    promise = _merit(model, weight) - (predicted + weight * missed + curve)
    # Bounds of theta may stay active at a minimum; only the trust region may not.
    inside = bool(np.abs(d).max(initial=0.0) < 0.99 * radius)
    return _Step(d, promise, duals[:m], duals[m : m + p], inside)


def _solve(
    P: Matrix, q: Vector, rows: Matrix, right: Vector, seconds: float
) -> tuple[Vector, Vector] | None:
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_iter = 60
    settings.time_limit = max(seconds, 1e-3)
    cones = [clarabel.NonnegativeConeT(len(right))]
    matrices = sparse.csc_matrix(P), sparse.csc_matrix(rows)
    solution = clarabel.DefaultSolver(matrices[0], q, matrices[1], right, cones, settings).solve()
    d, duals = np.array(solution.x), np.array(solution.z)
    return (d, duals) if np.isfinite(d).all() and np.isfinite(duals).all() else None


def _lagrangian_change(old: Model, new: Model, step: _Step) -> Vector:
    """Return the change of the weighted gradient, each peak followed as it moves."""
    change = np.zeros_like(step.d)
    for i in np.flatnonzero(step.weights > 1e-6):
        j = _follow(old, new, int(i))
        change += step.weights[i] * (new.slopes[j] - old.slopes[i])
    if len(new.excess):
        for i in np.flatnonzero(step.excess_weights > 1e-6):
            apart = np.linalg.norm(new.excess_slopes - old.excess_slopes[i], axis=1)
            j = int(np.argmin(apart))
            change += step.excess_weights[i] * (new.excess_slopes[j] - old.excess_slopes[i])
    return change


def _follow(old: Model, new: Model, i: int) -> int:
    """Find the new piece that continues an old one: near in frequency, then in gradient."""
    place = old.frequencies[i]
    candidates = np.arange(len(new.values))
    if place is not None:
        spots = np.array([np.nan if w is None else w for w in new.frequencies])
        same = np.isinf(spots) if np.isinf(place) else np.abs(spots - place) <= 0.1 * abs(place)
        moved = same & (spots != place)
        pick = moved if moved.any() else same
        if pick.any():
            candidates = candidates[pick]
    apart = np.linalg.norm(new.slopes[candidates] - old.slopes[i], axis=1)
    return int(candidates[np.argmin(apart)])


def _damped(H: Matrix, s: Vector, y: Vector) -> Matrix:
    """Return Powell's damped BFGS update of the Hessian, which stays positive definite."""
    Hs = H @ s
    sHs = float(s @ Hs)
    if sHs <= 0 or not np.isfinite(y).all():
        return H
    sy = float(s @ y)
    if sy < 0.1 * sHs:
        share = 0.9 * sHs / (sHs - sy)
        y = share * y + (1 - share) * Hs
        sy = float(s @ y)
    updated = H - np.outer(Hs, Hs) / sHs + np.outer(y, y) / sy
    return 0.5 * (updated + updated.T)
