"""The driver of feedback synthesis: split, scale, search, choose, certify, join.

State feedback is the same task with y = x and a static gain. Every part of the plant that shares
no signal with the others is searched alone by the engines of
:class:`~robustpolish.synthesis.driver.Engine`; one certified controller is chosen for it, and the
whole is certified afresh in the plant's own units.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

import control
import numpy as np

from robustpolish.base.arrays import ROUNDING
from robustpolish.base.budget import Budget, DeadlineError, partial_deadline, step_cost
from robustpolish.base.checks import instance_of, one_of, positive
from robustpolish.errors import SolverError
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis import certificate as certificates
from robustpolish.synthesis.certificate import ANY_NORM, Certificate, Norm, NormTarget
from robustpolish.synthesis.design import Design
from robustpolish.synthesis.lmi.program import BACKENDS
from robustpolish.synthesis.problem import matrices, preflight
from robustpolish.synthesis.problem.pole_regions import PoleRegion
from robustpolish.synthesis.problem.preflight import ScaledPlant
from robustpolish.synthesis.proofs.bounded_real import estimate_norm
from robustpolish.synthesis.riccati.gamma import (
    LowerBound,
    estimated_lower_bound,
    is_out_of_reach,
    lower_bound,
)
from robustpolish.synthesis.state_feedback import riccati

# The protocol of the engines of feedback synthesis: the task of one part, and what they find.


# Rungs of the ladder of regularisations: half decades, for gamma falls by at most a third from one
# to the next where it settles. Below 3e-9 rounding decides (AC12, ROC10).
EPSILONS = tuple(10.0 ** (-k / 2) for k in range(2, 18))
# By how much the axis is moved, over the plant's unit of frequency, where D12 and D21 have full
# rank and zeros lie on it: as much as the norm allows, for the poles keep this distance. It has to
# be less than that of the slowest weight, whose poles nothing moves.
SHIFTS = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
# A relative fall of the norm that is none.
SETTLED = 3e-4
# A norm that two decades of the ladder have lowered to less than this share falls on.
FALLING = 0.9
# More states than this make every check of a loop take long, so that fewer are made.
COSTLY_STATES = 24
# An infimum that is approached without end counts as zero below this share of the norm at the start
# of the descent; smaller norms would cost gain for nothing (AC1, UWV).
AS_GOOD_AS_ZERO = 1e-6
# A ladder ends within this share of the tolerance above the lower bound. The rest of the tolerance
# buys smaller gains and fewer states.
_NEAR = 0.25


@dataclass(frozen=True)
class Settings:
    """What the user asks of the engines.

    Attributes
    ----------
    norm, method, backend, solver, tolerance, wanted
        As in the public functions.
    engines : tuple of type
        Called one after the other until the goal is reached.
    full_state : bool
        State feedback: y = x, and a static gain is wanted.
    regions : tuple of PoleRegion
        Where the closed-loop poles have to lie, in the plant's unit of time.
    gain_bound : float or None
        Bound on the largest singular value of a static gain, in the plant's units.
    reference : float
        A norm of the whole plant beside which one that falls without end counts as zero.
    relaxations : tuple of float
        Factors on the tolerance of the engines, the next one where no controller of the one before
        could be certified.
    """

    norm: Norm
    method: str
    backend: str
    solver: str | None
    tolerance: float
    wanted: NormTarget = ANY_NORM
    engines: tuple[type[Engine], ...] = ()
    full_state: bool = False
    regions: tuple[PoleRegion, ...] = ()
    gain_bound: float | None = None
    reference: float = 0.0
    relaxations: tuple[float, ...] = (1.0,)


@dataclass(frozen=True, eq=False)
class Task:
    """One part of a plant as the engines see it.

    Attributes
    ----------
    plant : PlantMatrices
        Scaled, without D22; without D11 for the H2 norm.
    norm : {"hinf", "h2"}
    regular : bool
        Whether D12 and D21 have full rank.
    tolerance : float
        How far above the infimum, relative, is good enough.
    bound : LowerBound or None
        A norm below which no controller comes, in scaled units; None if none is known.
    wanted : NormTarget
        What was asked for, in scaled units.
    scaled : ScaledPlant or None
        The units of the part, for state feedback.
    """

    plant: matrices.PlantMatrices
    norm: Norm
    regular: bool
    tolerance: float
    bound: LowerBound | None
    wanted: NormTarget = ANY_NORM
    scaled: ScaledPlant | None = None

    @property
    def goal(self) -> float:
        """The norm below which smaller ones are worth nothing; zero if the infimum is unknown."""
        return self.wanted.limited(self._above_bound(0.99))

    @property
    def near(self) -> float:
        """The norm at which a search may end; zero if the infimum is unknown."""
        return self.wanted.limited(self._above_bound(_NEAR))

    @property
    def asked(self) -> float:
        """A norm above the infimum that was asked for and will do; zero if none was."""
        asked = self.wanted.enough
        return asked if asked > self._above_bound(1.0) else 0.0

    def _above_bound(self, share: float) -> float:
        """Return the norm that lies by a share of the tolerance above the lower bound."""
        return 0.0 if self.bound is None else self.bound.value * (1 + share * self.tolerance)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A controller that stabilises the scaled plant.

    Attributes
    ----------
    controller : Controller
        For the plant without D22, its states balanced.
    achieved : float
        The norm of its loop, computed from the loop.
    claimed : float
        The bound that its method promised.
    origin : str
        The method, and the setting that made it.
    """

    controller: matrices.Controller
    achieved: float
    claimed: float
    origin: str

    @property
    def gain(self) -> float:
        """Largest entry of the controller's matrices, in scaled units."""
        return self.controller.gain

    @property
    def order(self) -> int:
        """Number of the controller's states."""
        return len(self.controller.A)

    @property
    def keeps_claim(self) -> bool:
        """Whether the loop keeps the promise."""
        return self.achieved <= self.claimed * (1 + 1e-3)

    @property
    def promise(self) -> float:
        """What the method claimed; LQG promises no number, so that its norm is its claim."""
        return self.claimed if np.isfinite(self.claimed) else self.achieved


