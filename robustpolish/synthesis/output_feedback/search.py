"""The search on one decoupled part of a plant: scaled, shortened where it is large, solved."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, NamedTuple

import control
import numpy as np
from scipy import linalg

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.budget import Budget, DeadlineError, partial_deadline, step_cost
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import Certificate, Norm, certify, unreachable_norm_error
from robustpolish.synthesis.output_feedback.engine import (
    POLICY,
    Candidate,
    Engine,
    EngineResult,
    Settings,
    Task,
    check_candidate,
)
from robustpolish.synthesis.output_feedback.lmi import LmiH2, LmiHinf, Slycot
from robustpolish.synthesis.output_feedback.riccati import Lqg, RegularisedRiccati
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices
from robustpolish.synthesis.problem.preflight import SolvabilityCheck
from robustpolish.synthesis.problem.scaling import SolverPlant, truncated
from robustpolish.synthesis.problem.status import Status
from robustpolish.synthesis.riccati.gamma import (
    LowerBound,
    estimated_lower_bound,
    is_out_of_reach,
    lower_bound,
)
from robustpolish.synthesis.riccati.lqg import cancel_feedthrough, h2_lower_bound

# From the findings of the engines to one certified controller for a part of a plant.


@dataclass(frozen=True, eq=False)
class ChosenController:
    """A certified controller of one part, in the plant's units, and what its method claimed."""

    controller: control.StateSpace
    certificate: Certificate
    claim: float
    findings: EngineResult
    status: Status
    bound: LowerBound | None


def choose_controller(
    part: SolverPlant,
    problem: Task,
    searches: Sequence[EngineResult],
    enough: float,
    budget: Budget,
) -> tuple[ChosenController | None, list[str]]:
    """Pick the smallest gain among the controllers near the infimum, and certify it.

    Parameters
    ----------
    part : SolverPlant
    problem : Task
    searches : sequence of Found
    enough : float
        A norm, in the plant's units, below which a falling search need not go.
    budget : Budget
        For shortening controllers; certificates are computed in any case.

    Returns
    -------
    chosen : Chosen or None
    reasons : list of str
        Why controllers were refused.
    """
    owners = {id(c): found for found in searches for c in found.candidates}
    everything = [c for found in searches for c in found.candidates]
    best = min((c.achieved for c in everything), default=np.inf)
    level = _zero_level(searches, enough / part.norm(1.0, problem.norm))
    limit = max(_limit(problem, best), level)
    bound = problem.bound
    bound = bound and bound._replace(value=part.norm(bound.value, problem.norm))
    reasons: list[str] = []
    spare: list[ChosenController] = []
    ranked = _ranked(everything, limit, few=level == limit)
    for trial in _spaced_trials(len(ranked)):
        candidate = ranked[trial]
        last = bool(trial) and budget.over
        if last:
            # The last chance goes to the gentlest controller, the easiest one to prove.
            candidate = min(everything, key=lambda c: c.gain)
        owner = owners[id(candidate)]
        short = _remove_modes(
            problem, candidate, _reduction_limit(problem, candidate, limit), budget
        )
        for each in (short, candidate) if short is not candidate else (candidate,):
            budget.spend(POLICY.certificate_work * step_cost(part.matrices.nx + each.order))
            try:
                with partial_deadline(1.0 if last else POLICY.first_proof):
                    found = _certified(part, each, problem, reasons)
            except DeadlineError:
                reasons.append("the time was over before its certificate was complete")
                budget.update_late()
                continue
            if found is None:
                continue
            claim = part.norm(candidate.promise, problem.norm)
            unit = part.norm(1.0, problem.norm)
            achieved = found[1].achieved / unit
            kept = found[1].bound <= problem.wanted.below * unit
            if achieved <= each.achieved * (1 + 1e-3) and kept:
                status = _status(problem, searches, achieved)
                done = ChosenController(*found, claim, owner, status, bound)
                # The gentlest controller is no better than one that misses what was seen of it.
                return _best([done, *spare]) if last else done, reasons
            # Its loop is worse in the plant's own units than the search saw in scaled ones.
            spare.append(ChosenController(*found, claim, owner, "suboptimal", bound))
        if last:
            break
    return _best(spare), reasons


def _best(certified: Sequence[ChosenController]) -> ChosenController | None:
    return min(certified, key=lambda c: c.certificate.achieved, default=None)


def _limit(problem: Task, best: float) -> float:
    """Return the norm up to which a smaller gain is preferred to a smaller norm."""
    if problem.norm == "h2":
        return best * (1 + min(problem.tolerance, POLICY.h2_tolerance))
    if best <= problem.goal:
        return problem.goal
    # What is given away counts from the infimum: beyond the tolerance nothing is.
    known = problem.bound is not None and problem.bound.value > 0
    return best * (1 + (POLICY.settled if known else problem.tolerance))


