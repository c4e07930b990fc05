"""The search for the controller of one part, in scaled units: descend, tidy, certify."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from typing import Any, ClassVar, Self

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.base.arrays import SOLVED
from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import AnyVector as Vector
from robustpolish.base.budget import Budget
from robustpolish.errors import SolverError
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import Norm, certify
from robustpolish.synthesis.nonsmooth import descent
from robustpolish.synthesis.nonsmooth.measures import (
    GainMeasure,
    HinfMeasure,
    MaxMeasure,
    StabilityMeasure,
    norm_measure,
)
from robustpolish.synthesis.problem import matrices, preflight

TIME_LIMIT = 300.0
"""Seconds of the safety net, if the caller names none."""
CEILINGS = (1e5, 3e3, 1e2, 1e1)
"""Largest entry of a controller in scaled units; an infimum beyond it counts as not attained. The
next one is used where a controller at the one before cannot be certified, as on plants with
displacement actuation."""

# Two descents agree if their norms differ by less than this share.
_AGREEMENT = 1e-4
# Price of a violated requirement, as a logarithm of the norm, while BFGS descends.
_PENALTY = 3.0


@dataclass(frozen=True)
class SearchEffort:
    """How many descents are enough for one part.

    Attributes
    ----------
    descents : int
        The most. A static gain has few free numbers and many local minima; a dynamic controller
        starts from Riccati designs and has few.
    fewest : int
        Descents before agreement counts: AC3 falls into the same poor minimum four times before a
        better one is found.
    patience : int
        Stop when so many descents in a row have not improved the norm.
    smooth_first : bool
        Whether BFGS goes before the bundle method. Springs and dampers often end at their bounds,
        and on the thesis's plant BFGS only takes their time.
    steps : int
        Quadratic programmes of the bundle method at most.
    """

    descents: int = 100
    fewest: int = 9
    patience: int = 16
    smooth_first: bool = True
    steps: int = 200


# A search under a lower ceiling starts near the last point.
_AGAIN = SearchEffort(descents=3)


# Several descents from different starts, until they agree or the work is done.


@dataclass(eq=False)
class MultistartSearch:
    """Descents from several starts: to stability, by BFGS, then by the bundle method.

    Attributes
    ----------
    problem : Problem
    stability : Measure
        Negative for a stable loop; lowered first where a start is unstable.
    effort : SearchEffort
    budget : Budget
    target : float
        Logarithm of a norm that is good enough.
    bounds : pair of ndarray, optional
        Bounds of the free numbers.
    point : ndarray or None
        The best one; None if no start led to a stable loop that meets the requirements.
    value : float
        Logarithm of its norm; infinite if there is none.
    reason : str
        "agreed", "patience", "starts", "target", "work" or "time".
    instability : float
        The lowest spectral abscissa seen, where nothing was stable.
    history : list of mapping
        One entry per descent.
    """

    problem: descent.Problem
    stability: descent.Measure
    effort: SearchEffort
    budget: Budget
    target: float = -np.inf
    bounds: descent.Bounds | None = None
    point: Vector | None = None
    value: float = np.inf
    reason: str = "starts"
    instability: float = np.inf
    history: list[Mapping[str, Any]] = field(default_factory=list)
    _values: list[float] = field(default_factory=list)
    _since: int = 0

    def run(self, starts: Iterable[Vector], rng: np.random.Generator) -> Self:
        """Descend from each start; every third time from near the best point so far instead."""
        if self.problem.parametrisation.size == 0:
            starts = [np.zeros(0)]
        for count, start in enumerate(starts):
            if count >= self.effort.descents:
                break
            if self.point is not None and count % 3 == 2:
                spread = 10 ** rng.uniform(-2.5, -0.5)
                size = np.abs(self.point) + 0.1 * np.abs(self.point).mean()
                start = self.point + spread * size * rng.normal(size=self.point.size)
            self._descend(start)
            stop = self._stop()
            if stop:
                self.reason = stop
                break
        return self

    def _stop(self) -> str:
        """Return why no other descent is needed; empty if one is."""
        if self.budget.over:
            return descent.stop_reason(self.budget)
        if self.value < self.target:
            return "target"
        if self.point is None:
            return ""
        fewest = self.effort.fewest
        agreeing = sum(v <= self.value + _AGREEMENT for v in self._values)
        if len(self._values) >= fewest and agreeing >= min(4, fewest):
            return "agreed"
        return "patience" if self._since >= self.effort.patience else ""

    def _take(self, point: Vector, value: float) -> None:
        self._values.append(value)
        self._since = 0 if value < self.value - _AGREEMENT else self._since + 1
        if value < self.value:
            self.point, self.value = point, value

    def _descend(self, start: Vector) -> None:
        problem, budget, began = self.problem, self.budget, self.budget.spent
        if start.size == 0:
            model = problem.model(start)
            if model is not None and model.violation <= 0:
                self._take(start, model.objective)
            self.history.append({"outcome": "nothing is free"})
            return
        unbounded = np.full(start.size, np.inf)
        bounds = self.bounds or (-unbounded, unbounded)
        folded = descent.ReflectedParametrisation(problem.parametrisation, bounds)
        smooth = replace(problem, parametrisation=folded)
        point = np.clip(start, *bounds)
        if problem.model(point) is None:
            point, abscissa = stabilise(smooth, self.stability, point, budget)
            point = folded.point(point)
            self.instability = min(self.instability, abscissa)
            if problem.model(point) is None:
                self.history.append({"outcome": "not stabilised", "abscissa": abscissa})
                return
        # A start that meets the requirements is kept, lest nothing better be found.
        model = problem.model(point) if problem.requirements else None
        if model is not None and model.violation == 0 and model.objective < self.value:
            self.point, self.value = point, model.objective
        first = None
        if self.effort.smooth_first:
            # With the 110 free numbers of IH 300 steps end halfway.
            steps = max(300, 15 * point.size)
            goal = -np.inf if problem.requirements else self.target
            first = descent.bfgs(
                lambda theta: smooth.penalised(theta, _PENALTY),
                point, budget, problem.work, steps, goal,
            )  # fmt: skip
            point = folded.point(first.point)
        if first is None or first.value < self.value + 0.1:
            last = descent.minimax(
                problem, point, budget, self.effort.steps, self.target, bounds=bounds
            )
            point, value, outcome = last.point, last.value, last.reason
        else:
            model = problem.model(point)
            feasible = model is not None and model.violation <= 1e-9
            value, outcome = (first.value if feasible else np.inf), first.reason
        self._take(point, value)
        work = budget.spent - began
        self.history.append({"outcome": outcome, "value": float(np.exp(value)), "work": work})


def stabilise(
    problem: descent.Problem, stability: descent.Measure, start: Vector, budget: Budget
) -> tuple[Vector, float]:
    """Lower the spectral abscissa by BFGS until the objective is finite."""
    parametrisation = problem.parametrisation
    # Some abscissas fall without end, but gains beyond the ceiling are worth nothing.
    ceiling = max(problem.ceiling, np.abs(parametrisation.gain(start)).max())

    def function(theta: Vector) -> tuple[float, Vector]:
        K = parametrisation.gain(theta)
        pieces = stability.pieces(K, 0.0, ()) if np.abs(K).max() <= ceiling else []
        if not pieces:
            return np.inf, np.zeros_like(theta)
        return pieces[0].value, parametrisation.back(theta, pieces[0].gradient)

    margin = 1e-7
    point, abscissa = start, np.inf
    for _ in range(4):
        ended = descent.bfgs(function, point, budget, stability.work, 200, -margin, tolerance=1e-6)
        if not np.isfinite(ended.value):
            return start, np.inf
        point, abscissa = ended.point, ended.value
        if ended.value >= 0 or problem.model(point) is not None:
            break
        margin *= 30
    return point, abscissa


# What the search needs to know of a kind of controller, and of one part of the plant.

StartProposal = Callable[[Budget, np.random.Generator], Iterator[Vector]]
"""Proposes free numbers to start from, the best first."""


def drawn_starts(
    scatter: tuple[float, float], bases: Sequence[Vector], relative: bool, rng: np.random.Generator
) -> Iterator[Vector]:
    """Yield random changes of points, in proportion to them or not, without an end.

    `scatter` has the decimal logarithms of the smallest and the largest change.
    """
    while True:
        point = bases[int(rng.integers(len(bases)))]
        size = 10 ** rng.uniform(*scatter)
        unit = np.abs(point) + 0.1 if relative else 1.0
        yield point + size * unit * rng.normal(size=point.size)


@dataclass(frozen=True, eq=False)
class PartProblem:
    """The search for the controller of one decoupled part.

    Attributes
    ----------
    scaled : ScaledPlant
        The part before and after scaling.
    norm : {"hinf", "h2"}
    order : int
        States of the controller.
    parametrisation : Parametrisation
        From the free numbers to K = [[Ak, Bk], [Ck, Dk]] of the scaled part.
    starts : tuple of StartProposal
        Asked one after the other, until the search is over.
    scatter : pair of float or None
        Of the starts that are drawn in the end, see :func:`drawn_starts`.
    rest : ndarray or None
        The point around which they are drawn; by default all that was proposed before.
    what : str
        What is designed, for messages.
    gain_bound : float or None
        Bound of the controller's largest singular value over frequency, in plant units.
    specifications : tuple of Requirement
        What is demanded besides.
    effort : SearchEffort
    objective_loop : PlantMatrices or None
        The loop whose norm is minimised, if it is another than `loop`.
    bounds : pair of ndarray or None
        Bounds of the free numbers.
    open_ended : ndarray of bool or None
        Whose upper bound only ends the search: at it the infimum is not attained.
    size : Measure or None
        What is made small in the end; the largest singular value of K by default.
    slack : float
        Share of the norm that is given away for that.
    advice : str
        What to try where nothing stable was found.
    machines : tuple of PlantMatrices
        In the units of the scaled part: the largest norm over them is minimised instead of its own.
    extra : bytes
        What tells the problem from another one of its structure on the same matrices.
    """

    scaled: preflight.ScaledPlant
    norm: Norm
    order: int
    parametrisation: descent.Parametrisation
    starts: tuple[StartProposal, ...]
    what: str
    scatter: tuple[float, float] | None = None
    rest: Vector | None = None
    gain_bound: float | None = None
    specifications: tuple[descent.Requirement, ...] = ()
    effort: SearchEffort = SearchEffort()
    objective_loop: matrices.PlantMatrices | None = None
    bounds: descent.Bounds | None = None
    open_ended: NDArray[np.bool_] | None = None
    size: descent.Measure | None = None
    slack: float = 5e-5
    advice: str = "Raise order="
    machines: tuple[matrices.PlantMatrices, ...] = ()
    extra: bytes = b""

    @cached_property
    def loop(self) -> matrices.PlantMatrices:
        """The scaled part, with integrators for a dynamic controller."""
        return matrices.augmented(matrices.PlantMatrices.of(self.scaled.plant), self.order)

    @cached_property
    def objective(self) -> descent.Measure:
        """The norm that is minimised."""
        if self.machines:
            return MaxMeasure(tuple(norm_measure(loop, self.norm) for loop in self.stable_loops))
        return norm_measure(self.objective_loop or self.loop, self.norm)

    @cached_property
    def controller_loop(self) -> matrices.PlantMatrices:
        """The controller itself from y to u, in plant units."""
        left, right = np.diag(self.scaled.control), np.diag(1 / self.scaled.measurement)
        return matrices.controller_loop(self.order, left, right, self.scaled.original.is_discrete)

    @cached_property
    def requirements(self) -> tuple[descent.Requirement, ...]:
        """All specifications and the bound on the gain, over frequency if K is dynamic."""
        if self.gain_bound is None:
            return self.specifications
        own = self.controller_loop
        size = HinfMeasure(own) if self.order else GainMeasure(own.D12, own.D21)
        return (*self.specifications, descent.Requirement(size, self.gain_bound))

    @property
    def stable_loops(self) -> tuple[matrices.PlantMatrices, ...]:
        """What has to be stable: all loops, and a dynamic controller whose gain is bounded."""
        if self.machines:
            return tuple(matrices.augmented(machine, self.order) for machine in self.machines)
        alone = self.gain_bound is not None and self.order > 0
        return (self.loop, self.controller_loop) if alone else (self.loop,)

    @property
    def stability(self) -> descent.Measure:
        """Negative where all that has to be stable is."""
        size = float(np.linalg.norm(self.loop.A, 2)) or 1.0
        return MaxMeasure(tuple(StabilityMeasure.of(each, size) for each in self.stable_loops))

    def below(self, ceiling: float) -> descent.Problem:
        """Return what the descents minimise, over gains below a ceiling."""
        return descent.Problem(self.parametrisation, self.objective, self.requirements, ceiling)

    def proposals(self, budget: Budget, rng: np.random.Generator) -> Iterator[Vector]:
        """Ask one proposal of starts after the other."""
        earlier: list[Vector] = []
        for proposal in self.starts:
            for start in proposal(budget, rng):
                earlier.append(start)
                yield start
        if self.scatter is not None:
            bases = earlier if self.rest is None else [self.rest]
            yield from drawn_starts(self.scatter, bases, self.rest is None, rng)

    @property
    def key(self) -> tuple[bytes, ...]:
        """What is the same for problems with the same answer."""
        return (self.extra, *matrices.PlantMatrices.of(self.scaled.original).fingerprint)

    def controller(self, K: Matrix) -> control.StateSpace:
        """Return K = [[Ak, Bk], [Ck, Dk]] of the scaled part as a controller in plant units."""
        # Entries that only rounding left in place of a zero are zeros.
        K = np.where(np.abs(K) < 1e-13 * np.abs(K).max(initial=0.0), 0.0, K)
        own = self.scaled.controller(matrices.controller_from_matrix(K, self.order))
        return preflight.named_controller(self.scaled.original, *own)


@dataclass(frozen=True, eq=False)
class PartDesign:
    """The controller of one part, in its units, and how the search went.

    Attributes
    ----------
    part : PartProblem
    point : ndarray
        The free numbers, for the scaled part.
    norm : float
        As the descent measured it; the certificate computes it anew.
    reason : str
        Why the search stopped.
    at_ceiling : bool
        The norm still fell when a limit of the gain was met.
    history : tuple of mapping
        One entry per descent.
    """

    part: PartProblem
    point: Vector
    norm: float
    reason: str
    at_ceiling: bool
    history: tuple[Any, ...]

    @cached_property
    def controller(self) -> control.StateSpace:
        """The controller in the part's units."""
        return self.part.controller(self.part.parametrisation.gain(self.point))

    @property
    def agreeing(self) -> int:
        """How many descents reached the best norm."""
        norms = [entry.get("value", np.inf) for entry in self.history]
        return sum(norm <= 1.0001 * min(norms) for norm in norms)


