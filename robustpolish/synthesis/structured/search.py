"""The search for the controller of one part, in scaled units: descend, tidy, certify."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from typing import Any, ClassVar, Literal, Protocol

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import AnyVector as Vector
from robustpolish.base.budget import Budget
from robustpolish.errors import SolverError
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import certify
from robustpolish.synthesis.nonsmooth.descent import (
    Bounds,
    Measure,
    Problem,
    ReflectedParametrisation,
    Requirement,
    bfgs,
    minimax,
    stop_reason,
)
from robustpolish.synthesis.nonsmooth.measures import (
    GainMeasure,
    H2Measure,
    HinfMeasure,
    MaxMeasure,
    StabilityMeasure,
)
from robustpolish.synthesis.nonsmooth.parametrisations import Parametrisation
from robustpolish.synthesis.problem.matrices import PlantMatrices, augmented, controller_loop
from robustpolish.synthesis.problem.preflight import refuse_fixed_modes
from robustpolish.synthesis.problem.scaling import (
    PlantPart,
    ScaledPlant,
    joined_controller,
    named_controller,
    scale_plant,
    with_dummy_signals,
)

# The decisions of the structured searches, each with its reason and the case that needs it.

TIME_LIMIT = 300.0
"""Seconds of the safety net, if the caller names none."""


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

    @property
    def agreeing(self) -> int:
        """Stop when so many descents have reached the best norm."""
        return min(4, self.fewest)


@dataclass(frozen=True)
class StructuredPolicy:
    """Thresholds of the search for controllers of prescribed structure.

    Attributes
    ----------
    work : float
        Work of one design, in H-infinity norms of small loops (half a millisecond each): within
        a minute on an idle machine. AC3 and the mixed designs of 12 states need most of it.
    start_share : float
        Parts of the work that is left: of the first search, of one more under a lower ceiling, and
        of the proposals of starts within each. What one leaves over the next may use.
    again : SearchEffort
        Of a search under a lower ceiling, which starts near the last point.
    static, observer, observer_h2, mixed, passive, blocks : Effort
        Of the structures. Blocks have few numbers, and their descents mostly agree. The H2 problem
        over F and L is smooth and its Riccati start optimal, so that few descents tell.
    ceilings : tuple of float
        Largest entry of a controller in scaled units; an infimum beyond it counts as not attained.
        The next one is used where a controller at the one before cannot be certified, as on
        plants with displacement actuation.
    near_ceiling : float
        Share of the ceiling above which a search pushed against it.
    slack : float
        Share of the norm that is given away for a smaller gain, and for smaller springs and
        dampers, whose norm is flat where several do the same.
    zero : float
        A norm of the scaled plant below this is zero up to rounding.
    agreement : float
        Two descents agree if their norms differ by less than this share.
    epsilons : tuple of float
        Regularisations of the scaled plant, and back-offs from the smallest gamma, of the
        Riccati designs to start from: nobody knows which one is near the best observer.
    proposals : int
        So many of the Riccati designs are descended from, the best first.
    grown : SearchEffort
        Of that search: it is only a start.
    modest : float
        Riccati designs with entries above this share of the first ceiling are no starts.
    stabilising_states, shared_states : int
        Semidefinite programs for plants with more states take longer than the descents that they
        would start: at 24 states one of up to fifteen takes seconds, at 14 the change of variables
        of a full-order controller has as many unknowns.
    nothing : float
        Coefficients of springs and dampers, in scaled units, that count as nothing.
    highest : float
        Logarithm of the largest coefficient tried, in scaled units.
    """

    work: float = 1e5
    start_share: float = 0.3
    again: SearchEffort = SearchEffort(descents=3)
    static: SearchEffort = SearchEffort()
    observer: SearchEffort = SearchEffort(descents=14)
    observer_h2: SearchEffort = SearchEffort(descents=14, fewest=3)
    mixed: SearchEffort = SearchEffort(descents=8)
    passive: SearchEffort = SearchEffort(smooth_first=False)
    blocks: SearchEffort = SearchEffort(descents=60, fewest=5, patience=12)
    ceilings: tuple[float, ...] = (1e5, 3e3, 1e2, 1e1)
    near_ceiling: float = 0.5
    slack: float = 5e-5
    zero: float = 1e-13
    agreement: float = 1e-4
    epsilons: tuple[float, ...] = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
    proposals: int = 6
    grown: SearchEffort = SearchEffort(descents=12, fewest=5, patience=6)
    modest: float = 0.3
    stabilising_states: int = 24
    shared_states: int = 14
    nothing: float = 1e-9
    highest: float = math.log(3e4)

    def iterations(self, numbers: int) -> int:
        """Return the steps of BFGS: with the 110 free numbers of IH 300 end halfway."""
        return max(300, 15 * numbers)

    @property
    def modest_entry(self) -> float:
        """Largest entry of a Riccati design that is a start."""
        return self.modest * self.ceilings[0]


POLICY = StructuredPolicy()


# Several descents from different starts, until they agree or the work is done.


@dataclass(frozen=True, eq=False)
class SearchResult:
    """The best point of all descents.

    Attributes
    ----------
    point : ndarray or None
        None if no start led to a stable loop that meets the requirements.
    value : float
        Logarithm of its norm; infinite if there is none.
    reason : str
        "agreed", "patience", "starts", "target", "work" or "time".
    instability : float
        The lowest spectral abscissa seen, where nothing was stable.
    history : tuple of mapping
        One entry per descent.
    """

    point: Vector | None
    value: float
    reason: str
    instability: float
    history: tuple[Mapping[str, Any], ...]


@dataclass
class _Progress:
    point: Vector | None = None
    value: float = np.inf
    instability: float = np.inf
    since: int = 0
    values: list[float] = field(default_factory=list)
    history: list[Mapping[str, Any]] = field(default_factory=list)

    def take(self, point: Vector, value: float) -> None:
        self.values.append(value)
        self.since += 1
        if value < self.value - POLICY.agreement:
            self.since = 0
        if value < self.value:
            self.point, self.value = point, value

    def keep(self, problem: Problem, point: Vector) -> None:
        """Remember a start that meets the requirements, lest nothing better be found."""
        model = problem.model(point) if problem.requirements else None
        if model is not None and model.violation == 0 and model.objective < self.value:
            self.point, self.value = point, model.objective

    def agreeing(self) -> int:
        return sum(v <= self.value + POLICY.agreement for v in self.values)


def descend_from(
    starts: Iterable[Vector],
    problem: Problem,
    stability: Measure,
    effort: SearchEffort,
    budget: Budget,
    rng: np.random.Generator,
    target: float = -np.inf,
    bounds: Bounds | None = None,
    weight: float = 3.0,
) -> SearchResult:
    """Descend from each start: to stability, by BFGS, then by the bundle method.

    Every third descent after the first success starts near the best point so far
    instead.

    Parameters
    ----------
    starts : iterable of ndarray
    problem : Problem
    stability : Measure
        Negative for a stable loop; lowered first where a start is unstable.
    effort : SearchEffort
    budget : Budget
    rng : numpy.random.Generator
        For the descents near the best point.
    target : float
        Logarithm of a norm that is good enough.
    bounds : pair of ndarray, optional
        Bounds of the free numbers.
    weight : float
        Price of a violated requirement in the BFGS phase.

    Returns
    -------
    SearchResult
    """
    progress, reason = _Progress(), "starts"
    if problem.parametrisation.size == 0:
        starts = [np.zeros(0)]
    for count, start in enumerate(starts):
        if count >= effort.descents:
            break
        if progress.point is not None and count % 3 == 2:
            start = _nearby(progress.point, rng)
        own = (start, budget, target, progress, bounds, weight, effort)
        _descend(problem, stability, *own)
        stop = _verdict(progress, effort, budget, target)
        if stop is not None:
            reason = stop
            break
    return SearchResult(
        progress.point, progress.value, reason, progress.instability, tuple(progress.history)
    )


def _nearby(point: Vector, rng: np.random.Generator) -> Vector:
    spread = 10 ** rng.uniform(-2.5, -0.5)
    size = np.abs(point) + 0.1 * np.abs(point).mean()
    return point + spread * size * rng.normal(size=point.size)


def _verdict(
    progress: _Progress, effort: SearchEffort, budget: Budget, target: float
) -> str | None:
    if budget.over:
        return stop_reason(budget)
    if progress.value < target:
        return "target"
    enough = len(progress.values) >= effort.fewest
    if progress.point is not None and enough and progress.agreeing() >= effort.agreeing:
        return "agreed"
    if progress.point is not None and progress.since >= effort.patience:
        return "patience"
    return None


def _descend(
    problem: Problem,
    stability: Measure,
    start: Vector,
    budget: Budget,
    target: float,
    progress: _Progress,
    bounds: Bounds | None,
    weight: float,
    effort: SearchEffort,
) -> None:
    began = budget.spent
    folded = None if bounds is None else ReflectedParametrisation(problem.parametrisation, bounds)
    smooth = problem if folded is None else replace(problem, parametrisation=folded)
    point = start if bounds is None else np.clip(start, *bounds)
    if point.size == 0:
        model = problem.model(point)
        if model is not None and model.violation <= 0:
            progress.take(point, model.objective)
        progress.history.append({"outcome": "nothing is free"})
        return
    if problem.model(point) is None:
        point, abscissa = stabilise(smooth, stability, point, budget)
        point = point if folded is None else folded.point(point)
        progress.instability = min(progress.instability, abscissa)
        if problem.model(point) is None:
            progress.history.append({"outcome": "not stabilised", "abscissa": abscissa})
            return
    progress.keep(problem, point)
    first = None
    if effort.smooth_first:
        first = bfgs(
            lambda theta: smooth.penalised(theta, weight),
            point,
            budget,
            problem.work,
            POLICY.iterations(point.size),
            target if not problem.requirements else -np.inf,
        )
        point = first.point if folded is None else folded.point(first.point)
    if first is None or first.value < progress.value + 0.1:
        last = minimax(problem, point, budget, effort.steps, target, bounds=bounds)
        point, value, how = last.point, last.value, last.reason
    else:
        model = problem.model(point)
        feasible = model is not None and model.violation <= 1e-9
        value, how = (first.value if feasible else np.inf), first.reason
    progress.take(point, value)
    progress.history.append(
        {
            "outcome": how,
            "value": float(np.exp(value)),
            "work": budget.spent - began,
        }
    )


def stabilise(
    problem: Problem, stability: Measure, start: Vector, budget: Budget
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
        ended = bfgs(function, point, budget, stability.work, 200, -margin, tolerance=1e-6)
        if not np.isfinite(ended.value):
            return start, np.inf
        point, abscissa = ended.point, ended.value
        if ended.value >= 0 or problem.model(point) is not None:
            break
        margin *= 30
    return point, abscissa


# What the search needs to know of a kind of controller, and of one part of the plant.

Norm = Literal["hinf", "h2"]


class StartProposal(Protocol):
    """One way to find starts for the descents."""

    def propose(
        self, earlier: Sequence[Vector], budget: Budget, rng: np.random.Generator
    ) -> Iterator[Vector]:
        """Propose free numbers, the best first; `earlier` lists what others proposed before."""
        ...


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
    what : str
        What is designed, for messages.
    gain_bound : float or None
        Bound of the controller's largest singular value over frequency, in plant units.
    specifications : tuple of Requirement
        What is demanded besides.
    demands : str
        All that is demanded in words, for messages; empty if nothing is.
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
    extra : bytes
        What tells the problem from another one of its structure on the same matrices.
    """

    scaled: ScaledPlant
    norm: Norm
    order: int
    parametrisation: Parametrisation
    starts: tuple[StartProposal, ...]
    what: str
    gain_bound: float | None = None
    specifications: tuple[Requirement, ...] = ()
    demands: str = ""
    effort: SearchEffort = POLICY.static
    objective_loop: PlantMatrices | None = None
    bounds: Bounds | None = None
    open_ended: NDArray[np.bool_] | None = None
    size: Measure | None = None
    slack: float = POLICY.slack
    advice: str = "Raise order="
    extra: bytes = b""

    @property
    def plant(self) -> GeneralizedPlant:
        """The part in its own units."""
        return self.scaled.original

    @cached_property
    def loop(self) -> PlantMatrices:
        """The scaled part, with integrators for a dynamic controller."""
        return augmented(PlantMatrices.of(self.scaled.plant), self.order)

    @cached_property
    def objective(self) -> Measure:
        """The norm that is minimised."""
        return norm_measure(self.objective_loop or self.loop, self.norm)

    @cached_property
    def controller_loop(self) -> PlantMatrices:
        """The controller itself from y to u, in plant units."""
        left, right = np.diag(self.scaled.control), np.diag(1 / self.scaled.measurement)
        return controller_loop(self.order, left, right, self.plant.is_discrete)

    @cached_property
    def requirements(self) -> tuple[Requirement, ...]:
        """All specifications and the bound on the gain, over frequency if K is dynamic."""
        if self.gain_bound is None:
            return self.specifications
        if self.order:
            size: Measure = HinfMeasure(self.controller_loop)
        else:
            size = GainMeasure(np.diag(self.scaled.control), np.diag(1 / self.scaled.measurement))
        return (*self.specifications, Requirement(size, self.gain_bound))

    @property
    def stable_loops(self) -> tuple[PlantMatrices, ...]:
        """What has to be stable: the loop, and a dynamic controller whose gain is bounded."""
        alone = self.gain_bound is not None and self.order > 0
        return (self.loop, self.controller_loop) if alone else (self.loop,)

    @property
    def stability(self) -> Measure:
        """Negative where all that has to be stable is."""
        size = float(np.linalg.norm(self.loop.A, 2)) or 1.0
        return MaxMeasure(tuple(StabilityMeasure.of(each, size) for each in self.stable_loops))

    def below(self, ceiling: float) -> Problem:
        """Return what the descents minimise, over gains below a ceiling."""
        return Problem(self.parametrisation, self.objective, self.requirements, ceiling)

    def proposals(self, budget: Budget, rng: np.random.Generator) -> Iterator[Vector]:
        """Ask one proposal of starts after the other."""
        earlier: list[Vector] = []
        for proposal in self.starts:
            for start in proposal.propose(tuple(earlier), budget, rng):
                earlier.append(start)
                yield start

    @property
    def key(self) -> tuple[bytes, ...]:
        """What is the same for problems with the same answer."""
        return (self.extra, *PlantMatrices.of(self.plant).fingerprint)

    def controller(self, K: Matrix) -> control.StateSpace:
        """Return K = [[Ak, Bk], [Ck, Dk]] of the scaled part as a controller in plant units."""
        # Entries that only rounding left in place of a zero are zeros.
        K = np.where(np.abs(K) < 1e-13 * np.abs(K).max(initial=0.0), 0.0, K)
        k = self.order
        own = control.StateSpace(
            K[:k, :k], K[:k, k:], K[k:, :k], K[k:, k:], self.plant.dt, remove_useless_states=False
        )
        back = self.scaled.controller(own)
        return named_controller(self.plant, *map(np.array, (back.A, back.B, back.C, back.D)))