def _reduction_limit(problem: Task, candidate: Candidate, limit: float) -> float:
    """Return the norm up to which a controller may be shortened.

    Within a norm that was asked for by far more than the tolerance the central controller is
    wanted, not the shortest one that just keeps it.
    """
    if problem.asked:
        limit = min(limit, candidate.achieved * (1 + problem.tolerance))
    return max(limit, candidate.achieved)


def _ranked(candidates: Sequence[Candidate], limit: float, few: bool) -> list[Candidate]:
    """Sort candidates: those within the limit by gain and then order, the others by norm.

    Where a `few` of those within the limit will do, because it lies far above the best norm, the
    third and later ones come last.
    """
    within = [c for c in candidates if c.achieved <= limit]
    within.sort(key=lambda c: (c.gain, c.order))
    above = sorted((c for c in candidates if c.achieved > limit), key=lambda c: c.achieved)
    # Far below the level loops are ever harder to prove, above it ever easier.
    first = within[:2] if few else within
    return [*first, *above, *within[len(first) :]]


def _spaced_trials(count: int) -> list[int]:
    """Skip ever more where one refusal follows the other, for neighbours fail alike."""
    steps = [0, 1, 2, 3, 5, 8, 12, 17, 23, 30, 40, 55, 75]
    return [i for i in steps if i < count]


def _certified(
    part: SolverPlant, candidate: Candidate, problem: Task, reasons: list[str]
) -> tuple[control.StateSpace, Certificate] | None:
    K = part.controller(candidate.controller)
    if K is None:
        reasons.append("the loop with D22 is not well posed")
        return None
    certificate = certify(part.original, K, problem.norm)
    loose = certificate.bound > (1 + 2e-3) * certificate.achieved
    if certificate.valid and not loose:
        # The promise of the method, or what its loop has, if that is more.
        promised = part.norm(candidate.promise, problem.norm)
        return K, certificate.with_claim(max(promised, certificate.achieved))
    reasons += certificate.reasons or [f"only the bound {certificate.bound:.6g} could be proven"]
    return None


def _zero_level(searches: Sequence[EngineResult], enough: float) -> float:
    """Return the norm below which a falling search need not go; zero if none is falling."""
    falling = [found for found in searches if found.falling and found.candidates]
    if not falling:
        return 0.0
    best = min(found.best for found in falling)
    zero = POLICY.as_good_as_zero * max(found.candidates[0].achieved for found in falling)
    # A single part, or the one that decides the norm of the whole, has to do its best.
    return max(zero, enough if enough > 2 * best else 0.0)


def _status(problem: Task, searches: Sequence[EngineResult], achieved: float) -> Status:
    bound = problem.bound
    near = bound is not None and achieved <= bound.value * (1 + problem.tolerance)
    # An estimate of the infimum may lie above it.
    if bound is not None and bound.proven and near:
        return "optimal"
    return "infimum_not_attained" if any(found.falling for found in searches) else "suboptimal"


def _remove_modes(problem: Task, candidate: Candidate, limit: float, budget: Budget) -> Candidate:
    """Remove modes of the controller while the norm of its loop stays below a limit.

    Near the optimum the central controller has a mode that runs away; elsewhere modes
    cancel against each other or against the plant. Both cost gain and order for nothing.
    The last controller whose norm is below the limit is returned, perhaps `candidate` itself.
    """
    current = candidate
    if candidate.order > POLICY.costly_states:
        return _remove_fast_modes(problem, candidate, limit, budget)
    while current.order and not budget.over:
        trials = _reductions(current.controller, problem.norm)
        shorter = _first_acceptable(problem, trials, current, limit, budget)
        if shorter is None:
            break
        current = shorter
    return current


