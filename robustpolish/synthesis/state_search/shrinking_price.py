"""Singular problems: a price on u and x that shrinks until the norm stops falling."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robustpolish.synthesis.problem.pole_regions import PoleRegion
from robustpolish.synthesis.problem.state_feedback_problem import StateFeedbackProblem
from robustpolish.synthesis.riccati.state import lqr_gain
from robustpolish.synthesis.state_search.engines import Answer, Engine, minimise

# Prices in the scaled units, where entries of the plant are about one.
_STEP = 10.0
_PRICES = tuple(_STEP**-k for k in range(-3, 9))
_LANDINGS = 4
# Only below this price can a norm have reached its limit: above it is the norm of no control.
_LOW = 1e-4
# Tolerance of the first descent; a fifth of it is given away on every rung.
_COARSE = 0.5
# Weight of the states against the controls when all that is asked for is stability.
_STABILISING = 1e-3
# A norm that moves by less than this share from rung to rung has reached its limit ...
_CONVERGED = 3e-4
# ... if the gain grows by less than this factor: norms can rest on a plateau.
_GAIN_GROWTH = 1.2


@dataclass(frozen=True, eq=False)
class LadderAnswer:
    """The rung that was chosen, and whether a gain attains the limit.

    Attributes
    ----------
    answer : Answer
    attained : bool
        Whether norm and gain both settled.
    vanishing : bool
        Whether the norm was still falling when the target was reached.
    """

    answer: Answer
    attained: bool
    vanishing: bool


def is_regular(problem: StateFeedbackProblem) -> bool:
    """Return whether every control has a price: D12 of full column rank, to rounding."""
    p = problem
    if p.nu == 0:
        return True
    if p.C.shape[0] == 0:
        return False
    singular = np.linalg.svd(p.D12, compute_uv=False)
    if singular.size < p.nu:
        return False
    size = max(float(np.linalg.norm(p.C, 2)), float(singular[0]))
    return bool(singular[-1] > 1e-11 * size)


def almost_no_control(problem: StateFeedbackProblem, norm: str) -> float:
    """Return the norm without control or, if that is unstable, with the least that stabilises."""
    p = problem
    idle = p.achieved(np.zeros((p.nu, p.nx)), norm)
    if math.isfinite(idle):
        return idle
    return p.achieved(lqr_gain(p.only_effort(_STABILISING)), norm)


def solve_singular(
    engine: Engine,
    problem: StateFeedbackProblem,
    target: float,
    size: Callable[[np.ndarray], float],
    regions: Sequence[PoleRegion] = (),
) -> LadderAnswer | None:
    """Lower the price until the norm settles or falls below `target`.

    The first descent gives a tenth of the norm away on every rung, which keeps gains small;
    it decides where the norm falls without limit. Where it does not, a second
    descent looks for the infimum to the tolerance.

    Parameters
    ----------
    engine : Engine
    problem : StateFeedbackProblem
        Scaled; D12 may lack rank.
    target : float
        A norm small enough to stop at.
    size : callable
        Gain in the plant's units.
    regions : sequence of PoleRegion, optional

    Returns
    -------
    LadderAnswer or None
        The smallest gain within the tolerance of the best norm seen; None if nothing
        stabilises.
    """
    coarse = replace(engine, tolerance=max(engine.tolerance, _COARSE))
    found = _descend(coarse, problem, target, size, regions)
    if found is None or found.vanishing or engine.norm == "h2":
        return found
    return _descend(engine, problem, target, size, regions) or found


def _descend(
    engine: Engine,
    problem: StateFeedbackProblem,
    target: float,
    size: Callable[[np.ndarray], float],
    regions: Sequence[PoleRegion],
) -> LadderAnswer | None:
    rungs: list[Answer] = []
    history: list[dict[str, Any]] = []

    def rung(price: float) -> Answer | None:
        answer = minimise(engine, problem.with_price(price), regions)
        if answer is None:
            return None
        achieved = problem.achieved(answer.F, engine.norm)
        gain = size(answer.F)
        history.append({"step": "price", "price": price, "achieved": achieved, "gain": gain})
        return replace(answer, achieved=achieved, claimed=achieved)

    settled = False
    for price in _PRICES:
        if engine.remaining() <= 0:
            break
        answer = rung(price)
        if answer is None or not math.isfinite(answer.achieved):
            continue
        rungs.append(answer)
        if answer.achieved <= target:
            landed = _land(rung, answer, price, target, engine)
            return LadderAnswer(replace(landed, history=tuple(history)), False, True)
        low = price <= _LOW and len(rungs) > 1
        if low and _at_rest(rungs[-2], rungs[-1], size):
            settled = True
            break
    if not rungs:
        return None
    least = min(answer.achieved for answer in rungs)
    share = max(engine.tolerance, _CONVERGED)
    near = [answer for answer in rungs if answer.achieved <= least * (1 + share)]
    chosen = min(near, key=lambda answer: size(answer.F))
    return LadderAnswer(replace(chosen, history=tuple(history)), settled, False)


def _land(
    rung: Callable[[float], Answer | None],
    answer: Answer,
    price: float,
    target: float,
    engine: Engine,
) -> Answer:
    """Raise the price again as far as the norm stays below the target: gains shrink."""
    low, high = math.log(price), math.log(price * _STEP)
    if price == _PRICES[0]:
        high += 3 * math.log(_STEP)
    for _ in range(_LANDINGS):
        if engine.remaining() <= 0:
            break
        middle = (low + high) / 2
        other = rung(math.exp(middle))
        if other is not None and other.achieved <= target:
            answer, low = other, middle
        else:
            high = middle
    return answer


def _at_rest(before: Answer, after: Answer, size: Callable[[np.ndarray], float]) -> bool:
    same_norm = before.achieved < after.achieved * (1 + _CONVERGED)
    return same_norm and size(after.F) < _GAIN_GROWTH * size(before.F)
