"""H-infinity output feedback by Riccati equations on a ladder of regularised plants.

A regularised plant has a solution of its two Riccati equations whatever the rank of D12 and D21
and whatever zeros lie on the axis. Its norm bounds the true one from above, and
falls to it as epsilon goes to zero. So epsilon descends from 0.1 in half decades until the norm of
the true loop, which alone is believed, is near the lower bound, or no longer improves.

Where only zeros on the axis are in the way, as for a servo with an integrator and weights on S
and K S, the axis is moved to the left instead, which costs next to nothing whatever the weights.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from robustpolish.base.budget import Budget, step_cost
from robustpolish.synthesis.engine import (
    POLICY,
    Candidate,
    Engine,
    EngineResult,
    Task,
    check_candidate,
)
from robustpolish.synthesis.problem.matrices import PlantMatrices, regularise, shifted
from robustpolish.synthesis.riccati.gamma import (
    GammaBracket,
    NormalisedPlant,
    central_controller,
    has_full_rank,
    normalise,
    search_gamma,
)
from robustpolish.synthesis.riccati.lqg import lqg

# H2 output feedback by Riccati equations, on regularised plants where need be.


class Lqg(Engine):
    """One pair of Riccati equations on a regular plant.

    A singular one is regularised less and less, as for the H-infinity norm, until the norm of the
    true loop settles.
    """

    def search(self, problem: Task, budget: Budget) -> EngineResult:
        """Minimise the H2 norm of the loop."""
        found = EngineResult("riccati", "scipy")
        if _try(problem, 0.0, found, budget):
            return found
        quiet = 0
        norms: list[float] = []
        # Rungs for singular H2 problems, whose equations bear half a decade less regularisation.
        for epsilon in tuple(10.0 ** (-k / 2) for k in range(2, 19)):
            if budget.over:
                break
            before = found.best
            if not _try(problem, epsilon, found, budget):
                continue
            norms.append(found.best)
            # A relative fall of the H2 norm that is none.
            quiet = quiet + 1 if found.best > before * (1 - 1e-6) else 0
            if quiet >= 2:
                return found
        found.falling = len(norms) > 4 and norms[-1] < POLICY.falling * norms[-5]
        return found


def _try(problem: Task, epsilon: float, found: EngineResult, budget: Budget) -> bool:
    budget.spend(step_cost(problem.plant.nx))
    K = lqg(regularise(problem.plant, epsilon))
    origin = f"riccati, {epsilon:.1e}"
    candidate = None if K is None else check_candidate(problem, K, np.inf, origin, budget)
    if candidate is None:
        return False
    found.candidates.append(candidate)
    note = {"epsilon": epsilon, "achieved": candidate.achieved, "gain": candidate.gain}
    found.history.append(note)
    return True


@dataclass(frozen=True)
class Regularisation:
    """How a plant is changed so that its equations have a solution.

    Attributes
    ----------
    epsilon : float
        Price, noise and disturbance of :func:`regularise`.
    shift : float
        By how much the axis is moved to the left; see :func:`shifted`.
    """

    epsilon: float
    shift: float = 0.0

    def normalised(self, plant: PlantMatrices) -> NormalisedPlant:
        """Change a plant and bring it into the coordinates of the equations."""
        return normalise(shifted(regularise(plant, self.epsilon), self.shift))

    def note(self, gamma: float) -> dict[str, Any]:
        """Begin an entry of the history."""
        entry = {"epsilon": self.epsilon, "gamma": gamma, "achieved": np.nan, "gain": np.nan}
        return {**entry, "shift": self.shift} if self.shift else entry


class RegularisedRiccati(Engine):
    """Two Riccati equations on plants regularised less and less."""

    def search(self, problem: Task, budget: Budget) -> EngineResult:
        """Descend the ladder; a regular plant is solved as it is as well."""
        return _RegularisationDescent(problem, budget).run()


class _RegularisationDescent:
    """One descent, and what it knows so far."""

    def __init__(self, problem: Task, budget: Budget) -> None:
        self.problem, self.budget = problem, budget
        self.plant = problem.plant
        self.costly = self.plant.nx > POLICY.costly_states
        self.found = EngineResult("riccati", "scipy")
        self.gamma = 1.0
        # Where every rung takes long, what keeps the tolerance is near enough.
        # Beyond so many states of a plant the first controller that keeps the tolerance ends the
        # search, and none at further distances from the optimum is tried: each takes as long as
        # all the rest of a rung.
        self.many = self.plant.nx > 100
        self.near = problem.goal if self.many else problem.near
        # A finer tolerance than the usual one asks for finer steps.
        fineness = min(1.0, problem.tolerance / 4e-3)
        self.settled = POLICY.settled * fineness
        self.back_offs = [
            1 + (f - 1) * (fineness if f <= 1 + problem.tolerance else 1.0)
            for f in POLICY.back_offs
        ]
        self.rungs: list[Regularisation] = []  # of the entries of the history
        self.refinements = [1 + (f - 1) * fineness for f in POLICY.refinements]

    def run(self) -> EngineResult:
        """Descend until the norm is good enough, settles or cannot be computed any more."""
        if self.problem.asked and self._solve_requested_gamma():
            return self.found
        found, regular = self.found, self._solve_regular()
        quiet, failures = 0, 0
        waiting: tuple[NormalisedPlant, GammaBracket, Regularisation] | None = None
        # A price and a noise on x cost much beside weights that put zeros on the axis.
        done = found.best <= self.near and (self.many or any(rung.shift for rung in self.rungs))
        for rung in () if done else (Regularisation(epsilon) for epsilon in POLICY.epsilons):
            if self.budget.over or failures == 2:
                break
            normal = rung.normalised(self.plant)
            before = self.gamma, found.best
            bracket = self._bracket(normal)
            if bracket is None:
                failures += 1
                continue
            self.gamma = bracket.upper
            note = self._noted(rung, self.gamma)
            # Where a norm is costly, loops are not checked while gamma falls fast.
            first = len(found.history) == regular + 1
            # Where checks are costly, none is made on rungs where gamma falls by more than this.
            if self.costly and (first or self.gamma < (1 - 0.03) * before[0]):
                waiting = normal, bracket, rung
                continue
            waiting = None
            candidate = self._confirmed(normal, bracket, rung)
            if candidate is None:
                failures += 1
                continue
            failures = 0
            self._take(candidate, note)
            # Entries of a controller above it cannot be verified in double precision.
            if candidate.achieved <= self.near or candidate.gain > 1e10:
                break
            if candidate.achieved <= before[1] * 1.1:
                quiet = quiet + 1 if candidate.achieved > before[1] * (1 - self.settled) else 0
            if quiet >= POLICY.quiet and self.problem.bound is None:
                break
        if waiting is not None:
            candidate = self._confirmed(*waiting)
            found.candidates += [] if candidate is None else [candidate]
        found.falling = not regular and found.best > self.problem.goal and self._is_falling()
        if not self.many:
            self._refine()
        return found

    def _noted(self, rung: Regularisation, gamma: float) -> dict[str, Any]:
        """Begin an entry of the history, and return it."""
        note = rung.note(gamma)
        self.found.history.append(note)
        self.rungs.append(rung)
        return note

    def _take(self, candidate: Candidate, note: dict[str, Any]) -> None:
        """Keep a candidate, and tell it in the history."""
        note["achieved"], note["gain"] = candidate.achieved, candidate.gain
        self.found.candidates.append(candidate)

    def _solve_requested_gamma(self) -> bool:
        """Make the central controller for the norm that was asked for; tell whether that worked.

        The gain grows down the ladder, so that the first rung that has one is the best.
        """
        ladder = [Regularisation(epsilon) for epsilon in POLICY.epsilons]
        if has_full_rank(self.plant):
            ladder = [Regularisation(0.0), *_SHIFTS, *ladder]
        for rung in ladder:
            if self.budget.over:
                return False
            normal = rung.normalised(self.plant)
            candidate = self._controller(normal, self.problem.goal, rung)
            if candidate is not None and candidate.achieved <= self.problem.goal:
                self._take(candidate, self._noted(rung, candidate.claimed))
                return True
        return False

    def _solve_regular(self) -> int:
        """Solve a plant whose D12 and D21 have full rank; return how many entries that made.

        As it is, or with the axis moved less and less where zeros lie on it.
        """
        if not has_full_rank(self.plant):
            return 0
        bound = self.problem.bound
        bracket = None if bound is None else bound.bracket
        for rung in (Regularisation(0.0), *_SHIFTS):
            if self.budget.over:
                break
            normal = rung.normalised(self.plant)
            bracket = self._regular_bracket(normal, bracket, moved=rung.shift > 0)
            candidate = None if bracket is None else self._confirmed(normal, bracket, rung)
            if bracket is None or candidate is None:
                continue
            self._take(candidate, self._noted(rung, bracket.upper))
            if candidate.achieved <= self.near or self.problem.bound is None:
                break
        return len(self.rungs)

    def _regular_bracket(
        self, normal: NormalisedPlant, known: GammaBracket | None, moved: bool
    ) -> GammaBracket | None:
        """Go on from what is known of this plant, or if its axis was moved, look near by first."""
        start = 1.0
        if moved and known is not None:
            # How far the optimal gamma is expected to move with the axis; looked at first.
            start, near = known.upper * (1 + 0.02), 0.02
            known = search_gamma(normal.halves, start, near, self.budget, near)
        return search_gamma(normal.halves, start, self.settled, self.budget, known=known)

    def _bracket(self, normal: NormalisedPlant) -> GammaBracket | None:
        """Find the optimal gamma of one rung: coarsely while it falls fast, then finely."""
        first = self.gamma == 1.0
        shortcut = 0.0 if first else self.settled
        rough = search_gamma(normal.halves, self.gamma, 0.02, self.budget, shortcut)
        if rough is None or rough.upper < 0.9 * self.gamma or first:
            return rough
        return search_gamma(normal.halves, rough.upper, self.settled, self.budget, known=rough)

    def _confirmed(
        self, normal: NormalisedPlant, bracket: GammaBracket, rung: Regularisation
    ) -> Candidate | None:
        """Make a controller a little above the optimal gamma that keeps its promise."""
        for factor in self.back_offs:
            candidate = self._controller(normal, bracket.upper * factor, rung)
            if candidate is not None:
                return candidate
            if self.budget.over:
                return None
        return None

    def _controller(
        self, normal: NormalisedPlant, gamma: float, rung: Regularisation
    ) -> Candidate | None:
        self.budget.spend(step_cost(self.plant.nx))
        solution = normal.halves.attempt(gamma)
        if solution.X is None or solution.Y is None or not solution.feasible:
            return None
        try:
            K = central_controller(normal, gamma, solution.X, solution.Y)
        except np.linalg.LinAlgError:
            return None
        K = K.shifted_back(rung.shift)
        origin = f"riccati, epsilon {rung.epsilon:.1e}"
        candidate = check_candidate(self.problem, K, gamma, origin, self.budget)
        return candidate if candidate is not None and candidate.keeps_claim else None

    def _is_falling(self) -> bool:
        """Tell whether the last two decades of epsilon have lowered the norm for certain."""
        norms = [note["achieved"] for note in self.found.history if note["achieved"] >= 0]
        return len(norms) > 4 and min(norms) < POLICY.falling * min(norms[:-4])

    def _refine(self) -> None:
        """Try other distances from the optimal gamma on the rungs that came close to the goal."""
        close = max(self.found.best, self.problem.goal) * 1.02
        notes = zip(self.found.history, self.rungs, strict=True)
        close_by = [(note, rung) for note, rung in notes if note["achieved"] <= close]
        # The gain grows down the ladder, so the first rungs are worth the most.
        for note, rung in close_by[: 2 if self.costly else None]:
            normal = rung.normalised(self.plant)
            for factor in self.refinements[1 if self.costly else 0 :]:
                if self.budget.over:
                    return
                candidate = self._controller(normal, note["gamma"] * factor, rung)
                self.found.candidates += [] if candidate is None else [candidate]


_SHIFTS = tuple(Regularisation(0.0, shift) for shift in POLICY.shifts)