class Engine(ABC):
    """One search for controllers of one part, and what it has found.

    Attributes
    ----------
    settings : Settings
    problem : Task
    budget : Budget
    method, backend : str
        Who searched, as designs tell it.
    candidates : list of Candidate
        Every controller whose loop was checked and stable.
    history : list of dict
        One entry for every step.
    falling : bool
        Whether the norm was still falling when the search met a limit of gain or accuracy.
    remarks : list of str
        What the user should know, such as a solver's false claim.
    bound : LowerBound or None
        A norm that no controller falls below, where the engine looked for it.
    constrained : bool
        Whether a demand of which the bound knows nothing keeps a norm from being called optimal.
    """

    method = "riccati"
    backend = "scipy"

    def __init__(self, settings: Settings, problem: Task, budget: Budget) -> None:
        self.settings, self.problem, self.budget = settings, problem, budget
        self.candidates: list[Candidate] = []
        self.history: list[dict[str, Any]] = []
        self.remarks: list[str] = []
        self.falling = self.constrained = False
        self.bound: LowerBound | None = None

    @staticmethod
    def is_useful(problem: Task, earlier: Sequence[Engine]) -> bool:
        """Tell whether a search is of use after those of other engines that missed the goal."""
        return True

    @abstractmethod
    def search(self) -> None:
        """Look for controllers with a small norm."""

    def objections(
        self, K: control.StateSpace, proof: Certificate, promised: float
    ) -> Sequence[str]:
        """Tell what else a certified controller in the plant's units breaks."""
        return ()

    @property
    def best(self) -> float:
        """The smallest norm of a checked loop; infinite if there is none."""
        return min((c.achieved for c in self.candidates), default=np.inf)

    def checked(self, K: matrices.Controller, claimed: float, origin: str) -> Candidate | None:
        """Return a controller with the norm of its loop; None if it does not stabilise."""
        return check_candidate(self.problem, K, claimed, origin, self.budget)


def check_candidate(
    problem: Task, K: matrices.Controller, claimed: float, origin: str, budget: Budget
) -> Candidate | None:
    """Balance a controller and check its loop; None if it does not stabilise."""
    if not all(np.isfinite(M).all() for M in K):
        return None
    K = matrices.balanced(K)
    states = problem.plant.nx + len(K.A)
    # Beyond so many states of a loop its norm comes from its modes, at the expense of a step on
    # the plant.
    modal = states > 100 and problem.norm == "hinf"
    budget.spend(step_cost(problem.plant.nx if modal else states))
    achieved = _loop_norm(problem.plant, K, problem.norm)
    return Candidate(K, achieved, claimed, origin) if np.isfinite(achieved) else None


