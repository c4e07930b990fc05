"""The search for the controller of one part, in scaled units: descend, tidy, certify."""

from __future__ import annotations

from itertools import chain

import numpy as np

from robustpolish.arrays import AnyVector as Vector
from robustpolish.errors import SolverError
from robustpolish.long_calls import Budget
from robustpolish.synthesis.certificate.certificate import certify
from robustpolish.synthesis.nonsmooth import (
    GainMeasure,
    Problem,
    Requirement,
    minimax,
)
from robustpolish.synthesis.problem.decoupling import with_signals
from robustpolish.synthesis.structured_search.multistart import SearchResult, descend_from
from robustpolish.synthesis.structured_search.policy import POLICY
from robustpolish.synthesis.structured_search.structure import PartDesign, PartProblem


def design_part(part: PartProblem, budget: Budget, seed: int, target: float) -> PartDesign:
    """Search a controller of one part.

    Where the best one cannot be certified, its gain is too large for doubles: the search
    goes on under a lower ceiling.

    Parameters
    ----------
    part : PartProblem
    budget : Budget
    seed : int
    target : float
        A norm that is good enough, in the part's units.

    Raises
    ------
    SolverError
        If no start led to a stable loop that meets the requirements.
    """
    level = part.scaled.scaled_norm(target, part.norm) if target > 0 else 0.0
    goal = float(np.log(max(level, POLICY.zero)))
    rng = np.random.default_rng(seed)
    found, first = None, None
    for ceiling in POLICY.ceilings:
        again = first is not None
        problem = part.below(ceiling)
        own = budget.share(POLICY.again_share if again else POLICY.search_share)
        effort = POLICY.again if again else part.effort
        starts = part.proposals(own, rng)
        if found is not None and first is not None:
            gain = np.abs(part.parametrisation.gain(found.point)).max()
            starts = chain([first * ceiling / gain], starts)
        # Line searches try gains so wild that numbers overflow; such gains count as infinite.
        with np.errstate(over="ignore", invalid="ignore"):
            result = descend_from(
                starts, problem, part.stability, effort, own, rng, goal, part.bounds
            )
        if result.point is None or not np.isfinite(result.value):
            if found is not None:
                break
            raise SolverError(_failure(part, result, budget))
        found, first = _outcome(part, problem, result, budget), result.point
        # When time is over nothing is tried again, and the whole is certified in any case.
        if budget.over or certify(with_signals(part.plant), found.controller, part.norm).valid:
            break
    assert found is not None
    return found


def _outcome(
    part: PartProblem, problem: Problem, result: SearchResult, budget: Budget
) -> PartDesign:
    with np.errstate(over="ignore", invalid="ignore"):
        point, value = _smaller_gain(part, problem, result, budget)
    assert result.point is not None
    # Before it was made smaller: did the search push against the ceiling?
    pushed = np.abs(problem.parametrisation.gain(result.point)).max(initial=0.0)
    at_ceiling = pushed > POLICY.near_ceiling * problem.ceiling
    if part.bounds is not None and part.open_ended is not None:
        at_ceiling = (point > part.bounds[1] - 0.1)[part.open_ended].any()
    values = [entry.get("value", np.inf) for entry in result.history]
    scaled, norm = part.scaled, part.norm
    return PartDesign(
        scaled=scaled,
        controller=part.controller(problem.parametrisation.gain(point)),
        point=point,
        norm=scaled.norm(float(np.exp(value)), norm),
        reason=result.reason,
        agreeing=sum(v <= 1.0001 * min(values) for v in values),
        descents=len(values),
        at_ceiling=bool(at_ceiling),
        history=tuple(
            {**entry, "value": scaled.norm(entry["value"], norm)} if "value" in entry else entry
            for entry in result.history
        ),
    )


def _smaller_gain(
    part: PartProblem, problem: Problem, result: SearchResult, budget: Budget
) -> tuple[Vector, float]:
    """Give away a little of the norm for the smallest gain."""
    assert result.point is not None
    if result.point.size == 0:
        return result.point, result.value
    if result.value < np.log(10 * POLICY.zero):
        return _rounded(problem, result.point), result.value
    K = problem.parametrisation.gain(result.point)
    bound = float(np.exp(result.value)) * (1 + part.slack)
    small = Problem(
        problem.parametrisation,
        part.size or GainMeasure(np.eye(K.shape[0]), np.eye(K.shape[1])),
        (Requirement(problem.objective, bound), *problem.requirements),
        problem.ceiling,
    )
    if not K.any() or small.model(result.point) is None:
        return result.point, result.value
    ended = minimax(small, result.point, budget, iterations=150, weight=100.0, bounds=part.bounds)
    check = problem.model(ended.point)
    if check is None or check.violation > 1e-9 or check.objective > np.log(bound) + 1e-6:
        return result.point, result.value
    if (
        np.abs(problem.parametrisation.gain(ended.point)).max()
        > POLICY.worthwhile * np.abs(K).max()
    ):
        # Not worth the part of the norm.
        return result.point, result.value
    return ended.point, check.objective


def _rounded(problem: Problem, point: Vector) -> Vector:
    """Round a gain whose norm is zero but for rounding, so that it becomes exactly zero."""
    for bits in (10, 20, 30, 40):
        rounded = np.round(point * 2.0**bits) / 2.0**bits
        model = problem.model(rounded)
        if model is not None and model.objective < np.log(POLICY.zero) - 10:
            return rounded
    return point


def _failure(part: PartProblem, result: SearchResult, budget: Budget) -> str:
    tried = f"{len(result.history)} descents"
    more = "try another seed"
    if budget.late:
        tried, more = f"{tried} before time ran out", "raise time_limit"
    if part.demands and any("value" in entry for entry in result.history):
        return f"No {part.what} that meets {part.demands} was found by {tried}. Relax it or {more}."
    reached = (
        f"; the lowest spectral abscissa was {result.instability:.3g} of the plant's size"
        if np.isfinite(result.instability)
        else ""
    )
    return (
        f"No stabilising {part.what} was found by {tried}{reached}. None is proven not to "
        f"exist. {part.advice}, {more}, or use output_feedback."
    )
