"""Scenario-based design: structured descents on a growing set of worst-case samples, and proofs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.base.arrays import AnyVector, Vector
from robustpolish.base.budget import Budget, step_cost
from robustpolish.errors import InvalidInputError
from robustpolish.implementation.reduction import Reducer
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plants.uncertain.lft import RealElement
from robustpolish.plants.uncertain.system import UncertainSystem
from robustpolish.robust import questions
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.preflight import ScaledPlant, scale_plant, whole_plant
from robustpolish.synthesis.structured.search import (
    CEILINGS,
    MultistartSearch,
    PartProblem,
    SearchEffort,
)
from robustpolish.synthesis.structured.structures import StaticStructure
from robustpolish.synthesis.uncertain.scaled_gain import ModalGain
from robustpolish.synthesis.uncertain.search import AGREES, SHORTENED, design_one

# Samples of an uncertain plant: at given values, at the corners, and farther out.

Values = Mapping[str, Any]

# Real numbers of which all corners are looked at, and how many are drawn of more.
_NUMBERS = 7
_DRAWN = 2**_NUMBERS


@dataclass(frozen=True, eq=False)
class UncertainSamples:
    """The machines within the bounds of an uncertain plant.

    Attributes
    ----------
    system : UncertainSystem
        Its last outputs are measurements, its last inputs controls.
    ny, nu : int
    """

    system: UncertainSystem
    ny: int
    nu: int

    @cached_property
    def numbers(self) -> tuple[RealElement, ...]:
        """The real numbers among what is uncertain."""
        return tuple(e for e in self.system.elements.values() if isinstance(e, RealElement))

    @cached_property
    def nominal(self) -> GeneralizedPlant:
        """The plant with every delta 0."""
        return self._plant(self.system.nominal)

    def at(self, values: Values, omega: float = math.nan) -> GeneralizedPlant | None:
        """Return a machine; None where the plant is not well posed.

        Parameters
        ----------
        values : mapping of str to float, complex or control.StateSpace
            As a witness has them. What is not named is nominal.
        omega : float, optional
            In rad/s, where complex numbers have their values.
        """
        step = self.system.dt
        own = 0.0 if not step else 1.0 if step is True else float(step)
        try:
            found = questions.system_at_witness(self.system, values, omega, own)
        except InvalidInputError:
            return None
        return self._plant(found.nominal if isinstance(found, UncertainSystem) else found)

    def corners(self) -> list[dict[str, float]]:
        """Return the values of the real numbers at the corners, or at some of very many.

        Of an ellipsoid they are the points whose directions are all of one size.
        """
        n = len(self.numbers)
        if not n:
            return []
        signs: Any = itertools.product((-1.0, 1.0), repeat=n)
        if n > _NUMBERS:
            signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(_DRAWN, n))
        members = [e.group for e in self.numbers]
        sizes = [1 / math.sqrt(members.count(g)) if g else 1.0 for g in members]
        return [self._values(np.array(one) * sizes) for one in signs]

    def _values(self, deltas: Vector) -> dict[str, float]:
        """Return the real numbers at deltas."""
        return {e.name: e.value(float(d)) for e, d in zip(self.numbers, deltas, strict=True)}

    def moved_to_bounds(self, values: Values) -> dict[str, Any]:
        """Return values with the real numbers moved outward to the bounds."""
        deltas = np.array([e.delta(values.get(e.name, e.nominal)) for e in self.numbers])
        # Numbers of an ellipsoid count together.
        groups: dict[str, list[float]] = {}
        for element, delta in zip(self.numbers, deltas, strict=True):
            groups.setdefault(element.group or f"number {element.name}", []).append(delta)
        largest = max((math.hypot(*own) for own in groups.values()), default=0.0)
        return {**values, **self._values(deltas / largest)} if largest > 0 else dict(values)

    def _plant(self, machine: Any) -> GeneralizedPlant:
        if not isinstance(machine, control.StateSpace):
            machine = control.StateSpace([], [], [], np.atleast_2d(machine), 0)
        return GeneralizedPlant(machine, self.ny, self.nu)


# The scenario search: descend on a set of samples, find a worse one, add it, prove.

# A descent on a set that is still to grow, and one on a set that seems to be complete.
_QUICK = SearchEffort(descents=1, fewest=1, smooth_first=False, steps=50)
_THOROUGH = SearchEffort(descents=1, fewest=1)
# Descents for the first set where the structure is prescribed, and for the last one.
_FIRST = SearchEffort(descents=16, fewest=4, patience=6)
_AGAIN = SearchEffort(descents=4, fewest=2, patience=2)
# Most machines of a set.
_MACHINES = 24
# Proofs at most: each takes as long as many descents.
_PROOFS = 8
# A machine joins the set if its norm is above that of the set by this share.
_WORSE = 1e-3
# Share of the work that is left for descents from several starts.
_SEVERAL = 0.4
# A worst gain so far above what no controller beats, relative, cannot be improved.
_NEAR = 0.01
# Machines of the set whose own smallest gain is asked for, the worst ones first.
_ASKED = 2


@dataclass(frozen=True, eq=False)
class ScenarioResult:
    """A controller with which no corner is worse than the set.

    Attributes
    ----------
    part : PartProblem
    theta : ndarray
        Its free numbers.
    level : float
        The largest norm over the set, in scaled units.
    stationary : bool
        Whether the last descent ended where no direction lowers it.
    """

    part: PartProblem
    theta: AnyVector
    level: float
    stationary: bool

    @property
    def controller(self) -> control.StateSpace:
        """The controller in the plant's units."""
        return self.part.controller(self.part.parametrisation.gain(self.theta))

    @property
    def gain(self) -> float:
        """The largest norm over the set, in the plant's units."""
        return self.part.scaled.norm(self.level)


