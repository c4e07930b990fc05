"""Search for one structured controller in scaled units: descend, tidy, certify."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Any, Literal

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.errors import SolverError
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.certificate.certificate import certify
from robustpolish.synthesis.nonsmooth import (
    Bounds,
    GainMeasure,
    H2Measure,
    HinfMeasure,
    Measure,
    Parametrisation,
    Problem,
    Requirement,
    SearchLimits,
    SearchResult,
    StabilityMeasure,
    WorstMeasure,
    minimax,
    search,
)
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.scaling import ScaledPlant

Matrix = NDArray[Any]
Vector = NDArray[Any]
Norm = Literal["hinf", "h2"]
Starts = Callable[[float, np.random.Generator], Iterator[Vector]]

CEILINGS = (1e5, 3e3, 1e2, 1e1)
"""Largest entry of a controller in scaled units; an infimum beyond it counts as not attained.

The next one is used where a controller at the one before cannot be certified.
"""

SLACK = 5e-5
"""Share of the norm that is given away for a smaller gain."""

ZERO = 1e-13
"""A norm of the scaled plant below this is zero up to rounding."""


@dataclass(frozen=True, eq=False)
class Setting:
    """A structured problem for one decoupled part.

    Attributes
    ----------
    scaled : ScaledPlant
        The part before and after scaling.
    norm : {"hinf", "h2"}
    loop : PlantMatrices
        The scaled part, with integrators for a dynamic controller.
    parametrisation : Parametrisation
    starts : callable
        (deadline, generator) -> starts for the descents.
    controller : callable
        K -> the controller in the part's own units.
    what : str
        What is designed, for messages.
    requirements : tuple of Requirement
    bound_named : str
        The requirement in words, for messages; empty if there is none.
    descents : int
        Largest number of descents.
    fewest : int
        Number of descents before their agreement counts.
    objective_loop : PlantMatrices or None
        The loop whose norm is minimised, if it is another than `loop`.
    also_stable : tuple of PlantMatrices
        Further loops to be made stable first, such as the controller itself.
    bounds : pair of ndarray or None
        Bounds of the free numbers.
    size : Measure or None
        What is made small in the end; the largest singular value of K by default.
    slack : float
        Share of the norm that is given away for that.
    """

    scaled: ScaledPlant
    norm: Norm
    loop: PlantMatrices
    parametrisation: Parametrisation
    starts: Starts
    controller: Callable[[Matrix], control.StateSpace]
    what: str
    requirements: tuple[Requirement, ...] = ()
    bound_named: str = ""
    descents: int = 100
    fewest: int = 9
    objective_loop: PlantMatrices | None = None
    also_stable: tuple[PlantMatrices, ...] = ()
    bounds: Bounds | None = None
    size: Measure | None = None
    slack: float = SLACK

    @property
    def plant(self) -> GeneralizedPlant:
        """The part in its own units."""
        return self.scaled.original


@dataclass(frozen=True, eq=False)
class PartDesign:
    """The controller of one part.

    Attributes
    ----------
    controller : control.StateSpace
        In the part's own units.
    gain : ndarray
        K = [[Ak, Bk], [Ck, Dk]] in scaled units.
    point : ndarray
        The free numbers.
    norm : float
        What the search achieved, in the part's units.
    reason : str
        Why the search stopped.
    agreeing, descents : int
        How many descents ended at the best norm, and how many there were.
    at_ceiling : bool
        Whether the gain grew until it was stopped.
    history : tuple of mapping
        One entry per descent.
    """

    controller: control.StateSpace
    gain: Matrix
    point: Vector
    norm: float
    reason: str
    agreeing: int
    descents: int
    at_ceiling: bool
    history: tuple[Mapping[str, Any], ...]


def solve_setting(
    setting: Setting, deadline: float, seed: int = 0, target: float = 0.0
) -> PartDesign:
    """Search for the best controller of a structure before `deadline`.

    Parameters
    ----------
    setting : Setting
    deadline : float
        Of :func:`time.monotonic`.
    seed : int
    target : float
        A norm that is good enough, in the part's units.

    Raises
    ------
    SolverError
        If no start led to a stable loop that meets the requirements.
    """
    loop = setting.loop
    measure = objective(with_performance(setting.objective_loop or loop), setting.norm)
    size = float(np.linalg.norm(loop.A, 2)) or 1.0
    stability = WorstMeasure(
        tuple(StabilityMeasure.of(each, size) for each in (loop, *setting.also_stable))
    )
    rng = np.random.default_rng(seed)
    found, first = None, None
    for ceiling in CEILINGS:
        problem = Problem(setting.parametrisation, measure, setting.requirements, ceiling)
        limits = _limits(setting, target, deadline, again=found is not None)
        starts = setting.starts(limits.deadline, rng)
        if found is not None and first is not None:
            starts = chain([first * ceiling / np.abs(found.gain).max()], starts)
        # Line searches try gains so wild that numbers overflow; such gains count as infinite.
        with np.errstate(over="ignore", invalid="ignore"):
            result = search(problem, stability, starts, limits, rng, setting.bounds)
        if result.point is None or not np.isfinite(result.value):
            if found is not None:
                break
            raise SolverError(_failure(setting, result))
        found, first = _outcome(setting, problem, result, deadline), result.point
        if certify(setting.plant, found.controller, setting.norm).valid:
            break
    assert found is not None
    return found


def _limits(setting: Setting, target: float, deadline: float, again: bool) -> SearchLimits:
    """Leave time for a smaller gain, and for a second search if the first was no use."""
    now = time.monotonic()
    level = setting.scaled.scaled_norm(target, setting.norm) if target > 0 else 0.0
    return SearchLimits(
        deadline=now + (0.3 if again else 0.75) * (deadline - now),
        target=float(np.log(max(level, ZERO))),
        starts=3 if again else setting.descents,
        fewest=setting.fewest,
        agreeing=min(4, setting.fewest),
    )


def _outcome(
    setting: Setting, problem: Problem, result: SearchResult, deadline: float
) -> PartDesign:
    with np.errstate(over="ignore", invalid="ignore"):
        point, value = _smaller_gain(setting, problem, result, deadline)
    K = problem.parametrisation.gain(point)
    assert result.point is not None
    # Before it was made smaller: did the search push against the ceiling?
    pushed = np.abs(problem.parametrisation.gain(result.point)).max(initial=0.0)
    values = [entry.get("value", np.inf) for entry in result.history]
    scaled, norm = setting.scaled, setting.norm
    return PartDesign(
        controller=setting.controller(K),
        gain=K,
        point=point,
        norm=scaled.norm(float(np.exp(value)), norm),
        reason=result.reason,
        agreeing=sum(v <= 1.0001 * min(values) for v in values),
        descents=len(values),
        at_ceiling=bool(pushed > 0.5 * problem.ceiling),
        history=tuple(
            {**entry, "value": scaled.norm(entry["value"], norm)} if "value" in entry else entry
            for entry in result.history
        ),
    )


def objective(loop: PlantMatrices, norm: Norm) -> Measure:
    """Return the measure of a norm."""
    return HinfMeasure(loop) if norm == "hinf" else H2Measure(loop)


def with_performance(loop: PlantMatrices) -> PlantMatrices:
    """Disturb and watch the states where no disturbance reaches any performance output."""
    if loop.B1.shape[1] and loop.C1.shape[0]:
        return loop
    n, nu, ny = len(loop.A), loop.B2.shape[1], loop.C2.shape[0]
    zeros = np.zeros
    return PlantMatrices(
        loop.A,
        np.eye(n),
        loop.B2,
        np.eye(n),
        loop.C2,
        zeros((n, n)),
        zeros((n, nu)),
        zeros((ny, n)),
        loop.D22,
        loop.discrete,
    )


def _smaller_gain(
    setting: Setting, problem: Problem, result: SearchResult, deadline: float
) -> tuple[NDArray[np.float64], float]:
    """Give away a little of the norm for the smallest gain."""
    assert result.point is not None
    if result.point.size == 0:
        return result.point, result.value
    if result.value < np.log(10 * ZERO):
        return _rounded(problem, result.point), result.value
    K = problem.parametrisation.gain(result.point)
    bound = float(np.exp(result.value)) * (1 + setting.slack)
    small = Problem(
        problem.parametrisation,
        setting.size or GainMeasure(np.eye(K.shape[0]), np.eye(K.shape[1])),
        (Requirement(problem.objective, bound), *problem.requirements),
        problem.ceiling,
    )
    if not K.any() or small.model(result.point) is None:
        return result.point, result.value
    ended = minimax(
        small, result.point, deadline, iterations=150, weight=100.0, bounds=setting.bounds
    )
    check = problem.model(ended.point)
    if check is None or check.violation > 1e-9 or check.objective > np.log(bound) + 1e-6:
        return result.point, result.value
    if np.abs(problem.parametrisation.gain(ended.point)).max() > 0.5 * np.abs(K).max():
        # Not worth the part of the norm.
        return result.point, result.value
    return ended.point, check.objective


def _rounded(problem: Problem, point: Vector) -> Vector:
    """Round a gain whose norm is zero but for rounding, so that it becomes exactly zero."""
    for bits in (10, 20, 30, 40):
        rounded = np.round(point * 2.0**bits) / 2.0**bits
        model = problem.model(rounded)
        if model is not None and model.objective < np.log(ZERO) - 10:
            return rounded
    return point


def _failure(setting: Setting, result: SearchResult) -> str:
    tried = f"{len(result.history)} descents"
    if setting.bound_named and any("value" in entry for entry in result.history):
        return (
            f"No {setting.what} that meets {setting.bound_named} was found by {tried}. "
            "Relax it or raise time_limit."
        )
    reached = (
        f"; the lowest spectral abscissa was {result.instability:.3g} of the plant's size"
        if np.isfinite(result.instability)
        else ""
    )
    return (
        f"No stabilising {setting.what} was found by {tried}{reached}. None is proven not to "
        "exist. Raise order=, time_limit or the seed, or use output_feedback."
    )