@dataclass(frozen=True, eq=False)
class PartDesign:
    """The controller of one part, in its units, and how the search went.

    Attributes
    ----------
    scaled : ScaledPlant
    controller : control.StateSpace
    point : ndarray
        The free numbers, for the scaled part.
    norm : float
        As the descent measured it; the certificate computes it anew.
    reason : str
        Why the search stopped.
    agreeing, descents : int
        How many descents reached the best norm, of how many.
    at_ceiling : bool
        The norm still fell when a limit of the gain was met.
    history : tuple of mapping
        One entry per descent.
    """

    scaled: ScaledPlant
    controller: control.StateSpace
    point: Vector
    norm: float
    reason: str
    agreeing: int
    descents: int
    at_ceiling: bool
    history: tuple[Any, ...]


class ControllerStructure(ABC):
    """A kind of controller: how it is searched part by part, and put together."""

    method: ClassVar[str] = "descent"

    @abstractmethod
    def problem(self, part: PlantPart) -> PartProblem | None:
        """State the problem of one part; None if the structure leaves nothing to choose in it.

        Raises
        ------
        InfeasibleError
            If no controller of the structure does.
        """

    def join(
        self,
        plant: GeneralizedPlant,
        parts: Sequence[PlantPart],
        designs: Sequence[PartDesign | None],
    ) -> tuple[control.StateSpace, dict[str, Any]]:
        """Return the controller of the whole plant, and what the method wants to tell of it."""
        return joined_controller(plant, parts, [d and d.controller for d in designs]), {}