Designs = Sequence[PartDesign | None]
"""Of every part, None where there is nothing to choose."""
Joined = tuple[control.StateSpace, dict[str, Any]]
"""The controller of the whole plant, and what the method wants to tell of it."""


class ControllerStructure(ABC):
    """A kind of controller: how it is searched part by part, and put together."""

    norm: Norm
    method: ClassVar[str] = "descent"

    @abstractmethod
    def problem(self, part: preflight.PlantPart) -> PartProblem | None:
        """State the problem of one part; None if the structure leaves nothing to choose in it.

        Raises
        ------
        InfeasibleError
            If no controller of the structure does.
        """

    def join(
        self, plant: GeneralizedPlant, parts: Sequence[preflight.PlantPart], designs: Designs
    ) -> Joined:
        """Return the controller of the whole plant, and what the method wants to tell of it."""
        return preflight.joined_controller(plant, parts, [d and d.controller for d in designs]), {}


def scaled_part(
    plant: GeneralizedPlant, what: str, mask: NDArray[np.bool_] | None = None
) -> tuple[preflight.ScaledPlant, matrices.PlantMatrices]:
    """Scale a part, unless an unstable mode of it is fixed for all gains with the mask.

    Raises
    ------
    InfeasibleError
        If one is; it is named.
    """
    scaled = preflight.scale_plant(plant)
    inner = matrices.PlantMatrices.of(scaled.plant)
    free = np.ones((plant.nu, plant.ny), bool) if mask is None else mask
    preflight.refuse_fixed_modes(inner, free, plant.states, scaled.time, what)
    return scaled, inner