def _loop_norm(plant: matrices.PlantMatrices, K: matrices.Controller, norm: Norm) -> float:
    """Return the norm from w to z; infinite if the loop is not stable.

    The result guides a search. It is certified once the search is over.
    """
    loop = matrices.close(plant, K)
    if not all(np.isfinite(M).all() for M in loop):
        return np.inf
    poles: Any = np.linalg.eigvals(loop.A) if loop.A.size else np.zeros(0)
    margin = 1 - np.abs(poles) if plant.discrete else -poles.real
    if margin.min(initial=1.0) <= 0:
        return np.inf
    if 0 in loop.D.shape:
        return 0.0
    if norm == "hinf" and not plant.discrete:
        found = estimate_norm(*loop)
        # Up to so many states of a loop an exact norm is quick where doubles cannot tell.
        if found.settled or len(loop.A) > 16:
            return found.value
    system = control.StateSpace(*loop, plant.discrete)
    if norm == "h2":
        return float(h2_norm(system, tolerance=1e-3).value)
    proven = hinf_norm(system, tolerance=1e-6)
    return float(proven.value) if proven.stable else np.inf


# Fewer modes of a controller while the norm of its loop stays below a limit.


def _remove_modes(problem: Task, candidate: Candidate, limit: float, budget: Budget) -> Candidate:
    """Remove modes of the controller while the norm of its loop stays below a limit.

    Near the optimum the central controller has a mode that runs away; elsewhere modes
    cancel against each other or against the plant. Both cost gain and order for nothing.
    The last controller whose norm is below the limit is returned, perhaps `candidate` itself.
    """
    costly = candidate.order > COSTLY_STATES
    while candidate.order and not budget.over:
        shorter = matrices.without_many_modes if costly else matrices.without_one_mode
        for K in shorter(candidate.controller, problem.norm == "hinf"):
            if budget.over:
                return candidate
            found = check_candidate(problem, K, limit, candidate.origin, budget)
            if found and found.achieved <= limit and found.gain <= 1.5 * candidate.gain:
                candidate = found
                break
        else:
            break
        if costly:  # every trial takes long
            break
    return candidate


# The search on one decoupled part: scaled, shortened where it is large, solved, chosen.

# With more states than this the equations take so long that fewer are tried first.
TRUNCATED_STATES = 100
# Of controllers that are refused one after the other ever more are skipped, for neighbours fail
# alike.
_TRIALS = (0, 1, 2, 3, 5, 8, 12, 17, 23, 30, 40, 55, 75)


class ChosenController(NamedTuple):
    """A controller of one part, in the plant's units, and what its method claimed.

    It is certified, unless only the whole is to be.
    """

    controller: control.StateSpace
    certificate: certificates.Certificate | None
    claim: float
    findings: Engine
    status: preflight.Status
    bound: LowerBound | None

    @property
    def achieved(self) -> float:
        """The certified norm; infinite without a certificate."""
        return np.inf if self.certificate is None else self.certificate.achieved


