"""Problems in which control is free: a price on u and x shrinks until the norm stops falling."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from robustpolish.long_calls import Budget
from robustpolish.synthesis.problem.full_state import only_effort, state_gain_norm, with_price
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.riccati.state import lqr_gain
from robustpolish.synthesis.state_search.engine import StateEngine, StateGain
from robustpolish.synthesis.state_search.policy import POLICY


def almost_no_control(plant: PlantMatrices, norm: str) -> float:
    """Return the norm without control or, if that is unstable, with the least that stabilises."""
    idle = state_gain_norm(plant, np.zeros((plant.nu, plant.nx)), norm)
    if math.isfinite(idle):
        return idle
    least = lqr_gain(only_effort(plant, POLICY.stabilising))
    return state_gain_norm(plant, least, norm)


def solve_singular(
    engine: StateEngine,
    plant: PlantMatrices,
    target: float,
    size: Callable[[np.ndarray], float],
    budget: Budget,
) -> StateGain | None:
    """Lower the price until the norm settles or falls below `target`.

    The first descent gives a tenth of the norm away on every rung, which keeps gains small;
    it decides where the norm falls without limit. Where it does not, a second
    descent looks for the infimum to the tolerance.

    Parameters
    ----------
    engine : StateEngine
    plant : PlantMatrices
        Scaled; D12 may lack rank.
    target : float
        A norm small enough to stop at.
    size : callable
        Gain in the plant's units.
    budget : Budget

    Returns
    -------
    StateGain or None
        The smallest gain within the tolerance of the best norm seen; None if nothing
        stabilises. "infimum_not_attained" if norm or gain still moved; "suboptimal" if both
        settled, or if the budget was over before that could be seen.
    """
    found, fell = _Descent(engine.coarser(POLICY.coarse), plant, target, size, budget).run()
    if found is None or fell or engine.norm == "h2":
        return found
    return _Descent(engine, plant, target, size, budget).run()[0] or found


@dataclass(frozen=True, eq=False)
class _Descent:
    """One descent of the price; every rung is a design with that price."""

    engine: StateEngine
    plant: PlantMatrices
    target: float
    size: Callable[[np.ndarray], float]
    budget: Budget
    history: list[dict[str, Any]] = field(default_factory=list)

    def run(self) -> tuple[StateGain | None, bool]:
        """Return the rung that was chosen, and whether the norm still fell at the target."""
        rungs: list[StateGain] = []
        settled = False
        for price in POLICY.prices:
            if self.budget.over:
                break
            rung = self.rung(price)
            if rung is None or not math.isfinite(rung.achieved):
                continue
            rungs.append(rung)
            if rung.achieved <= self.target:
                return self.told(self.landed(rung, price), False), True
            low = price <= POLICY.low_price and len(rungs) > 1
            if low and self.at_rest(rungs[-2], rungs[-1]):
                settled = True
                break
        if not rungs:
            return None, False
        least = min(rung.achieved for rung in rungs)
        share = max(self.engine.tolerance, POLICY.converged)
        near = [rung for rung in rungs if rung.achieved <= least * (1 + share)]
        smallest = min(near, key=lambda rung: self.size(rung.F))
        return self.told(smallest, settled or self.budget.over), False

    def rung(self, price: float) -> StateGain | None:
        """Design with a price; the norm is the one without."""
        found = self.engine.search(with_price(self.plant, price), self.budget)
        if found is None:
            return None
        achieved = state_gain_norm(self.plant, found.F, self.engine.norm)
        told = {"step": "price", "price": price, "achieved": achieved, "gain": self.size(found.F)}
        self.history.append(told)
        return replace(found, achieved=achieved, claimed=achieved)

    def landed(self, rung: StateGain, price: float) -> StateGain:
        """Raise the price again as far as the norm stays below the target: gains shrink."""
        low, high = math.log(price), math.log(price * POLICY.price_step)
        if price == POLICY.prices[0]:
            high += 3 * math.log(POLICY.price_step)
        for _ in range(POLICY.landings):
            if self.budget.over:
                break
            middle = (low + high) / 2
            other = self.rung(math.exp(middle))
            if other is not None and other.achieved <= self.target:
                rung, low = other, middle
            else:
                high = middle
        return rung

    def at_rest(self, before: StateGain, after: StateGain) -> bool:
        """Return whether neither norm nor gain still moved."""
        same_norm = before.achieved < after.achieved * (1 + POLICY.converged)
        return same_norm and self.size(after.F) < POLICY.gain_growth * self.size(before.F)

    def told(self, rung: StateGain, settled: bool) -> StateGain:
        """Return a rung with the history of all and its status."""
        status = "suboptimal" if settled else "infimum_not_attained"
        return replace(rung, status=status, history=tuple(self.history))