def design_part(part: PartProblem, budget: Budget, seed: int, target: float) -> PartDesign:
    """Search a controller of one part.

    Where the best one cannot be certified, its gain is too large for doubles: the search
    goes on under a lower ceiling.

    Parameters
    ----------
    part : PartProblem
    budget : Budget
    seed : int
    target : float
        A norm that is good enough, in the part's units.

    Raises
    ------
    SolverError
        If no start led to a stable loop that meets the requirements.
    """
    level = part.scaled.scaled_norm(target, part.norm) if target > 0 else 0.0
    # A norm of the scaled plant below this is zero up to rounding.
    goal = float(np.log(max(level, SOLVED)))
    rng = np.random.default_rng(seed)
    design, last = None, np.zeros(0)
    for ceiling in CEILINGS:
        # Shares of the work that is left: what the first search leaves over the others may use.
        own = budget.share(0.75 if design is None else 0.3)
        starts = part.proposals(own, rng)
        if design is not None:
            gain = np.abs(part.parametrisation.gain(design.point)).max()
            starts = chain([last * ceiling / gain], starts)
        search = MultistartSearch(
            part.below(ceiling), part.stability, _AGAIN if design else part.effort, own, goal,
            part.bounds,
        )  # fmt: skip
        # Line searches try gains so wild that numbers overflow; such gains count as infinite.
        with np.errstate(over="ignore", invalid="ignore"):
            search.run(starts, rng)
            if search.point is None or not np.isfinite(search.value):
                if design is not None:
                    break
                raise SolverError(_failure(part, search, budget))
            design, last = _tidied(part, search, budget), search.point
        # When time is over nothing is tried again, and the whole is certified in any case.
        plant = preflight.with_dummy_signals(part.scaled.original)
        if budget.over or certify(plant, design.controller, part.norm).valid:
            break
    assert design is not None
    return design