class PartSearch:
    """One part in the units of the engines, what they found, and the choice among it.

    Parameters
    ----------
    plant : GeneralizedPlant
    settings : Settings
    diagnosis : SolvabilityCheck
    budget : Budget
        For the engines and for shortening controllers; certificates are computed in any case.
    shorten : bool
        Whether states that hardly count may be left out of a large plant.

    Attributes
    ----------
    part : SolverPlant
    unit : float
        The scaled norm's unit in the plant's units.
    problem : Task
        Of fewer states than the part where that is harmless.
    searches : list of Engine
    """

    def __init__(
        self,
        plant: GeneralizedPlant,
        settings: Settings,
        diagnosis: preflight.SolvabilityCheck,
        budget: Budget,
        shorten: bool = True,
    ) -> None:
        self.settings, self.diagnosis, self.budget = settings, diagnosis, budget
        self.part = preflight.SolverPlant.of(plant, settings.norm == "hinf", settings.full_state)
        self.unit = self.part.norm(1.0, settings.norm)
        if not (shorten and self._search(shorten=True)):
            self._search(shorten=False)

    def _search(self, shorten: bool) -> bool:
        """Bound the norm from below and let the engines search; False where that is spoilt.

        Spoilt it is where the states that were left out change the norm of the best loop.
        """
        settings, norm, part = self.settings, self.settings.norm, self.part
        plant, bound, short, remark = part.matrices, None, None, ""
        # Share of the work that engines may spend; the rest shortens controllers.
        work = self.budget.share(0.7)
        inner = np.zeros((plant.nu, plant.ny))
        if norm == "h2" and not settings.full_state:
            plant, inner = riccati.cancel_feedthrough(plant)
            bound = riccati.h2_lower_bound(plant)
        elif not settings.full_state:
            # How finely the lower bound is searched, as a share of the tolerance.
            accuracy = 0.03 * min(settings.tolerance, 1e-2)
            if shorten and plant.nx > TRUNCATED_STATES:
                short = _truncated_plant(plant, settings.tolerance, accuracy, work)
            if short is None:
                bound = lower_bound(plant, accuracy, work)
            else:
                plant, bound, remark = short
        wanted = settings.wanted.in_unit(self.unit)
        if bound is not None and bound.value > wanted.below and bound.proven:
            least = part.norm(bound.value, norm)
            raise certificates.unreachable_norm_error(settings.wanted, least, norm, bound.how)
        regular, tolerance = self.diagnosis.regular_feedthrough, settings.tolerance
        problem = Task(plant, norm, regular, tolerance, bound, wanted, part.scaled)
        searches: list[Engine] = []
        self.searches = searches
        for kind in settings.engines:
            if any(engine.best <= problem.goal for engine in searches):
                break
            if kind.is_useful(problem, searches):
                searches.append(kind(settings, problem, work))
                searches[-1].search()
        candidates = [c for engine in searches for c in engine.candidates]
        best = min(candidates, key=lambda c: c.achieved, default=None)
        if short is not None:
            whole = replace(problem, plant=part.matrices)
            seen = best and check_candidate(whole, best.controller, best.claimed, best.origin, work)
            if not (best and seen):
                return False
            if abs(seen.achieved - best.achieved) > SETTLED * best.achieved:
                return False
            searches[0].remarks.append(remark)
        if work.exhausted:
            searches[-1].remarks.append("The work allowed was spent; allow more with effort.")
        # A norm this much, relative, below an estimate of the infimum shows that rounding spoilt
        # it.
        if bound is not None and best and best.achieved < bound.value * (1 - 1e-5):
            problem = replace(problem, bound=None)
        if settings.full_state:
            problem = replace(problem, bound=searches[-1].bound)
        if inner.any():  # a static controller that was closed before
            problem = replace(problem, plant=part.matrices)
            for engine in searches:
                controllers = [c.controller for c in engine.candidates]
                engine.candidates = [
                    replace(c, controller=K._replace(D=K.D + inner))
                    for c, K in zip(engine.candidates, controllers, strict=True)
                ]
        self.problem = problem
        return True

    @property
    def best(self) -> float:
        """The smallest norm found, in the plant's units; zero if none was found."""
        found = min((engine.best for engine in self.searches), default=np.inf)
        return self.part.norm(found, self.problem.norm) if np.isfinite(found) else 0.0

    def choose(self, enough: float, prove: bool = True) -> ChosenController:
        """Pick the smallest gain among the controllers near the infimum, and certify it.

        Where none can be certified, the states that were left out are searched as well, and then
        controllers further away from the optimum.

        Parameters
        ----------
        enough : float
            A norm, in the plant's units, below which a falling search need not go.
        prove : bool
            Whether the controller of the part has to be certified alone.

        Raises
        ------
        SolverError
            If none could be certified.
        """
        part, problem, budget, unit = self.part, self.problem, self.budget, self.unit
        owners = {id(c): engine for engine in self.searches for c in engine.candidates}
        candidates = [c for engine in self.searches for c in engine.candidates]
        best = min((c.achieved for c in candidates), default=np.inf)
        level = self._zero_level(enough / unit)
        limit = max(self._limit(best), level)
        # Within the limit the smallest gain is wanted. Where the limit lies far above the best norm
        # two of these will do: below it loops are ever harder to prove, above it ever easier.
        within = sorted(
            (c for c in candidates if c.achieved <= limit), key=lambda c: (c.gain, c.order)
        )
        few = 2 if level == limit else len(within)
        above = sorted((c for c in candidates if c.achieved > limit), key=lambda c: c.achieved)
        ranked = [*within[:few], *above, *within[few:]]
        bound = problem.bound and problem.bound._replace(
            value=part.norm(problem.bound.value, problem.norm)
        )
        reasons: list[str] = []
        spare: list[ChosenController] = []
        for trial in (i for i in _TRIALS if i < len(ranked)):
            # The last chance goes to the gentlest controller, the easiest one to prove.
            last = bool(trial) and budget.over
            candidate = min(candidates, key=lambda c: c.gain) if last else ranked[trial]
            owner = owners[id(candidate)]
            # Within a norm that was asked for by far more than the tolerance the central controller
            # is wanted, not the shortest one that just keeps it.
            most = candidate.achieved * (1 + problem.tolerance) if problem.asked else limit
            most = max(min(limit, most), candidate.achieved)
            short = _remove_modes(problem, candidate, most, budget)
            claim = part.norm(candidate.promise, problem.norm)
            K = None if prove else part.controller(candidate.controller)
            if K is not None:
                return ChosenController(
                    K, None, claim, owner, self._status(candidate.achieved), bound
                )
            for each in dict.fromkeys((short, candidate)):
                # Work of one certificate, in steps on the loop's size.
                budget.spend(20.0 * step_cost(part.matrices.nx + each.order))
                try:
                    # Share of the time left that a certificate may take while a gentler controller
                    # could follow.
                    with partial_deadline(1.0 if last else 2 / 3):
                        found = self._certified(each, reasons)
                except DeadlineError:
                    reasons.append("the time was over before its certificate was complete")
                    budget.update_late()
                    continue
                objections = owner.objections(*found, claim) if found is not None else ()
                if found is None or objections:
                    reasons += objections
                    continue
                achieved = found[1].achieved / unit
                kept = found[1].bound <= problem.wanted.below * unit
                if achieved <= each.achieved * (1 + 1e-3) and kept:
                    done = ChosenController(*found, claim, owner, self._status(achieved), bound)
                    # The gentlest controller is no better than one that misses what was seen of it.
                    return min([done, *spare], key=lambda one: one.achieved) if last else done
                # Its loop is worse in the plant's own units than the search saw in scaled ones.
                spare.append(ChosenController(*found, claim, owner, "suboptimal", bound))
            if last:
                break
        if spare:
            return min(spare, key=lambda one: one.achieved)
        return self._again(reasons).choose(enough, prove)

    def _limit(self, best: float) -> float:
        """Return the norm up to which a smaller gain is preferred to a smaller norm."""
        problem = self.problem
        if problem.norm == "h2":
            # How much of the H2 norm may be given away: the optimum is known exactly, so little.
            return best * (1 + min(problem.tolerance, 2e-5))
        if best <= problem.goal:
            return problem.goal
        # What is given away counts from the infimum: beyond the tolerance nothing is.
        known = problem.bound is not None and problem.bound.value > 0
        return best * (1 + (SETTLED if known else problem.tolerance))

    def _zero_level(self, enough: float) -> float:
        """Return the norm below which a falling search need not go; zero if none is falling."""
        falling = [engine for engine in self.searches if engine.falling and engine.candidates]
        if not falling:
            return 0.0
        best = min(engine.best for engine in falling)
        zero = AS_GOOD_AS_ZERO * max(engine.candidates[0].achieved for engine in falling)
        # A single part, or the one that decides the norm of the whole, has to do its best.
        return max(zero, enough if enough > 2 * best else 0.0)

    def _certified(
        self, candidate: Candidate, reasons: list[str]
    ) -> tuple[control.StateSpace, certificates.Certificate] | None:
        K = self.part.controller(candidate.controller)
        if K is None:
            reasons.append("the loop with D22 is not well posed")
            return None
        proof = certificates.certify(self.part.original, K, self.problem.norm)
        if proof.valid and not proof.bound > (1 + 2e-3) * proof.achieved:
            # The promise of the method, or what its loop has, if that is more.
            promised = self.part.norm(candidate.promise, self.problem.norm)
            return K, proof.with_claim(max(promised, proof.achieved))
        reasons += proof.reasons or [f"only the bound {proof.bound:.6g} could be proven"]
        return None

    def _status(self, achieved: float) -> preflight.Status:
        bound = self.problem.bound
        # Share of the norm with almost no control below which a norm is nothing but rounding.
        most = ROUNDING * self.settings.reference / self.unit
        near = bound is not None and achieved <= most + bound.value * (1 + self.problem.tolerance)
        near = near and not any(engine.constrained for engine in self.searches)
        # An estimate of the infimum may lie above it.
        if bound is not None and bound.proven and near:
            return "optimal"
        falling = any(engine.falling for engine in self.searches)
        return "infimum_not_attained" if falling else "suboptimal"

    def _again(self, reasons: list[str]) -> PartSearch:
        """Search with the states that were left out, or further away from the optimum."""
        settings, original = self.settings, self.part.original
        whole = self.problem.plant.nx == self.part.matrices.nx
        if whole:
            settings = replace(settings, relaxations=settings.relaxations[1:])
        if not whole or (settings.relaxations and not self.budget.over):
            return PartSearch(original, settings, self.diagnosis, self.budget, shorten=False)
        why = "; ".join(dict.fromkeys(reasons)) or "no engine found a stabilising controller"
        if settings.full_state:
            raise SolverError(
                f"A gain was found, but its certificate fails: {why}. "
                "Try the other method or backend, a larger control_weight or a gain_bound."
            )
        remarks = [remark for engine in self.searches for remark in engine.remarks]
        if settings.norm == "h2" and not original.is_discrete and original.D11.any():
            remarks.append(
                "The feedthrough D11 can be cancelled up to rounding only, which leaves the H2 "
                "norm infinite. Filter w or z so that D11 vanishes, or use norm='hinf'."
            )
        remarks += [f"It has the {mode}." for mode in self.diagnosis.fixed_modes]
        more = time_limit_note(self.budget)
        raise SolverError(" ".join([f"No certified controller was found: {why}.{more}", *remarks]))


