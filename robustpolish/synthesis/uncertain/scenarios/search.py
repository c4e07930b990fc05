"""The search over scenarios: descend on a set of machines, find a worse one, add it, prove."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import control
import numpy as np

from robustpolish.arrays import AnyVector as Vector
from robustpolish.long_calls import Budget, step_cost
from robustpolish.robust.performance import WorstCaseGain, worst_case_gain
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.scaling import ScaledPlant
from robustpolish.synthesis.structured_search.policy import Effort
from robustpolish.synthesis.structured_search.structure import PartProblem
from robustpolish.synthesis.uncertain.scenarios.descent import Descent
from robustpolish.synthesis.uncertain.scenarios.machines import Machines, Values

_FIRST = Effort(descents=16, fewest=4, patience=6)
_AGAIN = Effort(descents=4, fewest=2, patience=2)


@dataclass(frozen=True)
class ScenarioPolicy:
    """How far a search goes.

    Attributes
    ----------
    machines : int
        Most of them in a set.
    proofs : int
        Proofs at most: each takes as long as many descents.
    worse : float
        A machine joins the set if its norm is above that of the set by this share.
    agrees : float
        A proof so far above the set, relative, ends the search: intervals need 0.2 % alone.
    several : float
        Share of the work that is left for descents from several starts.
    first, again : Effort
        Descents for the first set where the structure is prescribed, and for the last one.
    """

    machines: int = 24
    proofs: int = 8
    worse: float = 1e-3
    agrees: float = 0.005
    several: float = 0.4
    first: Effort = _FIRST
    again: Effort = _AGAIN


POLICY = ScenarioPolicy()


@dataclass(frozen=True, eq=False)
class Settled:
    """A controller with which no corner is worse than the set.

    Attributes
    ----------
    part : PartProblem
    theta : ndarray
        Its free numbers.
    level : float
        The largest norm over the set, in scaled units.
    """

    part: PartProblem
    theta: Vector
    level: float

    @property
    def controller(self) -> control.StateSpace:
        """The controller in the plant's units."""
        return self.part.controller(self.part.parametrisation.gain(self.theta))

    @property
    def gain(self) -> float:
        """The largest norm over the set, in the plant's units."""
        return self.part.scaled.norm(self.level)


@dataclass(frozen=True, eq=False)
class Proven:
    """A controller with the largest gain of all machines.

    Attributes
    ----------
    controller : control.StateSpace
    worst : WorstCaseGain
        Proven.
    """

    controller: control.StateSpace
    worst: WorstCaseGain


