"""Several descents from different starts, until they agree or the work is done."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from robustpolish.arrays import AnyVector as Vector
from robustpolish.long_calls import Budget
from robustpolish.synthesis.nonsmooth import (
    Bounds,
    Folded,
    Measure,
    Problem,
    bfgs,
    ended_by,
    minimax,
)
from robustpolish.synthesis.structured_search.policy import POLICY, Effort


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The best point of all descents.

    Attributes
    ----------
    point : ndarray or None
        None if no start led to a stable loop that meets the requirements.
    value : float
        Logarithm of its norm; infinite if there is none.
    reason : str
        "agreed", "patience", "starts", "target", "work" or "time".
    instability : float
        The lowest spectral abscissa seen, where nothing was stable.
    history : tuple of mapping
        One entry per descent.
    """

    point: Vector | None
    value: float
    reason: str
    instability: float
    history: tuple[Mapping[str, Any], ...]


@dataclass
class _Progress:
    point: Vector | None = None
    value: float = np.inf
    instability: float = np.inf
    since: int = 0
    values: list[float] = field(default_factory=list)
    history: list[Mapping[str, Any]] = field(default_factory=list)

    def take(self, point: Vector, value: float) -> None:
        self.values.append(value)
        self.since += 1
        if value < self.value - POLICY.agreement:
            self.since = 0
        if value < self.value:
            self.point, self.value = point, value

    def keep(self, problem: Problem, point: Vector) -> None:
        """Remember a start that meets the requirements, lest nothing better be found."""
        model = problem.model(point) if problem.requirements else None
        if model is not None and model.violation == 0 and model.objective < self.value:
            self.point, self.value = point, model.objective

    def agreeing(self) -> int:
        return sum(v <= self.value + POLICY.agreement for v in self.values)


def descend_from(
    starts: Iterable[Vector],
    problem: Problem,
    stability: Measure,
    effort: Effort,
    budget: Budget,
    rng: np.random.Generator,
    target: float = -np.inf,
    bounds: Bounds | None = None,
    weight: float = 3.0,
) -> SearchResult:
    """Descend from each start: to stability, by BFGS, then by the bundle method.

    Every third descent after the first success starts near the best point so far
    instead.

    Parameters
    ----------
    starts : iterable of ndarray
    problem : Problem
    stability : Measure
        Negative for a stable loop; lowered first where a start is unstable.
    effort : Effort
    budget : Budget
    rng : numpy.random.Generator
        For the descents near the best point.
    target : float
        Logarithm of a norm that is good enough.
    bounds : pair of ndarray, optional
        Bounds of the free numbers.
    weight : float
        Price of a violated requirement in the BFGS phase.

    Returns
    -------
    SearchResult
    """
    progress, reason = _Progress(), "starts"
    if problem.parametrisation.size == 0:
        starts = [np.zeros(0)]
    for count, start in enumerate(starts):
        if count >= effort.descents:
            break
        if progress.point is not None and count % 3 == 2:
            start = _nearby(progress.point, rng)
        own = (start, budget, target, progress, bounds, weight, effort.smooth_first)
        _descend(problem, stability, *own)
        stop = _verdict(progress, effort, budget, target)
        if stop is not None:
            reason = stop
            break
    return SearchResult(
        progress.point, progress.value, reason, progress.instability, tuple(progress.history)
    )


def _nearby(point: Vector, rng: np.random.Generator) -> Vector:
    spread = 10 ** rng.uniform(-2.5, -0.5)
    size = np.abs(point) + 0.1 * np.abs(point).mean()
    return point + spread * size * rng.normal(size=point.size)


def _verdict(progress: _Progress, effort: Effort, budget: Budget, target: float) -> str | None:
    if budget.over:
        return ended_by(budget)
    if progress.value < target:
        return "target"
    enough = len(progress.values) >= effort.fewest
    if progress.point is not None and enough and progress.agreeing() >= effort.agreeing:
        return "agreed"
    if progress.point is not None and progress.since >= effort.patience:
        return "patience"
    return None


def _descend(
    problem: Problem,
    stability: Measure,
    start: Vector,
    budget: Budget,
    target: float,
    progress: _Progress,
    bounds: Bounds | None,
    weight: float,
    smooth_first: bool,
) -> None:
    began = budget.spent
    folded = None if bounds is None else Folded(problem.parametrisation, bounds)
    smooth = problem if folded is None else replace(problem, parametrisation=folded)
    point = start if bounds is None else np.clip(start, *bounds)
    if point.size == 0:
        model = problem.model(point)
        if model is not None and model.violation <= 0:
            progress.take(point, model.objective)
        progress.history.append({"outcome": "nothing is free"})
        return
    if problem.model(point) is None:
        point, abscissa = stabilise(smooth, stability, point, budget)
        point = point if folded is None else folded.point(point)
        progress.instability = min(progress.instability, abscissa)
        if problem.model(point) is None:
            progress.history.append({"outcome": "not stabilised", "abscissa": abscissa})
            return
    progress.keep(problem, point)
    first = None
    if smooth_first:
        first = bfgs(
            lambda theta: smooth.penalised(theta, weight),
            point,
            budget,
            problem.work,
            POLICY.iterations(point.size),
            target if not problem.requirements else -np.inf,
        )
        point = first.point if folded is None else folded.point(first.point)
    if first is None or first.value < progress.value + 0.1:
        last = minimax(problem, point, budget, target=target, bounds=bounds)
        point, value, how = last.point, last.value, last.reason
    else:
        model = problem.model(point)
        feasible = model is not None and model.violation <= 1e-9
        value, how = (first.value if feasible else np.inf), first.reason
    progress.take(point, value)
    progress.history.append(
        {
            "outcome": how,
            "value": float(np.exp(value)),
            "work": budget.spent - began,
        }
    )


def stabilise(
    problem: Problem, stability: Measure, start: Vector, budget: Budget
) -> tuple[Vector, float]:
    """Lower the spectral abscissa by BFGS until the objective is finite."""
    parametrisation = problem.parametrisation
    # Some abscissas fall without end, but gains beyond the ceiling are worth nothing.
    ceiling = max(problem.ceiling, np.abs(parametrisation.gain(start)).max())

    def function(theta: Vector) -> tuple[float, Vector]:
        K = parametrisation.gain(theta)
        pieces = stability.pieces(K, 0.0, ()) if np.abs(K).max() <= ceiling else []
        if not pieces:
            return np.inf, np.zeros_like(theta)
        return pieces[0].value, parametrisation.back(theta, pieces[0].gradient)

    margin = 1e-7
    point, abscissa = start, np.inf
    for _ in range(4):
        ended = bfgs(function, point, budget, stability.work, 200, -margin, tolerance=1e-6)
        if not np.isfinite(ended.value):
            return start, np.inf
        point, abscissa = ended.point, ended.value
        if ended.value >= 0 or problem.model(point) is not None:
            break
        margin *= 30
    return point, abscissa