def _truncated_plant(
    plant: matrices.PlantMatrices, tolerance: float, accuracy: float, budget: Budget
) -> tuple[matrices.PlantMatrices, LowerBound, str] | None:
    """Leave out what hardly counts; None unless the bound holds for the whole plant too."""
    short = preflight.truncated(plant)
    if short is None:
        return None
    fewer, error = short
    bound = estimated_lower_bound(fewer, accuracy, budget)
    budget.spend(step_cost(plant.nx))
    if bound is None or not is_out_of_reach(plant, bound.value * (1 - tolerance / 10)):
        return None
    few = f"of {fewer.nx} of the {plant.nx} states"
    remark = (
        f"The equations are {few}; the others change the response by at most {error:.2g} in "
        "scaled units (Hankel bound)."
    )
    return fewer, bound._replace(how=f"{bound.how} {few}", proven=False), remark


# From the parts to the whole: search every part, join their controllers, certify.

_Problem = TypeVar("_Problem")
_Answer = TypeVar("_Answer")
_Key = tuple[bytes, ...]


def solve_each_once(
    problems: Iterable[tuple[_Key, float, _Problem]],
    budget: Budget,
    solve: Callable[[_Problem, Budget], _Answer],
) -> dict[_Key, _Answer]:
    """Solve problems of the same key once, for machines are symmetric.

    Parameters
    ----------
    problems : iterable of (key, weight, problem)
        The weight says how much of the work that is left a problem may use, beside the others.
    budget : Budget
    solve : callable
        Given a problem and its share of the budget.
    """
    different: dict[_Key, tuple[float, _Problem]] = {}
    for key, weight, problem in problems:
        different.setdefault(key, (weight, problem))
    left = sum(weight for weight, _ in different.values())
    answers = {}
    for key, (weight, problem) in different.items():
        answers[key] = solve(problem, budget.share(weight / left))
        left -= weight
    return answers


