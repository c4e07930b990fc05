"""H-infinity output feedback by Riccati equations on a ladder of regularised plants.

A regularised plant has a solution of its two Riccati equations whatever the rank of D12 and D21
and whatever zeros lie on the axis. Its norm bounds the true one from above, and
falls to it as epsilon goes to zero. So epsilon descends from 0.1 in half decades until the norm of
the true loop, which alone is believed, is near the lower bound, or no longer improves.
"""

from __future__ import annotations

import numpy as np

from robustpolish.long_calls import Budget, step_cost
from robustpolish.synthesis.output_search.engine import (
    Candidate,
    Engine,
    Found,
    Task,
    examine,
)
from robustpolish.synthesis.output_search.policy import POLICY
from robustpolish.synthesis.problem.matrices import regularise
from robustpolish.synthesis.riccati.infimum import GammaBracket, search_gamma
from robustpolish.synthesis.riccati.two_riccati import (
    NormalisedPlant,
    central_controller,
    has_full_rank,
    normalise,
)


class RiccatiLadder(Engine):
    """Two Riccati equations on plants regularised less and less."""

    def search(self, problem: Task, budget: Budget) -> Found:
        """Descend the ladder; a regular plant is solved as it is as well."""
        return _Descent(problem, budget).run()


class _Descent:
    """One descent, and what it knows so far."""

    def __init__(self, problem: Task, budget: Budget) -> None:
        self.problem, self.budget = problem, budget
        self.plant = problem.plant
        self.costly = self.plant.nx > POLICY.costly_states
        self.found = Found("riccati", "scipy")
        self.gamma = 1.0
        # A finer tolerance than the usual one asks for finer steps.
        fineness = min(1.0, problem.tolerance / 4e-3)
        self.settled = POLICY.settled * fineness
        self.back_offs = [
            1 + (f - 1) * (fineness if f <= 1 + problem.tolerance else 1.0)
            for f in POLICY.back_offs
        ]
        self.refinements = [1 + (f - 1) * fineness for f in POLICY.refinements]

    def run(self) -> Found:
        """Descend until the norm is good enough, settles or cannot be computed any more."""
        found, regular = self.found, self._solve_regular()
        quiet, failures = 0, 0
        waiting: tuple[NormalisedPlant, GammaBracket, float] | None = None
        for epsilon in POLICY.epsilons:
            if self.budget.over or failures == 2:
                break
            normal = normalise(regularise(self.plant, epsilon))
            before = self.gamma, found.best
            bracket = self._bracket(normal)
            if bracket is None:
                failures += 1
                continue
            self.gamma = bracket.upper
            note = {"epsilon": epsilon, "gamma": self.gamma, "achieved": np.nan, "gain": np.nan}
            found.history.append(note)
            # Where a norm is costly, loops are not checked while gamma falls fast.
            first = len(found.history) == regular + 1
            if self.costly and (first or self.gamma < (1 - POLICY.quick_drop) * before[0]):
                waiting = normal, bracket, epsilon
                continue
            waiting = None
            candidate = self._confirmed(normal, bracket, epsilon)
            if candidate is None:
                failures += 1
                continue
            failures = 0
            found.candidates.append(candidate)
            note["achieved"], note["gain"] = candidate.achieved, candidate.gain
            if candidate.achieved <= self.problem.near or candidate.gain > POLICY.largest_gain:
                break
            if candidate.achieved <= before[1] * 1.1:
                quiet = quiet + 1 if candidate.achieved > before[1] * (1 - self.settled) else 0
            if quiet >= POLICY.quiet and self.problem.bound is None:
                break
        if waiting is not None:
            candidate = self._confirmed(*waiting)
            found.candidates += [] if candidate is None else [candidate]
        found.falling = not regular and found.best > self.problem.goal and self._is_falling()
        self._refine()
        return found

    def _solve_regular(self) -> bool:
        """Solve a plant as it is, if D12 and D21 have full rank; tell whether that worked."""
        if not has_full_rank(self.plant):
            return False
        normal = normalise(self.plant)
        bracket = search_gamma(normal.halves, 1.0, self.settled, self.budget)
        candidate = None if bracket is None else self._confirmed(normal, bracket, 0.0)
        if bracket is None or candidate is None:
            return False
        note = {"epsilon": 0.0, "gamma": bracket.upper}
        self.found.history.append(note)
        note["achieved"], note["gain"] = candidate.achieved, candidate.gain
        self.found.candidates.append(candidate)
        return True

    def _bracket(self, normal: NormalisedPlant) -> GammaBracket | None:
        """Find the optimal gamma of one rung: coarsely while it falls fast, then finely."""
        first = self.gamma == 1.0
        shortcut = 0.0 if first else self.settled
        rough = search_gamma(normal.halves, self.gamma, 0.02, self.budget, shortcut)
        if rough is None or rough.upper < 0.9 * self.gamma or first:
            return rough
        return search_gamma(normal.halves, rough.upper, self.settled, self.budget, known=rough)

    def _confirmed(
        self, normal: NormalisedPlant, bracket: GammaBracket, epsilon: float
    ) -> Candidate | None:
        """Make a controller a little above the optimal gamma that keeps its promise."""
        for factor in self.back_offs:
            candidate = self._controller(normal, bracket.upper * factor, epsilon)
            if candidate is not None:
                return candidate
            if self.budget.over:
                return None
        return None

    def _controller(
        self, normal: NormalisedPlant, gamma: float, epsilon: float
    ) -> Candidate | None:
        self.budget.spend(step_cost(self.plant.nx))
        solution = normal.halves.attempt(gamma)
        if solution.X is None or solution.Y is None or not solution.feasible:
            return None
        try:
            K = central_controller(normal, gamma, solution.X, solution.Y)
        except np.linalg.LinAlgError:
            return None
        origin = f"riccati, epsilon {epsilon:.1e}"
        candidate = examine(self.problem, K, gamma, origin, self.budget)
        return candidate if candidate is not None and candidate.honest else None

    def _is_falling(self) -> bool:
        """Tell whether the last two decades of epsilon have lowered the norm for certain."""
        norms = [note["achieved"] for note in self.found.history if note["achieved"] >= 0]
        return len(norms) > 4 and min(norms) < POLICY.falling * min(norms[:-4])

    def _refine(self) -> None:
        """Try other distances from the optimal gamma on the rungs that came close to the goal."""
        close = max(self.found.best, self.problem.goal) * 1.02
        notes = [note for note in self.found.history if note["achieved"] <= close]
        # The gain grows down the ladder, so the first rungs are worth the most.
        for note in notes[: 2 if self.costly else None]:
            normal = normalise(regularise(self.plant, note["epsilon"]))
            for factor in self.refinements[1 if self.costly else 0 :]:
                if self.budget.over:
                    return
                candidate = self._controller(normal, note["gamma"] * factor, note["epsilon"])
                self.found.candidates += [] if candidate is None else [candidate]
