"""A norm that will do: the smallest gain that keeps it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.long_calls import Budget
from robustpolish.synthesis.nonsmooth import (
    GainMeasure,
    H2Measure,
    HinfMeasure,
    MaskedGain,
    Problem,
    Requirement,
    minimax,
)
from robustpolish.synthesis.problem.full_state import is_regular, state_gain_norm
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.riccati.state import game_gain
from robustpolish.synthesis.state_search.engine import StateEngine, StateGain
from robustpolish.synthesis.state_search.policy import POLICY
from robustpolish.synthesis.state_search.singular_problem import solve_singular


@dataclass(frozen=True, eq=False)
class SmallestGain:
    """The search for the smallest gain whose norm stays below a target.

    No control at all is tried, then the central gain of the target and the design with the highest
    price on u that keeps it; from the smallest of these the largest singular value is lowered
    further, the norm being held. That is a local optimum: a smaller gain is not ruled out.

    Attributes
    ----------
    engine : StateEngine
    plant : PlantMatrices
        Scaled.
    left, right : ndarray
        left F right is a gain in the plant's units.
    budget : Budget
    """

    engine: StateEngine
    plant: PlantMatrices
    left: Matrix
    right: Matrix
    budget: Budget

    def size(self, F: Matrix) -> float:
        """Return the largest singular value of a gain in the plant's units."""
        return float(np.linalg.norm(self.left @ F @ self.right, 2)) if F.size else 0.0

    def within(self, target: float, found: StateGain) -> StateGain:
        """Give what lies between the norm of a gain and a target away for a smaller gain.

        Parameters
        ----------
        target : float
            A norm that will do.
        found : StateGain
            A gain that keeps it; it is returned if no other is smaller.

        Returns
        -------
        StateGain
        """
        kept = [g for g in (found, *self._others(target)) if g.achieved <= target]
        smallest = min(kept, key=lambda g: self.size(g.F))
        history = found.history + smallest.history if smallest is not found else found.history
        smallest = replace(smallest, status="suboptimal", history=history)
        # A descent leaves poles where they need not be in a region, and a norm that is not zero.
        if not (smallest.F.any() and target > 0) or self.engine.regions or self.budget.over:
            return smallest
        return self._lowered(target, smallest)

    def _others(self, target: float) -> Iterator[StateGain]:
        idle = self._kept(np.zeros((self.plant.nu, self.plant.nx)), target, "no control")
        if idle is not None:
            yield idle
            return
        if self.engine.norm == "hinf" and is_regular(self.plant):
            central = self._kept(game_gain(self.plant, target), target, "central gain")
            if central is not None:
                yield central
        priced = solve_singular(self.engine, self.plant, target, self.size, self.budget)
        if priced is not None:
            yield priced

    def _kept(self, F: Matrix | None, target: float, step: str) -> StateGain | None:
        """Return a gain that no region asks for more, if it keeps the target."""
        achieved = state_gain_norm(self.plant, F, self.engine.norm)
        if F is None or self.engine.regions or achieved > target:
            return None
        return StateGain(F, target, achieved, history=({"step": step, "achieved": achieved},))

    def _lowered(self, target: float, start: StateGain) -> StateGain:
        """Descend on the gain, with the norm as a requirement."""
        p = self.plant
        norm = HinfMeasure(p) if self.engine.norm == "hinf" else H2Measure(p)
        gains = MaskedGain(np.ones(start.F.shape, dtype=bool))
        measure = GainMeasure(self.left, self.right)
        problem = Problem(gains, measure, (Requirement(norm, target * (1 - POLICY.bound_margin)),))
        descent = minimax(problem, gains.coordinates(start.F), self.budget, POLICY.iterations)
        F = gains.gain(descent.point)
        achieved = state_gain_norm(p, F, self.engine.norm)
        if achieved > target or self.size(F) >= self.size(start.F):
            return start
        told = {"step": "descent on the gain", "achieved": achieved, "ended": descent.reason}
        return replace(
            start, F=F, claimed=target, achieved=achieved, history=(*start.history, told)
        )