@dataclass(frozen=True, eq=False)
class JoinedController:
    """The certified controller of a whole plant.

    Attributes
    ----------
    plant : GeneralizedPlant
    settings : Settings
    budget : Budget
    chosen : list of ChosenController or None
        One for each part; None for a part without controls or measurements.
    controller : control.StateSpace
    certificate : Certificate
    bound : float
        A norm below which no controller comes, if that is known; or an estimate of the infimum.
    """

    plant: GeneralizedPlant
    settings: Settings
    budget: Budget
    chosen: Sequence[ChosenController | None]
    controller: control.StateSpace
    certificate: certificates.Certificate
    bound: float

    @property
    def done(self) -> list[ChosenController]:
        """The controllers of the parts that have one."""
        return [c for c in self.chosen if c is not None]

    @property
    def bounds(self) -> list[LowerBound]:
        """What is known of the parts' infima."""
        return [c.bound for c in self.done if c.bound is not None]

    @property
    def known(self) -> bool:
        """Whether the infimum of some part is bounded from below, and of none only estimated."""
        return bool(self.bounds) and all(b.proven for b in self.bounds)

    @property
    def how(self) -> str:
        """How the bound is known; "" if there is none."""
        return _listed(b.how for b in self.bounds)

    @property
    def lower_bound_note(self) -> str:
        """How low the norm can be, in words; "" if that is not known."""
        if self.known:
            kind = "gain" if self.settings.full_state else "controller"
            return f"no {kind} comes below {self.bound:.6g}, {self.how}"
        near = f"the infimum may be near {self.bound:.6g}, {self.how}, which is no bound"
        return near if self.how else ""

    @property
    def status(self) -> preflight.Status:
        """The status of the whole: that of the parts that decide its norm."""
        achieved, done = self.certificate.achieved, self.done
        if self.budget.was_late:
            return "time_limit"
        rounding = ROUNDING * self.settings.reference
        near = achieved <= rounding + self.bound * (1 + self.settings.tolerance)
        if self.settings.full_state:
            worst = preflight.worst_status(c.status for c in done)
            return "suboptimal" if worst == "optimal" and not near else worst
        if self.known and near:
            return "optimal"
        largest = max((c.achieved for c in done), default=0.0)
        return preflight.worst_status(
            c.status for c in done if self.settings.norm == "h2" or c.achieved >= 0.99 * largest
        )

    def design(self, message: str, lower_bound: float | None, details: dict[str, Any]) -> Design:
        """Return the design, with what its method tells."""
        wanted, done = self.settings.wanted, self.done
        told = {"gamma": (wanted.enough, wanted.below) if wanted.is_requested else None}
        return Design(
            plant=self.plant,
            controller=self.controller,
            closed_loop=self.plant.closed_loop(self.controller),
            norm=self.settings.norm,
            status=self.status,
            message=message,
            certificate=self.certificate,
            method=_listed(c.findings.method for c in done) or self.settings.method,
            backend=_listed(c.findings.backend for c in done) or "scipy",
            elapsed=self.budget.elapsed,
            history=tuple(
                MappingProxyType({"part": i, **note})
                for i, c in enumerate(self.chosen)
                for note in (c.findings.history if c else ())
            ),
            details=MappingProxyType({**details, **told}),
            lower_bound=lower_bound,
        )