@dataclass(eq=False)
class RobustCandidate:
    """A controller, and what is known of its loop with an uncertain plant.

    Attributes
    ----------
    controller : control.StateSpace
    system : UncertainSystem
    gamma : float
        The gain that is asked for.
    method : {"scalings", "scenarios"}
    worst : WorstCaseGain or None
    lower_bound : float
        What no controller beats, not even one made for a single machine within the bounds; 0
        if it was not asked for.
    """

    controller: control.StateSpace
    system: UncertainSystem
    gamma: float
    method: Literal["scalings", "scenarios"] = "scenarios"
    worst: questions.WorstCaseGain | None = None
    lower_bound: float = 0.0

    @cached_property
    def performance(self) -> questions.RobustPerformance:
        """For which share of the uncertainty the gain is proven."""
        return questions.robust_performance(self.system.lft(self.controller), self.gamma)

    @property
    def upper(self) -> float:
        """The worst gain that is proven."""
        return self.worst.upper if self.worst is not None and self.worst.proven else math.inf

    @property
    def is_best_possible(self) -> bool:
        """Whether next to nothing is left to gain."""
        return self.upper <= self.lower_bound * (1 + _NEAR)

    @property
    def is_robust(self) -> bool:
        """Whether every machine within the bounds is proven to have a gain below gamma."""
        proven = self.performance.proven and self.performance.lower >= 1
        return proven or self.upper < self.gamma

    @property
    def rank(self) -> tuple[bool, float]:
        """What decides: of robust ones the worst gain, of others the margin."""
        if self.is_robust and self.worst is not None:
            return True, -self.worst.upper
        return self.is_robust, self.performance.lower


