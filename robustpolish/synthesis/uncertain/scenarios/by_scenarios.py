"""Where searches over scenarios start, and how short their controllers may be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.arrays import AnyVector as Vector
from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.implementation.reduction.candidates import Reducer
from robustpolish.long_calls import Budget
from robustpolish.models import GeneralizedPlant
from robustpolish.robust.performance import WorstCaseGain
from robustpolish.synthesis.methods.output_feedback import output_feedback
from robustpolish.synthesis.problem.decoupling import undivided
from robustpolish.synthesis.structured_search.static_structure import (
    StaticStructure,
    scaled_matrix,
)
from robustpolish.synthesis.structured_search.structure import PartProblem
from robustpolish.synthesis.uncertain.modal_gain import ModalGain
from robustpolish.synthesis.uncertain.problem import unstacked
from robustpolish.synthesis.uncertain.scenarios.machines import Machines
from robustpolish.synthesis.uncertain.scenarios.search import (
    POLICY,
    Proven,
    ScenarioSearch,
    Settled,
)

# A controller is shortened as long as its level rises by less than this share, as in D-K.
_SHORTENED = 0.02
# A worst gain so far above what no controller beats, relative, cannot be improved.
_NEAR = 0.01
# Machines of the set whose own smallest gain is asked for, the worst ones first.
_ASKED = 2
# The share of its usual work that a nominal search for fixed order gets.
_EFFORT = 0.1
# The safety net of a search for a single machine, in seconds.
_SECONDS = 300.0
# What it gets when that is nearly reached: no search ends at once.
_LEAST = 0.01


@dataclass(frozen=True, eq=False)
class ByScenarios:
    """The best proven controller of a search over scenarios.

    Attributes
    ----------
    controller : control.StateSpace
    worst : WorstCaseGain
        Proven.
    lower_bound : float
        What no controller beats, not even one made for a single machine within the bounds; 0
        if it was not asked for.
    """

    controller: control.StateSpace
    worst: WorstCaseGain
    lower_bound: float = 0.0

    @property
    def best_possible(self) -> bool:
        """Whether next to nothing is left to gain."""
        return self.worst.upper <= self.lower_bound * (1 + _NEAR)


def with_structure(
    machines: Machines, order: int, mask: NDArray[np.bool_], budget: Budget
) -> tuple[ByScenarios | None, list[dict[str, Any]]]:
    """Design a controller with free entries where a mask is true.

    Raises
    ------
    InfeasibleError
        If no gain of the pattern moves an unstable mode of the nominal plant; it is named.
    """
    part = _part(machines, order, mask)
    if part is None:
        return None, []
    search = ScenarioSearch(machines, part.scaled, budget)
    starts = part.proposals(budget.share(0.5), np.random.default_rng(0))
    found = search.searched(part, starts, POLICY.first)
    best = None if found is None else search.proven(found)
    if best is None:
        return None, search.history
    # Then once more from other starts, on all machines that were worst for the first ones.
    others = part.proposals(budget.share(0.5), np.random.default_rng(1))
    enough = best.worst.lower * (1 - POLICY.agrees)
    again = search.searched(part, others, POLICY.again, enough)
    if again is not None:
        best = _better(best, search.proven(again))
    return ByScenarios(best.controller, best.worst), search.history


class FreeSearch:
    """The search for a controller without a pattern, of at most some order.

    Parameters
    ----------
    machines : Machines
    order : int or None
        Most states; None for as few as cost next to nothing.
    budget : Budget
    """

    def __init__(self, machines: Machines, order: int | None, budget: Budget) -> None:
        self.machines, self.order, self.budget = machines, order, budget
        self.search: ScenarioSearch | None = None
        self._bounds: dict[int, float] = {}

    @property
    def history(self) -> list[dict[str, Any]]:
        """What was done."""
        return [] if self.search is None else self.search.history

    def from_nominal(self) -> ByScenarios | None:
        """Return the best controller of a search from the design for the nominal machine."""
        try:
            design = output_feedback(
                self.machines.nominal,
                order=self.order,
                effort=1.0 if self.order is None else _EFFORT,
                time_limit=_seconds(self.budget),
            )
        except (InfeasibleError, SolverError):
            return None
        return self.from_controller(design.controller)

    def from_controller(self, controller: control.StateSpace) -> ByScenarios | None:
        """Return the best controller of a search from a given one."""
        part = self._part(controller.nstates)
        if part is None:
            return None
        self.search = self.search or ScenarioSearch(self.machines, part.scaled, self.budget)
        found = self.search.settled(part, _point(part, controller), thorough=False)
        if found is None:
            return None
        bound = self._lower_bound(found)
        if found.gain > bound * (1 + POLICY.agrees):
            found = self.search.settled(part, found.theta) or found
            bound = max(bound, self._lower_bound(found))
        found = self._shorter(found, bound)
        proven = self.search.proven(found)
        return None if proven is None else ByScenarios(proven.controller, proven.worst, bound)

    def _part(self, order: int) -> PartProblem | None:
        plant = self.machines.nominal
        return _part(self.machines, order, np.ones((order + plant.nu, order + plant.ny), bool))

    def _shorter(self, found: Settled, bound: float) -> Settled:
        """Return the controller of fewest states whose level is next to that of a long one.

        Near a bound that no controller beats short descents will do.
        """
        if self.order is not None or not found.part.order or self.search is None:
            return found
        full = found.controller
        try:
            reducer = Reducer(self.machines.nominal, full)
        except (np.linalg.LinAlgError, ValueError):
            return found
        for order in range(1, found.part.order):
            part = self._part(order)
            if part is None or self.budget.over:
                break
            points = [_point(part, c.controller) for c in reducer.of_order(order)]
            first = self._nearest(part, [p for p in points if len(p) == part.parametrisation.size])
            short = None if first is None else self.search.settled(part, first, thorough=False)
            enough = found.level * (1 + _SHORTENED)
            if short is None or short.level > 2 * enough:
                continue
            goal = found.level / found.gain * bound * (1 + POLICY.agrees)
            short = self.search.settled(part, short.theta, goal=goal)
            if short is not None and short.level <= enough:
                return short
        return found

    def _nearest(self, part: PartProblem, points: list[Vector]) -> Vector | None:
        """Return the point whose worst loop of the set is best."""
        assert self.search is not None
        descent, gain = self.search.descent(part), part.parametrisation.gain
        judged = [
            (max(descent.badness(gain(p), m, self.budget) for _, m in self.search.known), i)
            for i, p in enumerate(points)
        ]
        return points[min(judged)[1]] if judged else None

    def _lower_bound(self, found: Settled) -> float:
        """Return the largest of the smallest gains that single machines of the set can have."""
        assert self.search is not None
        bounds = [0.0]
        for place, (values, _) in self.search.worst_known(found)[:_ASKED]:
            if place not in self._bounds:
                self._bounds[place] = _smallest_gain(self.machines.at(values), self.budget)
            bounds.append(self._bounds[place])
        return max(bounds)


def _seconds(budget: Budget) -> float:
    """Return what a search of a single machine gets of the safety net."""
    return min(max(budget.seconds_left, _LEAST), _SECONDS)


def _smallest_gain(plant: GeneralizedPlant | None, budget: Budget) -> float:
    """Return a gain that no controller of a single machine beats; 0 if none is known."""
    try:
        design = plant and output_feedback(plant, time_limit=_seconds(budget))
    except (InfeasibleError, SolverError):
        return 0.0
    return (design and design.lower_bound) or 0.0


def _part(machines: Machines, order: int, mask: NDArray[np.bool_]) -> PartProblem | None:
    return StaticStructure("hinf", order, mask).problem(undivided(machines.nominal))


def _point(part: PartProblem, controller: control.StateSpace) -> Vector:
    """Return the free numbers of a controller, whose modes get even units."""
    K = unstacked(scaled_matrix(controller, part.scaled), controller.nstates)
    form, theta = ModalGain.of(K)
    return form.gain(theta)[np.ones(form.shape, bool)]


def _better(one: Proven, other: Proven | None) -> Proven:
    return one if other is None or one.worst.upper <= other.worst.upper else other