class ScenarioSearch:
    """One search; its set of machines grows and serves every controller that is tried.

    Parameters
    ----------
    machines : Machines
    scaled : ScaledPlant
        The nominal plant, whose units all machines are in.
    budget : Budget
    """

    def __init__(self, machines: Machines, scaled: ScaledPlant, budget: Budget) -> None:
        self.machines, self.scaled, self.budget = machines, scaled, budget
        self.history: list[dict[str, Any]] = []
        corners = [(values, self._matrices(values)) for values in machines.corners()]
        self._corners = [(v, m) for v, m in corners if m is not None]
        self.known: list[tuple[Values, PlantMatrices]] = []
        self._add({})

    def descent(self, part: PartProblem) -> Descent:
        """Return the descent over the set of now."""
        return Descent(part, tuple(m for _, m in self.known))

    def settled(
        self, part: PartProblem, theta: Vector, thorough: bool = True, goal: float = 0.0
    ) -> Settled | None:
        """Descend from a point until no corner is worse.

        Parameters
        ----------
        part : PartProblem
        theta : ndarray
        thorough : bool, optional
            Whether long descents follow the short ones with which the set grows.
        goal : float, optional
            A level for which short ones will do.

        Returns
        -------
        Settled or None
            None if a loop stays unstable.
        """
        before = 0.0
        while True:
            theta, level = self.descent(part).lower(theta, self.budget, thorough=False)
            if not np.isfinite(level):
                return None
            if self.budget.over:
                break
            if self._add_corner(part, theta, level):
                continue
            if not thorough or level <= max(goal, before * (1 + POLICY.worse)):
                break
            theta, before = self.descent(part).lower(theta, self.budget, thorough=True)
            level = before
            self.tell("descent", Settled(part, theta, level))
            if self.budget.over or not self._add_corner(part, theta, level):
                break
        return Settled(part, theta, level)

    def searched(
        self,
        part: PartProblem,
        starts: Iterable[Vector],
        effort: Effort,
        below: float = np.inf,
    ) -> Settled | None:
        """Descend from several points, and go on from the best one until no corner is worse.

        Where that one cannot be made stable on all machines, others are tried on the larger set;
        `starts` may be without an end. None if no level comes below one in the plant's units.
        """
        source = iter(starts)
        own = self.budget.share(POLICY.several)
        found = self.descent(part).search(source, effort, own)
        while found is not None and not self.budget.over:
            if part.scaled.norm(found[1]) >= below:
                return None
            if not self._add_corner(part, *found):
                break
            descent = self.descent(part)
            theta, level = descent.lower(found[0], self.budget, thorough=False)
            stable = bool(np.isfinite(level))
            found = (theta, level) if stable else descent.search(source, effort, own)
        if found is None:
            return None
        best = Settled(part, *found)
        self.tell("descents", best)
        return self.settled(part, best.theta) or best

    def proven(self, found: Settled) -> Proven | None:
        """Prove a controller; where a proof finds a worse machine, add it and descend again."""
        best: Proven | None = None
        for _ in range(POLICY.proofs):
            controller = found.controller
            worst = worst_case_gain(self.machines.system.lft(controller))
            self.budget.spend(100 * step_cost(len(controller.A) + self.machines.nominal.nx))
            self.tell("proof", found, worst.upper)
            if worst.proven and (best is None or worst.upper < best.worst.upper):
                best = Proven(controller, worst)
            enough = worst.upper <= found.gain * (1 + POLICY.agrees)
            if enough or self.budget.over or not self._add_witness(worst, found):
                break
            again = self.settled(found.part, found.theta)
            if again is None:
                break
            found = again
        return best

    def tell(self, what: str, found: Settled, gain: float | None = None) -> None:
        """Write a step into the history."""
        self.history.append(
            {
                "step": f"scenarios: {what}",
                "states": found.part.order,
                "machines": len(self.known),
                "gain": found.gain if gain is None else gain,
                "work": self.budget.spent,
            }
        )

    def worst_known(self, found: Settled) -> list[tuple[int, tuple[Values, PlantMatrices]]]:
        """Return the machines of the set with their places in it, the worst one first."""
        K, descent = found.part.parametrisation.gain(found.theta), self.descent(found.part)
        judged = [(descent.badness(K, m, self.budget), -i) for i, (_, m) in enumerate(self.known)]
        return [(-i, self.known[-i]) for _, i in sorted(judged, reverse=True)]

    def _add_corner(self, part: PartProblem, theta: Vector, level: float) -> bool:
        """Add the worst corner, if it is worse than the set."""
        if not self._corners or len(self.known) >= POLICY.machines:
            return False
        K, descent = part.parametrisation.gain(theta), self.descent(part)
        judged = [descent.badness(K, matrices, self.budget) for _, matrices in self._corners]
        worst = max(range(len(judged)), key=lambda i: (judged[i], -i))
        unstable, norm = judged[worst]
        worse = unstable or norm > level * (1 + POLICY.worse)
        return worse and self._add(self._corners[worst][0])

    def _add_witness(self, worst: WorstCaseGain, found: Settled) -> bool:
        """Add the machine at a witness: of unstable ones the farthest one that is unstable, too."""
        if not worst.witness or len(self.known) >= POLICY.machines:
            return False
        omega = worst.critical_frequency
        if np.isfinite(worst.lower):
            return self._add(worst.witness, omega)
        far = self.machines.outward(worst.witness)
        matrices = self._matrices(far, omega)
        K = found.part.parametrisation.gain(found.theta)
        worse = matrices is not None and self.descent(found.part).badness(
            K, matrices, self.budget
        )[0]  # fmt: skip
        return self._add(far if worse else worst.witness, omega)

    def _add(self, values: Values, omega: float = np.nan) -> bool:
        """Add a machine; False if it is there already, or not well posed."""
        matrices = self._matrices(values, omega)
        if matrices is None:
            return False
        if any(matrices.fingerprint == known.fingerprint for _, known in self.known):
            return False
        self.known.append((values, matrices))
        return True

    def _matrices(self, values: Values, omega: float = np.nan) -> PlantMatrices | None:
        plant = self.machines.at(values, omega)
        return None if plant is None else self.scaled.in_units(PlantMatrices.of(plant))
