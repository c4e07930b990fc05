"""Singular problems: a price on u and x that shrinks until the norm stops falling."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robustpolish.synthesis.full_state.engines import Answer, Engine, minimise
from robustpolish.synthesis.full_state.problem import StateFeedbackProblem
from robustpolish.synthesis.pole_regions import PoleRegion

# Prices in the scaled units, where entries of the plant are about one.
_PRICES = tuple(10.0 ** (-k / 2) for k in range(17))
# A norm that moves by less than this share over two rungs has reached its limit.
_CONVERGED = 3e-4
# A gain that grows by less than this factor over two rungs has reached its limit too.
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


def first_rung(
    engine: Engine, problem: StateFeedbackProblem, regions: Sequence[PoleRegion] = ()
) -> float:
    """Return the norm at the highest price: what almost no control achieves."""
    answer = minimise(engine, problem.with_price(_PRICES[0]), regions)
    return math.inf if answer is None else problem.achieved(answer.F, engine.norm)


def descend(
    engine: Engine,
    problem: StateFeedbackProblem,
    target: float,
    size: Callable[[np.ndarray], float],
    regions: Sequence[PoleRegion] = (),
) -> LadderAnswer | None:
    """Lower the price until the norm settles or falls below `target`.

    Parameters
    ----------
    engine : Engine
    problem : StateFeedbackProblem
        Scaled; D12 may lack rank.
    target : float
        A norm small enough to stop at.
    size : callable
        Gain in the plant's units, for the record.
    regions : sequence of PoleRegion, optional

    Returns
    -------
    LadderAnswer or None
        The smallest gain within the tolerance of the best norm seen; None if nothing
        stabilises.
    """
    rungs: list[Answer] = []
    history: list[dict[str, Any]] = []
    settled = vanishing = False
    for price in _PRICES:
        if engine.remaining() <= 0:
            break
        answer = minimise(engine, problem.with_price(price), regions)
        if answer is None:
            continue
        achieved = problem.achieved(answer.F, engine.norm)
        history.append(
            {"step": "price", "price": price, "achieved": achieved, "gain": size(answer.F)}
        )
        if not math.isfinite(achieved):
            continue
        # The price only adds to the norm, so its bound holds without it.
        rungs.append(replace(answer, achieved=achieved, claimed=max(answer.claimed, achieved)))
        if achieved <= target:
            vanishing = True
            break
        if len(rungs) > 2 and rungs[-3].achieved < achieved * (1 + _CONVERGED):
            settled = True
            break
    if not rungs:
        return None
    least = min(rung.achieved for rung in rungs)
    share = max(engine.tolerance, _CONVERGED)
    near = [rung for rung in rungs if rung.achieved <= least * (1 + share)]
    chosen = min(near, key=lambda rung: size(rung.F))
    grown = size(rungs[-1].F) / max(size(rungs[-3].F), 1e-300) if len(rungs) > 2 else math.inf
    return LadderAnswer(
        answer=replace(chosen, claimed=chosen.achieved, history=tuple(history)),
        attained=settled and grown < _GAIN_GROWTH,
        vanishing=vanishing,
    )