def design_by_parts(
    plant: GeneralizedPlant,
    parts: Sequence[preflight.PlantPart],
    settings: Settings,
    diagnosis: preflight.SolvabilityCheck,
    budget: Budget,
) -> JoinedController:
    """Design a controller for every part of a plant, and certify them together.

    Raises
    ------
    InfeasibleError
        If a part without control is unstable, or no controller has the norm that was asked for.
    SolverError
        If no controller was found, none could be certified, or none has that norm.
    """
    problems: list[tuple[_Key, float, GeneralizedPlant]] = []
    keys: list[_Key | None] = []
    for piece in parts:
        P = piece.plant
        keys.append(matrices.PlantMatrices.of(P).fingerprint if P.nu and P.ny else None)
        if P.nu and P.ny:
            problems.append((keys[-1] or (), P.nx**2 + 1, P))
            continue
        preflight.refuse_unstable(P)
        if settings.norm == "h2" and not P.is_discrete and P.D11.any():
            raise riccati.no_finite_h2_norm()
    norm, full_state, wanted = settings.norm, settings.full_state, settings.wanted
    # Norms of parts add up for the H2 norm, so that only a single one can be told.
    own = (
        replace(settings, wanted=certificates.ANY_NORM)
        if norm == "h2" and len(parts) > 1
        else settings
    )
    searched = solve_each_once(
        problems,
        budget,
        lambda P, share: PartSearch(preflight.with_dummy_signals(P), own, diagnosis, share),
    )
    # No part has to be much better than the one that decides the norm of the whole.
    enough = 0.01 * max((s.best for s in searched.values()), default=0.0)
    reasons: list[str] = []
    # A static gain is certified with the whole alone, and part by part only where that fails.
    for prove in (False, True) if full_state and len(parts) > 1 else (True,):
        choices = {key: search.choose(enough, prove) for key, search in searched.items()}
        chosen = [None if key is None else choices[key] for key in keys]
        done = [c for c in chosen if c is not None]
        controller = preflight.joined_controller(plant, parts, [c and c.controller for c in chosen])
        # The norms of the parts without control, except those in which nothing happens.
        still = [part.plant for part, c in zip(parts, chosen, strict=True) if c is None]
        size = hinf_norm if norm == "hinf" else h2_norm
        idle = [float(size(P.open_loop)) for P in still if P.nw and P.nz and (P.nx or P.D11.any())]
        # The whole loop of a single part has been certified with it.
        alone = [part.plant.nx for part, c in zip(parts, chosen, strict=True) if c] == [plant.nx]
        certificate = done[0].certificate if alone and not idle else None
        reasons = []
        if certificate is None or plant.delays:
            # Norms that the loops of the parts keep.
            kept = (c.certificate.claimed or 0.0 if c.certificate else c.claim for c in done)
            promised = combined_norm([*kept, *idle], norm)
            certificate = certificates.certify(plant, controller, norm, promised)
            reasons += certificate.reasons
            for c in done[:1]:
                reasons += c.findings.objections(controller, certificate, promised)
        if not reasons:
            break
    else:
        raise SolverError(
            "The controllers of the parts are certified, the whole is not: " + "; ".join(reasons)
        )
    bound = combined_norm([*(c.bound.value for c in done if c.bound), *idle], norm)
    whole = JoinedController(plant, settings, budget, chosen, controller, certificate, bound)
    if certificate.bound <= wanted.below:
        return whole
    if bound > wanted.below and whole.known:
        raise certificates.unreachable_norm_error(wanted, bound, norm, whole.how)
    kind, remedy = "controller", "allow more work with effort"
    if full_state:
        kind, remedy = "gain", "leave out what else is asked for (gain_bound, pole_region)"
    raise SolverError(
        f"No {kind} with {wanted.in_words()} was found; the best one that is certified has the "
        f"{certificates.norm_in_words(norm)} norm {certificate.achieved:.6g}, and "
        f"{whole.lower_bound_note or 'no lower bound is known'}. Ask for a larger gamma, or "
        f"{remedy}."
    )