def _remove_fast_modes(
    problem: Task, current: Candidate, limit: float, budget: Budget
) -> Candidate:
    """Remove the fastest half, quarter or eighth of many modes, for every trial takes long."""
    speeds = np.sort(np.abs(np.linalg.eigvals(current.controller.A)))
    n = len(speeds)
    for count in (n // 2, n // 4, n // 8):
        # Between two speeds, so that no pair is torn apart.
        bound = float(np.sqrt(speeds[n - count] * speeds[n - count - 1])) if count < n else 0.0
        trials = _truncate_modes(
            current.controller, lambda v, b=bound: np.abs(v) > b, residualise=problem.norm == "hinf"
        )
        shorter = _first_acceptable(problem, trials, current, limit, budget)
        if shorter is not None:
            return shorter
    return current


def _first_acceptable(
    problem: Task, trials: Iterator[Controller], current: Candidate, limit: float, budget: Budget
) -> Candidate | None:
    """Return the first trial within the limit whose gain is not much larger than the current."""
    for K in trials:
        if budget.over:
            return None
        found = check_candidate(problem, K, limit, current.origin, budget)
        if found is not None and found.achieved <= limit and found.gain <= 1.5 * current.gain:
            return found
    return None


def _reductions(K: Controller, norm: str) -> Iterator[Controller]:
    """Propose controllers with one mode less: without the fastest, without the weakest."""
    values = np.linalg.eigvals(K.A)
    fastest = np.abs(values).max()
    yield from _truncate_modes(K, lambda v: np.abs(v) > 0.9 * fastest, residualise=norm == "hinf")
    weakest = _weakest_mode(K, values)
    if weakest is not None:
        close = 1e-9 * fastest
        yield from _truncate_modes(
            K,
            lambda v: (np.abs(v - weakest) <= close) | (np.abs(v - weakest.conjugate()) <= close),
            residualise=False,
        )


def _weakest_mode(K: Controller, values: Any) -> complex | None:
    """Return the eigenvalue whose mode adds least to the controller's response."""
    _, vectors = np.linalg.eig(K.A)
    try:
        left = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        return None
    damping = np.maximum(np.abs(values.real), 1e-12 * np.abs(values).max())
    size = np.linalg.norm(K.C @ vectors, axis=0) * np.linalg.norm(left @ K.B, axis=1) / damping
    i = int(np.argmin(size))
    return complex(values[i]) if size[i] <= 1e-2 * size.max() else None


def _truncate_modes(
    K: Controller, removed: Callable[[Any], Any], residualise: bool
) -> Iterator[Controller]:
    """Split off the modes that `removed` selects and drop them, perhaps keeping their gain."""
    try:
        T, Z, kept = linalg.schur(  # type: ignore[misc]
            K.A, output="real", sort=lambda re, im: not removed(np.array(complex(re, im)))
        )
        n = len(T)
        if kept == n:
            return
        slow, fast = slice(0, kept), slice(kept, n)
        X = linalg.solve_sylvester(T[slow, slow], -T[fast, fast], -T[slow, fast])
        B, C = Z.T @ K.B, K.C @ Z
        B_slow, C_fast = B[slow] - X @ B[fast], C[:, fast] + C[:, slow] @ X
        D = K.D
        if residualise:
            D = D - C_fast @ np.linalg.solve(T[fast, fast], B[fast])
    except (linalg.LinAlgError, ValueError):
        return
    yield Controller(T[slow, slow], B_slow, C[:, slow], D)


# The engines of output feedback, and the order in which each method calls them.
#
# To add one, write a subclass of :class:`~robustpolish.synthesis.output_feedback.engine.Engine` in
# a file of its own and name it here.

METHODS = ("auto", "riccati", "lmi", "slycot")
ENGINE_ORDER: Mapping[tuple[Norm, str], tuple[type[Engine], ...]] = MappingProxyType(
    {
        ("hinf", "auto"): (RegularisedRiccati, LmiHinf),
        ("hinf", "riccati"): (RegularisedRiccati,),
        ("hinf", "lmi"): (LmiHinf,),
        ("hinf", "slycot"): (Slycot,),
        ("h2", "auto"): (Lqg,),
        ("h2", "riccati"): (Lqg,),
        ("h2", "lmi"): (LmiH2,),
        ("h2", "slycot"): (Slycot,),
    }
)


@dataclass(frozen=True, eq=False)
class PartSearch:
    """One part in the units of the engines, what they found, and the work left to choose.

    Attributes
    ----------
    part : SolverPlant
    settings : Settings
    diagnosis : SolvabilityCheck
    budget : Budget
    problem : Task
        Of fewer states than the part where that is harmless.
    searches : tuple of Found
    """

    part: SolverPlant
    settings: Settings
    diagnosis: SolvabilityCheck
    budget: Budget
    problem: Task
    searches: tuple[EngineResult, ...]

    @classmethod
    def of(
        cls,
        plant: GeneralizedPlant,
        settings: Settings,
        diagnosis: SolvabilityCheck,
        budget: Budget,
        shorten: bool = True,
    ) -> PartSearch:
        """Scale a part, bound its norm from below and let the engines search.

        Parameters
        ----------
        plant : GeneralizedPlant
        settings : Settings
        diagnosis : SolvabilityCheck
        budget : Budget
        shorten : bool
            Whether states that hardly count may be left out of a large plant.
        """
        norm, work = settings.norm, budget.share(POLICY.search_share)
        part = SolverPlant.of(plant, mapped=norm == "hinf")
        wanted = settings.wanted.in_unit(part.norm(1.0, norm))
        stated = _with_lower_bound(part.matrices, settings, work, shorten)
        bound = stated.bound
        if bound is not None and bound.value > wanted.below and bound.proven:
            raise unreachable_norm_error(
                settings.wanted, part.norm(bound.value, norm), norm, bound.how
            )
        regular, tolerance = diagnosis.regular_feedthrough, settings.tolerance
        problem = Task(stated.plant, norm, regular, tolerance, bound, wanted)
        searches: list[EngineResult] = []
        for engine in (kind(settings) for kind in ENGINE_ORDER[norm, settings.method]):
            if any(found.best <= problem.goal for found in searches):
                break
            if engine.is_useful(problem, searches):
                searches.append(engine.search(problem, work))
        if stated.remark:
            if not _truncation_is_harmless(problem, searches, part.matrices, work):
                return cls.of(plant, settings, diagnosis, budget, shorten=False)
            searches[0].remarks.append(stated.remark)
        if work.exhausted:
            searches[-1].remarks.append("The work allowed was spent; allow more with effort.")
        best = min(found.best for found in searches)
        if bound is not None and best < bound.value * (1 - POLICY.spoilt):
            problem = replace(problem, bound=None)
        if stated.feedback is not None and stated.feedback.any():
            problem = replace(problem, plant=part.matrices)
            for found in searches:
                found.candidates = [
                    c.with_inner_feedback(stated.feedback) for c in found.candidates
                ]
        return cls(part, settings, diagnosis, budget, problem, tuple(searches))

    @property
    def shortened(self) -> bool:
        """Whether states were left out."""
        return self.problem.plant.nx < self.part.matrices.nx

    def with_all_states(self) -> PartSearch:
        """Search again, with the states that were left out."""
        given = self.part.original, self.settings, self.diagnosis, self.budget
        return PartSearch.of(*given, shorten=False)

    @property
    def best(self) -> float:
        """The smallest norm found, in the plant's units; zero if none was found."""
        found = min((search.best for search in self.searches), default=np.inf)
        return self.part.norm(found, self.problem.norm) if np.isfinite(found) else 0.0


class _PlantWithBound(NamedTuple):
    """The plant that is searched, and a norm below which none of its loops comes.

    ``feedback`` cancels a feedthrough; ``remark`` tells what was left out, "" for nothing.
    """

    plant: PlantMatrices
    bound: LowerBound | None
    feedback: Matrix | None = None
    remark: str = ""


def _with_lower_bound(
    plant: PlantMatrices, settings: Settings, budget: Budget, shorten: bool
) -> _PlantWithBound:
    """Bound the norm from below, without the feedthrough or without what hardly counts."""
    if settings.norm == "h2":
        plant, feedback = cancel_feedthrough(plant)
        return _PlantWithBound(plant, h2_lower_bound(plant), feedback)
    accuracy = POLICY.bound_accuracy * min(settings.tolerance, 1e-2)
    if shorten and plant.nx > POLICY.truncated_states:
        short = _truncated_plant(plant, settings.tolerance, accuracy, budget)
        if short is not None:
            return short
    return _PlantWithBound(plant, lower_bound(plant, accuracy, budget))


def _truncated_plant(
    plant: PlantMatrices, tolerance: float, accuracy: float, budget: Budget
) -> _PlantWithBound | None:
    """Leave out what hardly counts; None unless the bound holds for the whole plant too."""
    short = truncated(plant)
    if short is None:
        return None
    bound = estimated_lower_bound(short.plant, accuracy, budget)
    budget.spend(step_cost(plant.nx))
    if bound is None or not is_out_of_reach(plant, bound.value * (1 - tolerance / 10)):
        return None
    few = f"of {short.plant.nx} of the {plant.nx} states"
    remark = (
        f"The equations are {few}; the others change the response by at most {short.error:.2g} in "
        "scaled units (Hankel bound)."
    )
    bound = bound._replace(how=f"{bound.how} {few}", proven=False)
    return _PlantWithBound(short.plant, bound, remark=remark)


def _truncation_is_harmless(
    problem: Task, searches: Sequence[EngineResult], whole: PlantMatrices, budget: Budget
) -> bool:
    """Tell whether the best loop has the same norm with the whole plant."""
    candidates = [c for found in searches for c in found.candidates]
    best = min(candidates, key=lambda c: c.achieved, default=None)
    if best is None:
        return False
    true = replace(problem, plant=whole)
    seen = check_candidate(true, best.controller, best.claimed, best.origin, budget)
    return seen is not None and (
        abs(seen.achieved - best.achieved) <= POLICY.harmless * best.achieved
    )
