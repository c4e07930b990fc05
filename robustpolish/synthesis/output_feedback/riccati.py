"""H-infinity output feedback by Riccati equations on a ladder of regularised plants.

A regularised plant has a solution of its two Riccati equations whatever the rank of D12 and D21
and whatever zeros lie on the axis. Its norm bounds the true one from above, and
falls to it as epsilon goes to zero. So epsilon descends from 0.1 in half decades until the norm of
the true loop, which alone is believed, is near the lower bound, or no longer improves.

Where only zeros on the axis are in the way, as for a servo with an integrator and weights on S
and K S, the axis is moved to the left instead, which costs next to nothing whatever the weights.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from robustpolish.base.budget import Budget, step_cost
from robustpolish.synthesis.engine import (
    COSTLY_STATES,
    EPSILONS,
    FALLING,
    SETTLED,
    SHIFTS,
    Candidate,
    Engine,
    Settings,
    Task,
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
from robustpolish.synthesis.state_feedback.riccati import lqg

# H2 output feedback by Riccati equations, on regularised plants where need be.


class Lqg(Engine):
    """One pair of Riccati equations on a regular plant.

    A singular one is regularised less and less, as for the H-infinity norm, until the norm of the
    true loop settles.
    """

    def search(self) -> None:
        """Minimise the H2 norm of the loop."""
        if self._solved(0.0):
            return
        quiet = 0
        norms: list[float] = []
        # Singular H2 problems, whose equations bear half a decade less regularisation.
        for epsilon in (*EPSILONS, 10.0**-9):
            if self.budget.over:
                break
            before = self.best
            if not self._solved(epsilon):
                continue
            norms.append(self.best)
            # A relative fall of the H2 norm that is none.
            quiet = quiet + 1 if self.best > before * (1 - 1e-6) else 0
            if quiet >= 2:
                return
        self.falling = len(norms) > 4 and norms[-1] < FALLING * norms[-5]

    def _solved(self, epsilon: float) -> bool:
        self.budget.spend(step_cost(self.problem.plant.nx))
        K = lqg(regularise(self.problem.plant, epsilon))
        candidate = None if K is None else self.checked(K, np.inf, f"riccati, {epsilon:.1e}")
        if candidate is not None:
            self.candidates.append(candidate)
            seen = {"achieved": candidate.achieved, "gain": candidate.gain}
            self.history.append({"epsilon": epsilon, **seen})
        return candidate is not None


class Regularisation(NamedTuple):
    """How a plant is changed so that its equations have a solution.

    ``epsilon`` is the price, noise and disturbance of :func:`regularise`, ``shift`` by how much the
    axis is moved to the left; see :func:`shifted`.
    """

    epsilon: float
    shift: float = 0.0

    def normalised(self, plant: PlantMatrices) -> NormalisedPlant:
        """Change a plant and bring it into the coordinates of the equations."""
        return normalise(shifted(regularise(plant, self.epsilon), self.shift))


_AXIS = tuple(Regularisation(0.0, shift) for shift in (0.0, *SHIFTS))
_LADDER = tuple(Regularisation(epsilon) for epsilon in EPSILONS)
# How far above the optimal gamma central controllers are made, the most wanted first; nearer than
# 5e-4 they break their promise, and hard plants (NN9, HE1) need 1.01 or 1.03.
_BACK_OFFS = (1.003, 1.0005, 1.01, 1.03)
# Further distances from the optimum, tried on rungs that came close.
_REFINEMENTS = (1.0005, 1.001, 1.006)
# Rungs without a fall after which a ladder without a lower bound to aim at ends.
_QUIET = 3


class RegularisedRiccati(Engine):
    """Two Riccati equations on plants regularised less and less."""

    def __init__(self, settings: Settings, problem: Task, budget: Budget) -> None:
        super().__init__(settings, problem, budget)
        self.plant, self.gamma = problem.plant, 1.0
        self.costly = self.plant.nx > COSTLY_STATES
        # Beyond so many states of a plant the first controller that keeps the tolerance ends the
        # search, and none at further distances from the optimum is tried: each takes as long as
        # all the rest of a rung.
        self.many = self.plant.nx > 100
        self.near = problem.goal if self.many else problem.near
        # A finer tolerance than the usual one asks for finer steps.
        self.fineness = min(1.0, problem.tolerance / 4e-3)
        self.settled = SETTLED * self.fineness
        self.rungs: list[Regularisation] = []  # of the entries of the history

    def search(self) -> None:
        """Descend until the norm is good enough, settles or cannot be computed any more."""
        if self.problem.asked and self._solve_requested_gamma():
            return
        regular = self._solve_regular()
        quiet, failures = 0, 0
        waiting: tuple[NormalisedPlant, GammaBracket, Regularisation] | None = None
        # A price and a noise on x cost much beside weights that put zeros on the axis.
        done = self.best <= self.near and (self.many or any(rung.shift for rung in self.rungs))
        for rung in () if done else _LADDER:
            if self.budget.over or failures == 2:
                break
            normal = rung.normalised(self.plant)
            before, best = self.gamma, self.best
            bracket = self._bracket(normal)
            if bracket is None:
                failures += 1
                continue
            self.gamma = bracket.upper
            self._note(rung, self.gamma)
            # Where a norm is costly, loops are not checked on the first rung, nor while gamma falls
            # by more than this from one to the next.
            first = len(self.history) == regular + 1
            if self.costly and (first or self.gamma < (1 - 0.03) * before):
                waiting = normal, bracket, rung
                continue
            waiting = None
            candidate = self._confirmed(normal, bracket, rung)
            if candidate is None:
                failures += 1
                continue
            failures = 0
            self._take(candidate)
            # Entries of a controller above it cannot be verified in double precision.
            if candidate.achieved <= self.near or candidate.gain > 1e10:
                break
            if candidate.achieved <= best * 1.1:
                quiet = quiet + 1 if candidate.achieved > best * (1 - self.settled) else 0
            if quiet >= _QUIET and self.problem.bound is None:
                break
        if waiting is not None:
            self.candidates += filter(None, [self._confirmed(*waiting)])
        # The last two decades of epsilon have lowered the norm for certain.
        norms = [note["achieved"] for note in self.history if note["achieved"] >= 0]
        falls = len(norms) > 4 and min(norms) < FALLING * min(norms[:-4])
        self.falling = not regular and self.best > self.problem.goal and falls
        if not self.many:
            self._refine()

    def _note(self, rung: Regularisation, gamma: float) -> None:
        """Begin an entry of the history."""
        note: dict[str, Any] = {"epsilon": rung.epsilon, "gamma": gamma}
        note |= {"achieved": np.nan, "gain": np.nan} | ({"shift": rung.shift} if rung.shift else {})
        self.history.append(note)
        self.rungs.append(rung)

    def _take(self, candidate: Candidate) -> None:
        """Keep a candidate, and tell it in the last entry of the history."""
        self.history[-1] |= {"achieved": candidate.achieved, "gain": candidate.gain}
        self.candidates.append(candidate)

    def _solve_requested_gamma(self) -> bool:
        """Make the central controller for the norm that was asked for; tell whether that worked.

        The gain grows down the ladder, so that the first rung that has one is the best.
        """
        for rung in (*_AXIS, *_LADDER) if has_full_rank(self.plant) else _LADDER:
            if self.budget.over:
                return False
            candidate = self._controller(rung.normalised(self.plant), self.problem.goal, rung)
            if candidate is not None and candidate.achieved <= self.problem.goal:
                self._note(rung, candidate.claimed)
                self._take(candidate)
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
        for rung in _AXIS:
            if self.budget.over:
                break
            normal, start = rung.normalised(self.plant), 1.0
            if rung.shift and bracket is not None:
                # How far the optimal gamma is expected to move with the axis; looked at first.
                start, near = bracket.upper * (1 + 0.02), 0.02
                bracket = search_gamma(normal.halves, start, near, self.budget, near)
            bracket = search_gamma(normal.halves, start, self.settled, self.budget, known=bracket)
            candidate = None if bracket is None else self._confirmed(normal, bracket, rung)
            if bracket is None or candidate is None:
                continue
            self._note(rung, bracket.upper)
            self._take(candidate)
            if candidate.achieved <= self.near or bound is None:
                break
        return len(self.rungs)

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
        for factor in _BACK_OFFS:
            usual = factor > 1 + self.problem.tolerance
            factor = 1 + (factor - 1) * (1.0 if usual else self.fineness)
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
        candidate = self.checked(K, gamma, f"riccati, epsilon {rung.epsilon:.1e}")
        return candidate if candidate is not None and candidate.keeps_claim else None

    def _refine(self) -> None:
        """Try other distances from the optimal gamma on the rungs that came close to the goal."""
        close = max(self.best, self.problem.goal) * 1.02
        notes = zip(self.history, self.rungs, strict=True)
        close_by = [(note, rung) for note, rung in notes if note["achieved"] <= close]
        # The gain grows down the ladder, so the first rungs are worth the most.
        for note, rung in close_by[: 2 if self.costly else None]:
            normal = rung.normalised(self.plant)
            for factor in _REFINEMENTS[1 if self.costly else 0 :]:
                if self.budget.over:
                    return
                gamma = note["gamma"] * (1 + (factor - 1) * self.fineness)
                self.candidates += filter(None, [self._controller(normal, gamma, rung)])