class ScenarioSearch:
    """One search; its set of machines grows and serves every controller that is tried.

    Parameters
    ----------
    samples : UncertainSamples
    gamma : float
        The gain that is asked for in the end.
    budget : Budget
    """

    def __init__(self, samples: UncertainSamples, gamma: float, budget: Budget) -> None:
        self.samples, self.gamma, self.budget = samples, gamma, budget
        self.history: list[dict[str, Any]] = []
        # The set, beginning with the nominal machine, and the smallest gains of some of it.
        self._known: list[tuple[Values, PlantMatrices]] = []
        self._bounds: dict[int, float] = {}
        self._add({})

    def with_structure(self, order: int, mask: NDArray[np.bool_]) -> RobustCandidate | None:
        """Design a controller with free entries where a mask is true.

        Raises
        ------
        InfeasibleError
            If no gain of the pattern moves an unstable mode of the nominal plant; it is named.
        """
        part = self._part(order, mask)
        if part is None:
            return None
        starts = part.proposals(self.budget.share(0.5), np.random.default_rng(0))
        found = self._searched(part, starts, _FIRST)
        best = found and self._proven(found)
        if best is None or best.worst is None:
            return None
        # Then once more from other starts, on all machines that were worst for the first ones.
        others = part.proposals(self.budget.share(0.5), np.random.default_rng(1))
        again = self._searched(part, others, _AGAIN, best.worst.lower * (1 - AGREES))
        other = again and self._proven(again)
        return min(best, other or best, key=lambda one: one.upper)

    def from_nominal(self, order: int | None) -> RobustCandidate | None:
        """Return the best controller of a search from the design for the nominal machine."""
        design = design_one(self.samples.nominal, order, self.budget)
        return design and self.from_controller(design.controller, order)

    def from_controller(
        self, controller: control.StateSpace, order: int | None
    ) -> RobustCandidate | None:
        """Return the best controller of a search from a given one.

        Without an `order` it has as few states as cost next to nothing.
        """
        part = self._part(controller.nstates)
        found = part and self._settled(part, _point(part, controller), thorough=False)
        if part is None or found is None:
            return None
        bound = self._lower_bound(found)
        if found.gain > bound * (1 + AGREES):
            found = self._settled(part, found.theta) or found
            bound = max(bound, self._lower_bound(found))
        if order is None:
            found = self._shorter(found, bound)
        proven = self._proven(found)
        if proven is not None:
            proven.lower_bound = bound
        return proven

    @cached_property
    def _corners(self) -> list[tuple[Values, PlantMatrices]]:
        found = [(values, self._matrices(values)) for values in self.samples.corners()]
        return [(v, m) for v, m in found if m is not None]

    @cached_property
    def _scaled(self) -> ScaledPlant:
        """The nominal plant, whose units all machines are in."""
        return scale_plant(self.samples.nominal)

    def _part(self, order: int, mask: NDArray[np.bool_] | None = None) -> PartProblem | None:
        plant = self.samples.nominal
        free = np.ones((order + plant.nu, order + plant.ny), bool) if mask is None else mask
        return StaticStructure("hinf", order, free).problem(whole_plant(plant))

    def _descended(
        self, part: PartProblem, starts: Iterable[AnyVector], effort: SearchEffort, budget: Budget
    ) -> ScenarioResult | None:
        """Return the best of some descents on the set; None if none made all loops stable."""
        problem = replace(part, machines=tuple(m for _, m in self._known))
        search = MultistartSearch(problem.below(CEILINGS[0]), problem.stability, effort, budget)
        # Line searches try gains so wild that numbers overflow; such gains count as infinite.
        with np.errstate(over="ignore", invalid="ignore"):
            search.run(starts, np.random.default_rng(0))
        if search.point is None or not np.isfinite(search.value):
            return None
        stationary = search.history[-1]["outcome"] == "stationary"
        return ScenarioResult(part, search.point, float(np.exp(search.value)), stationary)

    def _compared(
        self, part: PartProblem, theta: AnyVector, machines: Iterable[PlantMatrices]
    ) -> list[tuple[bool, float]]:
        """Return whether the loop of each machine is unstable, and how much so, or its norm."""
        found, K = [], part.parametrisation.gain(theta)
        for machine in machines:
            alone = replace(part, machines=(machine,))
            self.budget.spend(alone.objective.work)
            norms = alone.objective.pieces(K, 0.0, ())
            pieces = norms or alone.stability.pieces(K, 0.0, ())
            found.append((not norms, pieces[0].value if pieces else np.inf))
        return found

    def _settled(
        self, part: PartProblem, theta: AnyVector, thorough: bool = True, goal: float = 0.0
    ) -> ScenarioResult | None:
        """Descend from a point until no corner is worse; None if a loop stays unstable.

        Parameters
        ----------
        part : PartProblem
        theta : ndarray
        thorough : bool, optional
            Whether long descents follow the short ones with which the set grows.
        goal : float, optional
            A level for which short ones will do.
        """
        before = 0.0
        while True:
            found = self._descended(part, [theta], _QUICK, self.budget)
            if found is None or self.budget.over:
                return found
            theta = found.theta
            if self._add_corner(found):
                continue
            if not thorough or found.level <= max(goal, before * (1 + _WORSE)):
                return found
            if not found.stationary:
                found = self._descended(part, [theta], _THOROUGH, self.budget) or found
            theta, before = found.theta, found.level
            self._record_step("descent", found)
            if self.budget.over or not self._add_corner(found):
                return found

    def _searched(
        self,
        part: PartProblem,
        starts: Iterable[AnyVector],
        effort: SearchEffort,
        below: float = np.inf,
    ) -> ScenarioResult | None:
        """Descend from several points, and go on from the best one until no corner is worse.

        Where that one cannot be made stable on all machines, others are tried on the larger set;
        `starts` may be without an end. None if no level comes below one in the plant's units.
        """
        source = iter(starts)
        own = self.budget.share(_SEVERAL)
        found = self._descended(part, source, effort, own)
        while found is not None and not self.budget.over:
            if found.gain >= below:
                return None
            if not self._add_corner(found):
                break
            again = self._descended(part, [found.theta], _QUICK, self.budget)
            found = again or self._descended(part, source, effort, own)
        if found is None:
            return None
        self._record_step("descents", found)
        return self._settled(part, found.theta) or found

    def _proven(self, found: ScenarioResult) -> RobustCandidate | None:
        """Prove a controller; where a proof finds a worse machine, add it and descend again."""
        best: RobustCandidate | None = None
        system = self.samples.system
        for _ in range(_PROOFS):
            controller = found.controller
            worst = questions.worst_case_gain(system.lft(controller))
            self.budget.spend(100 * step_cost(len(controller.A) + self.samples.nominal.nx))
            self._record_step("proof", found, worst.upper)
            if worst.proven and (best is None or worst.upper < best.upper):
                best = RobustCandidate(controller, system, self.gamma, worst=worst)
            enough = worst.upper <= found.gain * (1 + AGREES)
            if enough or self.budget.over or not self._add_witness(worst, found):
                break
            again = self._settled(found.part, found.theta)
            if again is None:
                break
            found = again
        return best

    def _shorter(self, found: ScenarioResult, bound: float) -> ScenarioResult:
        """Return the controller of fewest states whose level is next to that of a long one.

        Near a bound that no controller beats short descents will do.
        """
        if not found.part.order:
            return found
        try:
            reducer = Reducer(self.samples.nominal, found.controller)
        except (np.linalg.LinAlgError, ValueError):
            return found
        for order in range(1, found.part.order):
            part = self._part(order)
            if part is None or self.budget.over:
                break
            points = [_point(part, c.controller) for c in reducer.of_order(order)]
            points = [p for p in points if len(p) == part.parametrisation.size]
            if not points:
                continue
            # From the point whose worst loop of the set is best.
            machines = [m for _, m in self._known]
            levels = [max(self._compared(part, point, machines)) for point in points]
            first = points[levels.index(min(levels))]
            short = self._settled(part, first, thorough=False)
            enough = found.level * (1 + SHORTENED)
            if short is None or short.level > 2 * enough:
                continue
            goal = found.level / found.gain * bound * (1 + AGREES)
            short = self._settled(part, short.theta, goal=goal)
            if short is not None and short.level <= enough:
                return short
        return found

    def _lower_bound(self, found: ScenarioResult) -> float:
        """Return the largest of the smallest gains that the worst machines of the set can have."""
        compared = self._compared(found.part, found.theta, (m for _, m in self._known))
        worst = sorted(range(len(compared)), key=lambda i: compared[i], reverse=True)[:_ASKED]
        for place in worst:
            if place not in self._bounds:
                plant = self.samples.at(self._known[place][0])
                design = plant and design_one(plant, None, self.budget)
                self._bounds[place] = (design and design.lower_bound) or 0.0
        return max(self._bounds[place] for place in worst)

    def _record_step(self, what: str, found: ScenarioResult, gain: float | None = None) -> None:
        self.history.append(
            {
                "step": f"scenarios: {what}",
                "states": found.part.order,
                "machines": len(self._known),
                "gain": found.gain if gain is None else gain,
                "work": self.budget.spent,
            }
        )

    def _add_corner(self, found: ScenarioResult) -> bool:
        """Add the worst corner, if it is worse than the set."""
        if not self._corners or len(self._known) >= _MACHINES:
            return False
        compared = self._compared(found.part, found.theta, (m for _, m in self._corners))
        worst = max(range(len(compared)), key=lambda i: (compared[i], -i))
        unstable, norm = compared[worst]
        worse = unstable or norm > found.level * (1 + _WORSE)
        return worse and self._add(self._corners[worst][0])

    def _add_witness(self, worst: questions.WorstCaseGain, found: ScenarioResult) -> bool:
        """Add the machine at a witness: of unstable ones the farthest one that is unstable, too."""
        if not worst.witness or len(self._known) >= _MACHINES:
            return False
        values, omega = worst.witness, worst.critical_frequency
        if not np.isfinite(worst.lower):
            far = self.samples.moved_to_bounds(values)
            matrices = self._matrices(far, omega)
            machines = [] if matrices is None else [matrices]
            if any(unstable for unstable, _ in self._compared(found.part, found.theta, machines)):
                values = far
        return self._add(values, omega)

    def _add(self, values: Values, omega: float = np.nan) -> bool:
        """Add a machine; False if it is there already, or not well posed."""
        matrices = self._matrices(values, omega)
        known = [m.fingerprint for _, m in self._known]
        if matrices is None or matrices.fingerprint in known:
            return False
        self._known.append((values, matrices))
        return True

    def _matrices(self, values: Values, omega: float = np.nan) -> PlantMatrices | None:
        plant = self.samples.at(values, omega)
        return None if plant is None else self._scaled.in_units(PlantMatrices.of(plant))


def _point(part: PartProblem, controller: control.StateSpace) -> AnyVector:
    """Return the free numbers of a controller, whose modes get even units."""
    form, theta = ModalGain.of(part.scaled.scaled_controller(controller))
    return form.gain(theta).ravel()