def bound_in_words(gain_bound: float | None) -> str:
    """Return a bound on the gain as a demand in words."""
    return "" if gain_bound is None else f"the gain bound {gain_bound:g}"


def scaled_part(
    plant: GeneralizedPlant, what: str, mask: NDArray[np.bool_] | None = None
) -> tuple[ScaledPlant, PlantMatrices]:
    """Scale a part, unless an unstable mode of it is fixed for all gains with the mask.

    Raises
    ------
    InfeasibleError
        If one is; it is named.
    """
    scaled = scale_plant(plant)
    inner = PlantMatrices.of(scaled.plant)
    free = np.ones((plant.nu, plant.ny), bool) if mask is None else mask
    refuse_fixed_modes(inner, free, plant.states, scaled.time, what)
    return scaled, inner


def norm_measure(loop: PlantMatrices, norm: Norm) -> Measure:
    """Return the norm of a loop; of its states where no disturbance reaches any output."""
    if not (loop.nw and loop.nz):
        n, zeros = loop.nx, np.zeros
        loop = loop.replace(
            B1=np.eye(n),
            C1=np.eye(n),
            D11=zeros((n, n)),
            D12=zeros((n, loop.nu)),
            D21=zeros((loop.ny, n)),
        )
    return HinfMeasure(loop) if norm == "hinf" else H2Measure(loop)


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
    goal = float(np.log(max(level, POLICY.zero)))
    rng = np.random.default_rng(seed)
    found, first = None, None
    for ceiling in POLICY.ceilings:
        again = first is not None
        problem = part.below(ceiling)
        # Parts of the work that is left: of the first search, of one more under a lower ceiling,
        # and of the proposals of starts within each. What one leaves over the next may use.
        own = budget.share(0.3 if again else 0.75)
        effort = POLICY.again if again else part.effort
        starts = part.proposals(own, rng)
        if found is not None and first is not None:
            gain = np.abs(part.parametrisation.gain(found.point)).max()
            starts = chain([first * ceiling / gain], starts)
        # Line searches try gains so wild that numbers overflow; such gains count as infinite.
        with np.errstate(over="ignore", invalid="ignore"):
            result = descend_from(
                starts, problem, part.stability, effort, own, rng, goal, part.bounds
            )
        if result.point is None or not np.isfinite(result.value):
            if found is not None:
                break
            raise SolverError(_failure(part, result, budget))
        found, first = _outcome(part, problem, result, budget), result.point
        # When time is over nothing is tried again, and the whole is certified in any case.
        if (
            budget.over
            or certify(with_dummy_signals(part.plant), found.controller, part.norm).valid
        ):
            break
    assert found is not None
    return found


