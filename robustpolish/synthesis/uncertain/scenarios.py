"""Scenario-based design: structured descents on a growing set of worst-case samples, and proofs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.base.arrays import AnyVector, Vector
from robustpolish.base.budget import Budget, step_cost
from robustpolish.errors import InfeasibleError, InvalidInputError, SolverError
from robustpolish.implementation.reduction import Reducer
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plants.uncertain.lft import RealElement
from robustpolish.plants.uncertain.system import UncertainSystem
from robustpolish.robust.questions import WorstCaseGain, system_at_witness, worst_case_gain
from robustpolish.synthesis.nonsmooth.descent import Measure
from robustpolish.synthesis.nonsmooth.measures import HinfMeasure, MaxMeasure
from robustpolish.synthesis.output_feedback.output_feedback import output_feedback
from robustpolish.synthesis.problem.matrices import PlantMatrices, augmented
from robustpolish.synthesis.problem.scaling import ScaledPlant, whole_plant
from robustpolish.synthesis.structured.search import POLICY as STRUCTURED
from robustpolish.synthesis.structured.search import (
    PartProblem,
    SearchEffort,
    descend_from,
)
from robustpolish.synthesis.structured.structures import StaticStructure, scaled_matrix
from robustpolish.synthesis.uncertain.scaled_gain import ModalGain, controller_from_matrix

# The largest norm of one controller with several machines, for the structured search.

# A descent on a set that is still to grow, and one on a set that seems to be complete.
_QUICK = SearchEffort(descents=1, fewest=1, smooth_first=False, steps=50)
_THOROUGH = SearchEffort(descents=1, fewest=1)


@dataclass(frozen=True, eq=False)
class WorstCaseProblem(PartProblem):
    """The search for a controller whose largest norm over a set of machines is small.

    Attributes
    ----------
    machines : tuple of PlantMatrices
        In the scaled units of the nominal plant.
    """

    machines: tuple[PlantMatrices, ...] = ()

    @classmethod
    def of(cls, part: PartProblem, machines: Iterable[PlantMatrices]) -> WorstCaseProblem:
        """Return the search of a nominal plant with a set of machines in place of it."""
        own = {field.name: getattr(part, field.name) for field in fields(PartProblem)}
        return cls(**own, machines=tuple(machines))

    @property
    def stable_loops(self) -> tuple[PlantMatrices, ...]:
        """The loops of all machines."""
        return tuple(augmented(machine, self.order) for machine in self.machines)

    @cached_property
    def objective(self) -> Measure:
        """The largest of their norms."""
        return MaxMeasure(tuple(HinfMeasure(loop) for loop in self.stable_loops))

    def instability_or_norm(self, theta: AnyVector, budget: Budget) -> tuple[bool, float]:
        """Return whether a loop is unstable, and how much so, or the norm: larger is worse."""
        K = self.parametrisation.gain(theta)
        budget.spend(self.objective.work)
        norms = self.objective.pieces(K, 0.0, ())
        found = norms or self.stability.pieces(K, 0.0, ())
        return not norms, found[0].value if found else np.inf

    def search(
        self, starts: Iterable[AnyVector], effort: SearchEffort, budget: Budget
    ) -> ScenarioResult | None:
        """Return the best of some descents; None if none made all loops stable."""
        problem, random = self.below(STRUCTURED.ceilings[0]), np.random.default_rng(0)
        # Line searches try gains so wild that numbers overflow; such gains count as infinite.
        with np.errstate(over="ignore", invalid="ignore"):
            found = descend_from(starts, problem, self.stability, effort, budget, random)
        if found.point is None or not np.isfinite(found.value):
            return None
        stationary = found.history[-1]["outcome"] == "stationary"
        return ScenarioResult(self, found.point, float(np.exp(found.value)), stationary)


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
            found = system_at_witness(self.system, values, omega, own)
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
        signs: list[Any] = list(itertools.product((-1.0, 1.0), repeat=n)) if n <= _NUMBERS else []
        if not signs:
            drawn = np.random.default_rng(0).choice([-1.0, 1.0], size=(_DRAWN, n))
            signs = drawn.tolist()
        members = [e.group for e in self.numbers]
        sizes = [1 / math.sqrt(members.count(g)) if g else 1.0 for g in members]
        return [self.values(np.array(one) * sizes) for one in signs]

    def values(self, deltas: Vector) -> dict[str, float]:
        """Return the real numbers at deltas."""
        return {e.name: e.value(float(d)) for e, d in zip(self.numbers, deltas, strict=True)}

    def deltas(self, values: Values) -> Vector:
        """Return the deltas of the real numbers."""
        return np.array([e.delta(values.get(e.name, e.nominal)) for e in self.numbers])

    def moved_to_bounds(self, values: Values) -> dict[str, Any]:
        """Return values with the real numbers moved outward to the bounds."""
        deltas = self.deltas(values)
        sizes = [abs(d) for d, e in zip(deltas, self.numbers, strict=True) if not e.group]
        for group in {e.group for e in self.numbers if e.group}:
            own = [d for d, e in zip(deltas, self.numbers, strict=True) if e.group == group]
            sizes.append(math.hypot(*own))
        largest = max(sizes, default=0.0)
        return {**values, **self.values(deltas / largest)} if largest > 0 else dict(values)

    def _plant(self, machine: Any) -> GeneralizedPlant:
        if not isinstance(machine, control.StateSpace):
            machine = control.StateSpace([], [], [], np.atleast_2d(machine), 0)
        return GeneralizedPlant(machine, self.ny, self.nu)


# The scenario search: descend on a set of samples, find a worse one, add it, prove.

# Most machines of a set.
_MACHINES = 24
# Proofs at most: each takes as long as many descents.
_PROOFS = 8
# A machine joins the set if its norm is above that of the set by this share.
_WORSE = 1e-3
# A proof so far above the set, relative, ends the search: intervals need 0.2 % alone.
_AGREES = 0.005
# Share of the work that is left for descents from several starts.
_SEVERAL = 0.4
# Descents for the first set where the structure is prescribed, and for the last one.
_FIRST = SearchEffort(descents=16, fewest=4, patience=6)
_AGAIN = SearchEffort(descents=4, fewest=2, patience=2)


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


@dataclass(frozen=True, eq=False)
class ScenarioDesign:
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


class ScenarioSearch:
    """One search; its set of machines grows and serves every controller that is tried.

    Parameters
    ----------
    machines : UncertainSamples
    scaled : ScaledPlant
        The nominal plant, whose units all machines are in.
    budget : Budget
    """

    def __init__(self, machines: UncertainSamples, scaled: ScaledPlant, budget: Budget) -> None:
        self.machines, self.scaled, self.budget = machines, scaled, budget
        self.history: list[dict[str, Any]] = []
        corners = [(values, self._matrices(values)) for values in machines.corners()]
        self._corners = [(v, m) for v, m in corners if m is not None]
        self.known: list[tuple[Values, PlantMatrices]] = []
        self._add({})

    def problem(self, part: PartProblem) -> WorstCaseProblem:
        """Return the search over the set of now."""
        return WorstCaseProblem.of(part, (m for _, m in self.known))

    def judged(
        self, found: ScenarioResult, machines: Iterable[PlantMatrices]
    ) -> list[tuple[bool, float]]:
        """Return whether the loop of each machine is unstable, and how much so, or its norm."""
        alone = (WorstCaseProblem.of(found.part, [machine]) for machine in machines)
        return [one.instability_or_norm(found.theta, self.budget) for one in alone]

    def settled(
        self, part: PartProblem, theta: AnyVector, thorough: bool = True, goal: float = 0.0
    ) -> ScenarioResult | None:
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
            found = self.problem(part).search([theta], _QUICK, self.budget)
            if found is None or self.budget.over:
                return found
            theta = found.theta
            if self._add_corner(found):
                continue
            if not thorough or found.level <= max(goal, before * (1 + _WORSE)):
                return found
            if not found.stationary:
                found = self.problem(part).search([theta], _THOROUGH, self.budget) or found
            theta, before = found.theta, found.level
            self.tell("descent", found)
            if self.budget.over or not self._add_corner(found):
                return found

    def searched(
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
        found = self.problem(part).search(source, effort, own)
        while found is not None and not self.budget.over:
            if found.gain >= below:
                return None
            if not self._add_corner(found):
                break
            problem = self.problem(part)
            again = problem.search([found.theta], _QUICK, self.budget)
            found = again or problem.search(source, effort, own)
        if found is None:
            return None
        self.tell("descents", found)
        return self.settled(part, found.theta) or found

    def proven(self, found: ScenarioResult) -> ScenarioDesign | None:
        """Prove a controller; where a proof finds a worse machine, add it and descend again."""
        best: ScenarioDesign | None = None
        for _ in range(_PROOFS):
            controller = found.controller
            worst = worst_case_gain(self.machines.system.lft(controller))
            self.budget.spend(100 * step_cost(len(controller.A) + self.machines.nominal.nx))
            self.tell("proof", found, worst.upper)
            if worst.proven and (best is None or worst.upper < best.worst.upper):
                best = ScenarioDesign(controller, worst)
            enough = worst.upper <= found.gain * (1 + _AGREES)
            if enough or self.budget.over or not self._add_witness(worst, found):
                break
            again = self.settled(found.part, found.theta)
            if again is None:
                break
            found = again
        return best

    def tell(self, what: str, found: ScenarioResult, gain: float | None = None) -> None:
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

    def worst_samples(self, found: ScenarioResult) -> list[int]:
        """Return the places of the machines in the set, that of the worst one first."""
        judged = self.judged(found, (m for _, m in self.known))
        return sorted(range(len(judged)), key=lambda i: judged[i], reverse=True)

    def _add_corner(self, found: ScenarioResult) -> bool:
        """Add the worst corner, if it is worse than the set."""
        if not self._corners or len(self.known) >= _MACHINES:
            return False
        judged = self.judged(found, (m for _, m in self._corners))
        worst = max(range(len(judged)), key=lambda i: (judged[i], -i))
        unstable, norm = judged[worst]
        worse = unstable or norm > found.level * (1 + _WORSE)
        return worse and self._add(self._corners[worst][0])

    def _add_witness(self, worst: WorstCaseGain, found: ScenarioResult) -> bool:
        """Add the machine at a witness: of unstable ones the farthest one that is unstable, too."""
        if not worst.witness or len(self.known) >= _MACHINES:
            return False
        omega = worst.critical_frequency
        if np.isfinite(worst.lower):
            return self._add(worst.witness, omega)
        far = self.machines.moved_to_bounds(worst.witness)
        matrices = self._matrices(far, omega)
        judged = [] if matrices is None else self.judged(found, [matrices])
        worse = any(unstable for unstable, _ in judged)
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


# Starts of the scenario search, and order reduction of what it finds.

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


def with_structure(
    machines: UncertainSamples, order: int, mask: NDArray[np.bool_], budget: Budget
) -> tuple[ScenarioDesign | None, list[dict[str, Any]]]:
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
    found = search.searched(part, starts, _FIRST)
    best = None if found is None else search.proven(found)
    if best is None:
        return None, search.history
    # Then once more from other starts, on all machines that were worst for the first ones.
    others = part.proposals(budget.share(0.5), np.random.default_rng(1))
    enough = best.worst.lower * (1 - _AGREES)
    again = search.searched(part, others, _AGAIN, enough)
    if again is not None:
        others = search.proven(again)
        best = min(best, others or best, key=lambda one: one.worst.upper)
    return best, search.history


class UnstructuredSearch:
    """The search for a controller without a pattern, of at most some order.

    Parameters
    ----------
    machines : UncertainSamples
    order : int or None
        Most states; None for as few as cost next to nothing.
    budget : Budget
    """

    def __init__(self, machines: UncertainSamples, order: int | None, budget: Budget) -> None:
        self.machines, self.order, self.budget = machines, order, budget
        self.search: ScenarioSearch | None = None
        self._bounds: dict[int, float] = {}

    @property
    def history(self) -> list[dict[str, Any]]:
        """What was done."""
        return [] if self.search is None else self.search.history

    def from_nominal(self) -> ScenarioDesign | None:
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

    def from_controller(self, controller: control.StateSpace) -> ScenarioDesign | None:
        """Return the best controller of a search from a given one."""
        part = self._part(controller.nstates)
        if part is None:
            return None
        self.search = self.search or ScenarioSearch(self.machines, part.scaled, self.budget)
        found = self.search.settled(part, _point(part, controller), thorough=False)
        if found is None:
            return None
        bound = self._lower_bound(found)
        if found.gain > bound * (1 + _AGREES):
            found = self.search.settled(part, found.theta) or found
            bound = max(bound, self._lower_bound(found))
        found = self._shorter(found, bound)
        proven = self.search.proven(found)
        return proven and replace(proven, lower_bound=bound)

    def _part(self, order: int) -> PartProblem | None:
        plant = self.machines.nominal
        return _part(self.machines, order, np.ones((order + plant.nu, order + plant.ny), bool))

    def _shorter(self, found: ScenarioResult, bound: float) -> ScenarioResult:
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
            goal = found.level / found.gain * bound * (1 + _AGREES)
            short = self.search.settled(part, short.theta, goal=goal)
            if short is not None and short.level <= enough:
                return short
        return found

    def _nearest(self, part: PartProblem, points: list[AnyVector]) -> AnyVector | None:
        """Return the point whose worst loop of the set is best."""
        assert self.search is not None
        machines = [m for _, m in self.search.known]
        starts = [ScenarioResult(part, point, np.inf, False) for point in points]
        judged = [(max(self.search.judged(one, machines)), i) for i, one in enumerate(starts)]
        return points[min(judged)[1]] if judged else None

    def _lower_bound(self, found: ScenarioResult) -> float:
        """Return the largest of the smallest gains that single machines of the set can have."""
        assert self.search is not None
        bounds = [0.0]
        for place in self.search.worst_samples(found)[:_ASKED]:
            if place not in self._bounds:
                values, _ = self.search.known[place]
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


def _part(machines: UncertainSamples, order: int, mask: NDArray[np.bool_]) -> PartProblem | None:
    return StaticStructure("hinf", order, mask).problem(whole_plant(machines.nominal))


def _point(part: PartProblem, controller: control.StateSpace) -> AnyVector:
    """Return the free numbers of a controller, whose modes get even units."""
    K = controller_from_matrix(scaled_matrix(controller, part.scaled), controller.nstates)
    form, theta = ModalGain.of(K)
    return form.gain(theta).ravel()