def check_arguments(
    plant: Any,
    norm: str,
    method: str,
    methods: Iterable[str],
    backend: str,
    tolerance: float,
    time_limit: float,
) -> None:
    """Check what every method of this kind is given.

    Raises
    ------
    InvalidInputError
        If an argument is wrong.
    """
    remedy = "Build one with GeneralizedPlant(system, measurements=..., controls=...)."
    instance_of("plant", plant, GeneralizedPlant, "a GeneralizedPlant", remedy)
    one_of("norm", norm, ("hinf", "h2"))
    one_of("method", method, tuple(methods))
    one_of("backend", backend, BACKENDS)
    positive("tolerance", tolerance)
    positive("time_limit", time_limit, "s")


def time_limit_note(budget: Budget) -> str:
    """Say that the safety net was reached, if it was, and what to do about it."""
    if not budget.was_late:
        return ""
    return (
        f" The safety net of {budget.seconds:g} s stopped the search, so that another machine "
        "may find something else; allow more with time_limit."
    )


def combined_norm(norms: Iterable[float], norm: certificates.Norm) -> float:
    """Return the norm of a whole from those of its decoupled parts."""
    return float(max(norms, default=0.0) if norm == "hinf" else np.linalg.norm([*norms]))


def _listed(names: Iterable[str]) -> str:
    return " and ".join(dict.fromkeys(names))
