"""State feedback under a bound on the largest singular value of the gain.

No convex condition is both necessary and sufficient for it. Priced designs that keep the bound
are the starts. From there inequalities with a condition on the gain that is exact at the last
Lyapunov matrix are solved again and again, each answer no worse than the one before; a descent on
the true norm, with the bound as a requirement, ends the search.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import linalg

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.long_calls import Budget
from robustpolish.synthesis.lmi.state.coordinates import Coordinates
from robustpolish.synthesis.lmi.state.program import Demand, SolvedProgram, StatePrograms
from robustpolish.synthesis.nonsmooth import (
    GainMeasure,
    H2Measure,
    HinfMeasure,
    MaskedGain,
    Problem,
    Requirement,
    minimax,
)
from robustpolish.synthesis.problem.full_state import (
    compressed,
    in_states,
    is_regular,
    state_gain_norm,
    with_noise,
    with_price,
)
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.riccati.equations import solve_lyapunov
from robustpolish.synthesis.riccati.state import RiccatiStateEngine
from robustpolish.synthesis.state_search.engine import StateEngine, StateGain
from robustpolish.synthesis.state_search.policy import POLICY


@dataclass(frozen=True, eq=False)
class GainBound:
    """sigma_max(left F right) <= bound, where left F right is the gain in the plant's units.

    Attributes
    ----------
    left, right : ndarray
    bound : float
    """

    left: Matrix
    right: Matrix
    bound: float

    def size(self, F: Matrix) -> float:
        """Return the largest singular value in the plant's units."""
        return float(np.linalg.norm(self.left @ F @ self.right, 2)) if F.size else 0.0

    def inside(self, F: Matrix) -> Matrix:
        """Return F, shrunk to the bound if it is larger."""
        size, limit = self.size(F), self.bound * (1 - POLICY.bound_margin)
        return F * (limit / size) if size > limit else F


def minimise_bounded(
    engine: StateEngine, plant: PlantMatrices, bound: GainBound, budget: Budget
) -> StateGain | None:
    """Minimise the norm over the gains within a bound.

    Parameters
    ----------
    engine : StateEngine
    plant : PlantMatrices
        Scaled.
    bound : GainBound
    budget : Budget

    Returns
    -------
    StateGain or None
        A local optimum, or the optimum without the bound if that is within it; None if no gain
        within the bound was found that stabilises.
    """
    if is_regular(plant):
        free = engine.search(plant, budget)
        if free is not None and bound.size(free.F) <= bound.bound:
            return free
    return _BoundedSearch(engine, plant, bound, budget).run()