def _outcome(
    part: PartProblem, problem: Problem, result: SearchResult, budget: Budget
) -> PartDesign:
    with np.errstate(over="ignore", invalid="ignore"):
        point, value = _smaller_gain(part, problem, result, budget)
    assert result.point is not None
    # Before it was made smaller: did the search push against the ceiling?
    pushed = np.abs(problem.parametrisation.gain(result.point)).max(initial=0.0)
    at_ceiling = pushed > POLICY.near_ceiling * problem.ceiling
    if part.bounds is not None and part.open_ended is not None:
        at_ceiling = (point > part.bounds[1] - 0.1)[part.open_ended].any()
    values = [entry.get("value", np.inf) for entry in result.history]
    scaled, norm = part.scaled, part.norm
    return PartDesign(
        scaled=scaled,
        controller=part.controller(problem.parametrisation.gain(point)),
        point=point,
        norm=scaled.norm(float(np.exp(value)), norm),
        reason=result.reason,
        agreeing=sum(v <= 1.0001 * min(values) for v in values),
        descents=len(values),
        at_ceiling=bool(at_ceiling),
        history=tuple(
            {**entry, "value": scaled.norm(entry["value"], norm)} if "value" in entry else entry
            for entry in result.history
        ),
    )


def _smaller_gain(
    part: PartProblem, problem: Problem, result: SearchResult, budget: Budget
) -> tuple[Vector, float]:
    """Give away a little of the norm for the smallest gain."""
    assert result.point is not None
    if result.point.size == 0:
        return result.point, result.value
    if result.value < np.log(10 * POLICY.zero):
        return _rounded(problem, result.point), result.value
    K = problem.parametrisation.gain(result.point)
    bound = float(np.exp(result.value)) * (1 + part.slack)
    small = Problem(
        problem.parametrisation,
        part.size or GainMeasure(np.eye(K.shape[0]), np.eye(K.shape[1])),
        (Requirement(problem.objective, bound), *problem.requirements),
        problem.ceiling,
    )
    if not K.any() or small.model(result.point) is None:
        return result.point, result.value
    ended = minimax(small, result.point, budget, iterations=150, weight=100.0, bounds=part.bounds)
    check = problem.model(ended.point)
    if check is None or check.violation > 1e-9 or check.objective > np.log(bound) + 1e-6:
        return result.point, result.value
    if (
        np.abs(problem.parametrisation.gain(ended.point)).max()
        # A smaller gain is taken if its largest entry falls below this share.
        > 0.5 * np.abs(K).max()
    ):
        # Not worth the part of the norm.
        return result.point, result.value
    return ended.point, check.objective


def _rounded(problem: Problem, point: Vector) -> Vector:
    """Round a gain whose norm is zero but for rounding, so that it becomes exactly zero."""
    for bits in (10, 20, 30, 40):
        rounded = np.round(point * 2.0**bits) / 2.0**bits
        model = problem.model(rounded)
        if model is not None and model.objective < np.log(POLICY.zero) - 10:
            return rounded
    return point


def _failure(part: PartProblem, result: SearchResult, budget: Budget) -> str:
    tried = f"{len(result.history)} descents"
    more = "try another seed"
    if budget.late:
        tried, more = f"{tried} before time ran out", "raise time_limit"
    if part.demands and any("value" in entry for entry in result.history):
        return f"No {part.what} that meets {part.demands} was found by {tried}. Relax it or {more}."
    reached = (
        f"; the lowest spectral abscissa was {result.instability:.3g} of the plant's size"
        if np.isfinite(result.instability)
        else ""
    )
    return (
        f"No stabilising {part.what} was found by {tried}{reached}. None is proven not to "
        f"exist. {part.advice}, {more}, or use output_feedback."
    )