def _tidied(part: PartProblem, search: MultistartSearch, budget: Budget) -> PartDesign:
    """Return the result of a search, with a smaller gain where next to no norm is lost."""
    found, problem = search.point, search.problem
    assert found is not None
    point, value = _smaller_gain(part, problem, found, search.value, budget)
    # Did the search push against the ceiling, before the gain was made smaller?
    pushed = np.abs(part.parametrisation.gain(found)).max(initial=0.0)
    at_ceiling = pushed > 0.5 * problem.ceiling
    if part.bounds is not None and part.open_ended is not None:
        at_ceiling = (point > part.bounds[1] - 0.1)[part.open_ended].any()
    norms = [
        {**entry, "value": part.scaled.norm(entry["value"], part.norm)}
        if "value" in entry
        else entry
        for entry in search.history
    ]
    norm = part.scaled.norm(float(np.exp(value)), part.norm)
    return PartDesign(part, point, norm, search.reason, bool(at_ceiling), tuple(norms))


def _smaller_gain(
    part: PartProblem, problem: descent.Problem, point: Vector, value: float, budget: Budget
) -> tuple[Vector, float]:
    """Give away a little of the norm for the smallest gain."""
    if point.size == 0:
        return point, value
    if value < np.log(10 * SOLVED):
        # The norm is zero but for rounding: a rounded gain makes it exactly zero.
        for bits in (10, 20, 30, 40):
            rounded = np.round(point * 2.0**bits) / 2.0**bits
            model = problem.model(rounded)
            if model is not None and model.objective < np.log(SOLVED) - 10:
                return rounded, value
        return point, value
    gain = problem.parametrisation.gain
    K = gain(point)
    bound = float(np.exp(value)) * (1 + part.slack)
    size = part.size or GainMeasure(np.eye(K.shape[0]), np.eye(K.shape[1]))
    held = (descent.Requirement(problem.objective, bound), *problem.requirements)
    small = replace(problem, objective=size, requirements=held)
    if not K.any() or small.model(point) is None:
        return point, value
    ended = descent.minimax(small, point, budget, iterations=150, weight=100.0, bounds=part.bounds)
    check = problem.model(ended.point)
    if check is None or check.violation > 1e-9 or check.objective > np.log(bound) + 1e-6:
        return point, value
    # Less than half is worth the share of the norm.
    worth = np.abs(gain(ended.point)).max() <= 0.5 * np.abs(K).max()
    return (ended.point, check.objective) if worth else (point, value)


def _failure(part: PartProblem, search: MultistartSearch, budget: Budget) -> str:
    tried, more = f"{len(search.history)} descents", "try another seed"
    if budget.late:
        tried, more = f"{tried} before time ran out", "raise time_limit"
    if part.requirements and any("value" in entry for entry in search.history):
        bound = f"the gain bound {part.gain_bound:g}" if part.gain_bound is not None else ""
        demands = "all specifications" if part.specifications else bound
        return f"No {part.what} that meets {demands} was found by {tried}. Relax it or {more}."
    reached = ""
    if np.isfinite(search.instability):
        reached = f"; the lowest spectral abscissa was {search.instability:.3g} of the plant's size"
    return (
        f"No stabilising {part.what} was found by {tried}{reached}. None is proven not to "
        f"exist. {part.advice}, {more}, or use output_feedback."
    )