class _BoundedSearch:
    """The search from several starts, and its history."""

    def __init__(
        self, engine: StateEngine, plant: PlantMatrices, bound: GainBound, budget: Budget
    ) -> None:
        self.engine, self.plant, self.bound, self.budget = engine, plant, bound, budget
        self.history: list[dict[str, Any]] = []

    def run(self) -> StateGain | None:
        """Search from the best starts, then from small ones, and descend from the best end."""
        starts = self.starts()
        best: Matrix | None = None
        value = math.inf
        for start in starts[: POLICY.bound_starts]:
            F = self.by_inequalities(start)
            achieved = self.norm(F)
            if achieved < value:
                best, value = F, achieved
        # Small gains that cancel a disturbance are found from small gains only.
        limit = POLICY.small_start * self.bound.bound
        small = [F for F in starts if 0 < self.bound.size(F) < limit]
        for start in small[: POLICY.bound_starts]:
            F = self.descended(start, balanced=False)
            achieved = self.norm(F)
            if achieved < value * (1 - POLICY.worthwhile):
                best, value = F, achieved
        if best is None or not math.isfinite(value):
            return None
        best = self.descended(best)
        value = self.norm(best)
        return StateGain(best, value, value, history=tuple(self.history))

    def norm(self, F: Matrix) -> float:
        """Return the norm that a gain achieves."""
        return state_gain_norm(self.plant, F, self.engine.norm)

    def starts(self) -> list[Matrix]:
        """Return stabilising gains within the bound, the best first.

        They come from Riccati equations whatever the method: they are quick, and only starts.
        """
        tolerance = max(self.engine.tolerance, POLICY.coarse)
        quick = RiccatiStateEngine(self.engine.norm, tolerance)
        idle = np.zeros((self.plant.nu, self.plant.nx))
        found: list[tuple[float, Matrix]] = [(self.norm(idle), idle)]
        for price in POLICY.starting_prices:
            if self.budget.over:
                break
            answer = quick.search(with_price(self.plant, price), self.budget)
            if answer is None:
                continue
            F, size = self.bound.inside(answer.F), self.bound.size(answer.F)
            achieved = self.norm(F)
            told = {"step": "price", "price": price, "achieved": achieved, "gain": size}
            self.history.append(told)
            found.append((achieved, F))
        ranked = sorted(found, key=lambda pair: pair[0])
        return [F for value, F in ranked if math.isfinite(value)]

    def by_inequalities(self, start: Matrix) -> Matrix:
        """Solve the bounded inequalities about the Lyapunov matrix of the last gain, repeatedly."""
        p = compressed(self.plant)
        programs = StatePrograms(p, self.engine, self.budget, self.history)
        held = (self.bound.left / self.bound.bound, self.bound.right)
        F, value = start, programs.judged(start)
        for _ in range(POLICY.bound_rounds):
            if self.budget.over or not value > 0:
                break
            coordinates = Coordinates.plain(p, value)
            for _ in range(2):
                about = Demand(noise=POLICY.bound_noise, fixed=F)
                solved = _solved_either(programs, coordinates, about, "Lyapunov matrix of a gain")
                if solved is None:
                    return F
                coordinates = replace(solved.next, unit=value)
            within = Demand(noise=POLICY.bound_noise, held=held)
            solved = _solved_either(programs, coordinates, within, "inequalities with the bound")
            if solved is None:
                break
            new = self.bound.inside(solved.gain.F)
            achieved = programs.judged(new)
            if not achieved < value:
                break
            gained = 1 - achieved / value
            F, value = new, achieved
            if gained < POLICY.gained:
                break
        return F

    def descended(self, start: Matrix, balanced: bool = True) -> Matrix:
        """Descend on the true norm, if asked in states in which the last loop is balanced."""
        p, bound = self.plant, self.bound
        F, value = start, self.norm(start)
        for _ in range(POLICY.descents):
            if self.budget.over:
                break
            T, V = _coordinates(p, F) if balanced else (np.eye(p.nx), np.eye(p.nu))
            q = in_states(p, T)
            loop = q.replace(B2=q.B2 @ V, D12=q.D12 @ V)
            measure = HinfMeasure(loop) if self.engine.norm == "hinf" else H2Measure(loop)
            back = np.linalg.inv(T)
            held = Requirement(GainMeasure(bound.left @ V, back @ bound.right), bound.bound)
            gains = MaskedGain(np.ones(F.shape, dtype=bool))
            theta = gains.coordinates(np.linalg.solve(V, F @ T))
            problem = Problem(gains, measure, (held,))
            descent = minimax(problem, theta, self.budget, POLICY.iterations)
            new = bound.inside(V @ gains.gain(descent.point) @ back)
            achieved = self.norm(new)
            ended = descent.reason
            told = {"step": "descent on the true norm", "achieved": achieved, "ended": ended}
            self.history.append(told)
            if not achieved < value:
                break
            gained = 1 - achieved / value
            F, value = new, achieved
            if gained < POLICY.gained:
                break
        return F


def _solved_either(
    programs: StatePrograms, coordinates: Coordinates, demand: Demand, step: str
) -> SolvedProgram | None:
    solved = programs.solve(coordinates, demand, step)
    if solved is None:
        plain = coordinates.without_congruence()
        solved = programs.solve(plain, demand, step, POLICY.eased_tolerance)
    return solved


def _coordinates(p: PlantMatrices, F: Matrix) -> tuple[Matrix, Matrix]:
    """Return states of equal variance under white noise, and controls of order one."""
    noisy = with_noise(p, POLICY.bound_noise)
    W, closed = noisy.B1 @ noisy.B1.T, p.A + p.B2 @ F
    X = linalg.solve_discrete_lyapunov(closed, W) if p.discrete else solve_lyapunov(closed.T, W)
    if X is None:
        return np.eye(p.nx), np.eye(p.nu)
    values, vectors = np.linalg.eigh((X + X.T) / 2)
    T = vectors * np.sqrt(np.maximum(values, values[-1] * 1e-14))
    size = np.linalg.norm(F @ T, axis=1)
    largest = float(size.max(initial=0.0)) or 1.0
    return T, np.diag(np.maximum(size, 1e-3 * largest))
