"""Several descents from different starts, until they agree or time is up."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robustpolish.synthesis.nonsmooth.bfgs import bfgs
from robustpolish.synthesis.nonsmooth.minimax import Bounds, minimax
from robustpolish.synthesis.nonsmooth.problem import Measure, Problem

Vector = NDArray[Any]

# Two descents agree if their norms differ by less than this share.
_AGREEMENT = 1e-4


@dataclass(frozen=True, eq=False)
class SearchLimits:
    """When to stop.

    Attributes
    ----------
    deadline : float
        Of :func:`time.monotonic`.
    target : float
        Logarithm of a norm that is good enough.
    starts : int
        Largest number of descents.
    fewest : int
        Number of descents before agreement counts.
    agreeing : int
        Stop when so many descents have reached the best norm ...
    patience : int
        ... or when so many in a row have not improved it.
    """

    deadline: float
    target: float = -np.inf
    starts: int = 40
    fewest: int = 9
    agreeing: int = 4
    patience: int = 16


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
        "agreed", "patience", "starts", "target" or "time".
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
        if value < self.value - _AGREEMENT:
            self.since = 0
        if value < self.value:
            self.point, self.value = point, value

    def keep(self, problem: Problem, point: Vector) -> None:
        """Remember a start that meets the requirements, lest nothing better be found."""
        model = problem.model(point) if problem.requirements else None
        if model is not None and model.violation == 0 and model.objective < self.value:
            self.point, self.value = point, model.objective

    def agreeing(self) -> int:
        return sum(v <= self.value + _AGREEMENT for v in self.values)


def search(
    problem: Problem,
    stability: Measure,
    starts: Iterable[Vector],
    limits: SearchLimits,
    rng: np.random.Generator,
    bounds: Bounds | None = None,
    weight: float = 3.0,
) -> SearchResult:
    """Descend from each start: to stability, by BFGS, then by the bundle method.

    Every third descent after the first success starts near the best point so far
    instead.

    Parameters
    ----------
    problem : Problem
    stability : Measure
        Negative for a stable loop; lowered first where a start is unstable.
    starts : iterable of ndarray
    limits : SearchLimits
    rng : numpy.random.Generator
        For the descents near the best point.
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
        starts, limits = [np.zeros(0)], replace(limits, starts=1)
    for count, start in enumerate(starts):
        if count >= limits.starts:
            break
        near = progress.point is not None and count % 3 == 2
        begin = _nearby(progress.point, rng) if near and progress.point is not None else start
        _descend(problem, stability, begin, limits, progress, bounds, weight)
        stop = _verdict(progress, limits)
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


def _verdict(progress: _Progress, limits: SearchLimits) -> str | None:
    if time.monotonic() > limits.deadline:
        return "time"
    if progress.value < limits.target:
        return "target"
    enough = len(progress.values) >= limits.fewest
    if progress.point is not None and enough and progress.agreeing() >= limits.agreeing:
        return "agreed"
    if progress.point is not None and progress.since >= limits.patience:
        return "patience"
    return None


def _descend(
    problem: Problem,
    stability: Measure,
    start: Vector,
    limits: SearchLimits,
    progress: _Progress,
    bounds: Bounds | None,
    weight: float,
) -> None:
    began = time.monotonic()
    point = start if bounds is None else np.clip(start, *bounds)
    if point.size == 0:
        model = problem.model(point)
        if model is not None and model.violation <= 0:
            progress.take(point, model.objective)
        progress.history.append({"outcome": "nothing is free"})
        return
    if problem.model(point) is None:
        point, abscissa = stabilise(problem, stability, point, limits.deadline)
        progress.instability = min(progress.instability, abscissa)
        if problem.model(point) is None:
            progress.history.append({"outcome": "not stabilised", "abscissa": abscissa})
            return
    progress.keep(problem, point)
    first = None
    if bounds is None:
        first = bfgs(
            lambda theta: problem.penalised(theta, weight),
            point,
            limits.deadline,
            target=limits.target if not problem.requirements else -np.inf,
        )
        point = first.point
    if first is None or first.value < progress.value + 0.1:
        last = minimax(problem, point, limits.deadline, target=limits.target, bounds=bounds)
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
            "seconds": time.monotonic() - began,
        }
    )


def stabilise(
    problem: Problem, stability: Measure, start: Vector, deadline: float
) -> tuple[Vector, float]:
    """Lower the spectral abscissa by BFGS until the objective is finite."""
    parametrisation = problem.parametrisation

    def function(theta: Vector) -> tuple[float, Vector]:
        pieces = stability.pieces(parametrisation.gain(theta), 0.0, ())
        if not pieces:
            return np.inf, np.zeros_like(theta)
        return pieces[0].value, parametrisation.back(theta, pieces[0].gradient)

    margin = 1e-7
    point, abscissa = start, np.inf
    for _ in range(4):
        ended = bfgs(function, point, deadline, iterations=200, target=-margin, tolerance=1e-6)
        if not np.isfinite(ended.value):
            return start, np.inf
        point, abscissa = ended.point, ended.value
        if ended.value >= 0 or problem.model(point) is not None:
            break
        margin *= 30
    return point, abscissa
