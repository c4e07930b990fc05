"""The driver of feedback synthesis: split, scale, search, choose, certify, join.

State feedback is the same task with y = x and a static gain. Every part of the plant that shares
no signal with the others is searched alone by the engines of
:class:`~robustpolish.synthesis.engine.Engine`; one certified controller is chosen for it, and the
whole is certified afresh in the plant's own units.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

import control
import numpy as np
from scipy import linalg

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.budget import Budget, DeadlineError, partial_deadline, step_cost
from robustpolish.errors import SolverError
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import (
    ANY_NORM,
    Certificate,
    Norm,
    certify,
    norm_in_words,
    unreachable_norm_error,
)
from robustpolish.synthesis.design import Design
from robustpolish.synthesis.engine import (
    POLICY,
    Candidate,
    EngineResult,
    Settings,
    Task,
    check_candidate,
)
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices
from robustpolish.synthesis.problem.preflight import (
    SolvabilityCheck,
    Status,
    refuse_unstable,
    worst_status,
)
from robustpolish.synthesis.problem.scaling import (
    PlantPart,
    SolverPlant,
    joined_controller,
    truncated,
    with_dummy_signals,
)
from robustpolish.synthesis.riccati.gamma import (
    LowerBound,
    estimated_lower_bound,
    is_out_of_reach,
    lower_bound,
)
from robustpolish.synthesis.riccati.lqg import (
    cancel_feedthrough,
    h2_lower_bound,
    no_finite_h2_norm,
)

# From the findings of the engines to one certified controller for a part of a plant.


@dataclass(frozen=True, eq=False)
class ChosenController:
    """A controller of one part, in the plant's units, and what its method claimed.

    It is certified, unless only the whole is to be.
    """

    controller: control.StateSpace
    certificate: Certificate | None
    claim: float
    findings: EngineResult
    status: Status
    bound: LowerBound | None

    @property
    def achieved(self) -> float:
        """The certified norm; infinite without a certificate."""
        return np.inf if self.certificate is None else self.certificate.achieved

    @property
    def promised(self) -> float:
        """A norm that the loop keeps."""
        return self.claim if self.certificate is None else self.certificate.claimed or 0.0


def choose_controller(
    part: SolverPlant,
    problem: Task,
    searches: Sequence[EngineResult],
    enough: float,
    budget: Budget,
    prove: bool = True,
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
    prove : bool
        Whether the controller of the part has to be certified alone.

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
        claim = part.norm(candidate.promise, problem.norm)
        K = None if prove else part.controller(candidate.controller)
        if K is not None:
            status = _status(problem, searches, candidate.achieved)
            return ChosenController(K, None, claim, owner, status, bound), reasons
        for each in (short, candidate) if short is not candidate else (candidate,):
            # Work of one certificate, in steps on the loop's size.
            budget.spend(20.0 * step_cost(part.matrices.nx + each.order))
            try:
                # Share of the time left that a certificate may take while a gentler controller
                # could follow.
                with partial_deadline(1.0 if last else 2 / 3):
                    found = _certified(part, each, problem, reasons)
            except DeadlineError:
                reasons.append("the time was over before its certificate was complete")
                budget.update_late()
                continue
            objections = owner.objections(*found, claim) if found is not None else ()
            if found is None or objections:
                reasons += objections
                continue
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
    return min(certified, key=lambda c: c.achieved, default=None)


def _limit(problem: Task, best: float) -> float:
    """Return the norm up to which a smaller gain is preferred to a smaller norm."""
    if problem.norm == "h2":
        # How much of the H2 norm may be given away: the optimum is known exactly, so little.
        return best * (1 + min(problem.tolerance, 2e-5))
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
    near = near and not any(found.constrained for found in searches)
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


# The search on one decoupled part: scaled, shortened where it is large, solved.


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
        # Share of the work that engines may spend; the rest shortens controllers.
        norm, work = settings.norm, budget.share(0.7)
        part = SolverPlant.of(plant, norm == "hinf", settings.full_state)
        wanted = settings.wanted.in_unit(part.norm(1.0, norm))
        stated = _PlantWithBound(part.matrices, None)
        if not settings.full_state:
            stated = _with_lower_bound(part.matrices, settings, work, shorten)
        bound = stated.bound
        if bound is not None and bound.value > wanted.below and bound.proven:
            raise unreachable_norm_error(
                settings.wanted, part.norm(bound.value, norm), norm, bound.how
            )
        regular, tolerance = diagnosis.regular_feedthrough, settings.tolerance
        problem = Task(stated.plant, norm, regular, tolerance, bound, wanted, part.scaled)
        searches: list[EngineResult] = []
        for engine in (kind(settings) for kind in settings.engines):
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
        # A norm this much, relative, below an estimate of the infimum shows that rounding spoilt
        # it.
        if bound is not None and best < bound.value * (1 - 1e-5):
            problem = replace(problem, bound=None)
        if settings.full_state:
            problem = replace(problem, bound=searches[-1].bound)
        if stated.feedback is not None and stated.feedback.any():
            problem = replace(problem, plant=part.matrices)
            for found in searches:
                found.candidates = [
                    c.with_inner_feedback(stated.feedback) for c in found.candidates
                ]
        return cls(part, settings, diagnosis, budget, problem, tuple(searches))

    def again(self) -> PartSearch | None:
        """Search with the states that were left out, or further away from the optimum.

        None if nothing else is left to be tried.
        """
        settings = self.settings
        if self.problem.plant.nx == self.part.matrices.nx:
            settings = replace(settings, relaxations=settings.relaxations[1:])
            if not settings.relaxations or self.budget.over:
                return None
        given = self.part.original, settings, self.diagnosis, self.budget
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
    # How finely the lower bound is searched, as a share of the tolerance.
    accuracy = 0.03 * min(settings.tolerance, 1e-2)
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
    parts : sequence of PlantPart
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
    parts: Sequence[PlantPart]
    settings: Settings
    budget: Budget
    chosen: Sequence[ChosenController | None]
    controller: control.StateSpace
    certificate: Certificate
    bound: float

    @property
    def done(self) -> list[ChosenController]:
        """The controllers of the parts that have one."""
        return [c for c in self.chosen if c is not None]

    @property
    def known(self) -> bool:
        """Whether the infimum of some part is bounded from below, and of none only estimated."""
        bounds = [c.bound for c in self.done if c.bound is not None]
        return bool(bounds) and all(b.proven for b in bounds)

    @property
    def how(self) -> str:
        """How the bound is known; "" if there is none."""
        bounds = [c.bound for c in self.done if c.bound is not None]
        return " and ".join(dict.fromkeys(b.how for b in bounds))

    @property
    def lower_bound_note(self) -> str:
        """How low the norm can be, in words; "" if that is not known."""
        if not self.how:
            return ""
        if self.known:
            kind = "gain" if self.settings.full_state else "controller"
            return f"no {kind} comes below {self.bound:.6g}, {self.how}"
        return f"the infimum may be near {self.bound:.6g}, {self.how}, which is no bound"

    @property
    def status(self) -> Status:
        """The status of the whole: that of the parts that decide its norm."""
        achieved, done = self.certificate.achieved, self.done
        if self.budget.was_late:
            return "time_limit"
        near = achieved <= self.bound * (1 + self.settings.tolerance)
        if self.settings.full_state:
            worst = worst_status(c.status for c in done)
            return "suboptimal" if worst == "optimal" and not near else worst
        if self.known and near:
            return "optimal"
        largest = max((c.achieved for c in done), default=0.0)
        return worst_status(
            c.status for c in done if self.settings.norm == "h2" or c.achieved >= 0.99 * largest
        )

    def combined(self, norms: Iterable[float]) -> float:
        """Return the norm of the whole from those of its decoupled parts."""
        return _combined_norm(norms, self.settings.norm)

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
            method=" and ".join(dict.fromkeys(c.findings.method for c in done))
            or self.settings.method,
            backend=" and ".join(dict.fromkeys(c.findings.backend for c in done)) or "scipy",
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
    parts: Sequence[PlantPart],
    settings: Settings,
    diagnosis: SolvabilityCheck,
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
    keys, searched = _search_parts(parts, settings, diagnosis, budget)
    # No part has to be much better than the one that decides the norm of the whole.
    enough = 0.01 * max((s.best for s in searched.values()), default=0.0)
    # A static gain is certified with the whole alone, and part by part only where that fails.
    for prove in (False, True) if settings.full_state and len(parts) > 1 else (True,):
        choices = {k: _choose(s, diagnosis, enough, prove) for k, s in searched.items()}
        chosen = [None if key is None else choices[key] for key in keys]
        done = [c for c in chosen if c is not None]
        controller = joined_controller(plant, parts, [c and c.controller for c in chosen])
        idle = _open_loop_norms(parts, chosen, settings.norm)
        own = [part.plant.nx for part, c in zip(parts, chosen, strict=True) if c is not None]
        certificate = done[0].certificate if own == [plant.nx] and not idle else None
        # The whole loop of a single part has been certified with it.
        if certificate is None or plant.delays:
            promised = _combined_norm([*(c.promised for c in done), *idle], settings.norm)
            certificate = certify(plant, controller, settings.norm, promised)
            reasons = list(certificate.reasons)
            for c in done[:1]:
                reasons += c.findings.objections(controller, certificate, promised)
            if reasons and not prove:
                continue
            if reasons:
                raise SolverError(
                    "The controllers of the parts are certified, the whole is not: "
                    + "; ".join(reasons)
                )
        bounds = [c.bound.value for c in done if c.bound]
        bound = _combined_norm([*bounds, *idle], settings.norm)
        whole = JoinedController(
            plant, parts, settings, budget, chosen, controller, certificate, bound
        )
        break
    _require_target(whole)  # pyright: ignore[reportPossiblyUnboundVariable]
    return whole  # pyright: ignore[reportPossiblyUnboundVariable]


def _search_parts(
    parts: Sequence[PlantPart], settings: Settings, diagnosis: SolvabilityCheck, budget: Budget
) -> tuple[list[_Key | None], dict[_Key, PartSearch]]:
    """Search every decoupled part with its share of the work; return their keys, and searches."""
    problems: list[tuple[_Key, float, GeneralizedPlant]] = []
    keys: list[_Key | None] = []
    for part in parts:
        P = part.plant
        if P.nu and P.ny:
            keys.append(PlantMatrices.of(P).fingerprint)
            problems.append((keys[-1] or (), P.nx**2 + 1, P))
            continue
        refuse_unstable(P)
        if settings.norm == "h2" and not P.is_discrete and P.D11.any():
            raise no_finite_h2_norm()
        keys.append(None)
    # Norms of parts add up for the H2 norm, so that only a single one can be told.
    if settings.norm == "h2" and len(parts) > 1:
        settings = replace(settings, wanted=ANY_NORM)
    searched = solve_each_once(
        problems,
        budget,
        lambda P, share: PartSearch.of(with_dummy_signals(P), settings, diagnosis, share),
    )
    return keys, searched


def _choose(
    search: PartSearch, diagnosis: SolvabilityCheck, enough: float, prove: bool
) -> ChosenController:
    given = search.part, search.problem, search.searches, enough, search.budget
    chosen, reasons = choose_controller(*given, prove)
    if chosen is not None:
        return chosen
    again = search.again()
    if again is not None:
        return _choose(again, diagnosis, enough, prove)
    why = "; ".join(dict.fromkeys(reasons)) or "no engine found a stabilising controller"
    if search.settings.full_state:
        raise SolverError(
            f"A gain was found, but its certificate fails: {why}. "
            "Try the other method or backend, a larger control_weight or a gain_bound."
        )
    remarks = [remark for found in search.searches for remark in found.remarks]
    original = search.part.original
    if search.problem.norm == "h2" and not original.is_discrete and original.D11.any():
        remarks.append(
            "The feedthrough D11 can be cancelled up to rounding only, which leaves the H2 norm "
            "infinite. Filter w or z so that D11 vanishes, or use norm='hinf'."
        )
    remarks += [f"It has the {mode}." for mode in diagnosis.fixed_modes]
    more = time_limit_note(search.budget)
    raise SolverError(" ".join([f"No certified controller was found: {why}.{more}", *remarks]))


def time_limit_note(budget: Budget) -> str:
    """Say that the safety net was reached, if it was, and what to do about it."""
    if not budget.was_late:
        return ""
    return (
        f" The safety net of {budget.seconds:g} s stopped the search, so that another machine "
        "may find something else; allow more with time_limit."
    )


def _open_loop_norms(
    parts: Sequence[PlantPart], chosen: Sequence[ChosenController | None], norm: Norm
) -> list[float]:
    """Return the norms of the parts without control, except those in which nothing happens."""
    size = hinf_norm if norm == "hinf" else h2_norm
    idle = [part.plant for part, c in zip(parts, chosen, strict=True) if c is None]
    return [float(size(P.open_loop)) for P in idle if P.nw and P.nz and (P.nx or P.D11.any())]


def _combined_norm(norms: Iterable[float], norm: Norm) -> float:
    """Return the norm of a whole from those of its decoupled parts."""
    return float(max(norms, default=0.0) if norm == "hinf" else np.linalg.norm([*norms]))


def _require_target(whole: JoinedController) -> None:
    """Refuse a controller that does not keep what was asked for."""
    wanted, certificate = whole.settings.wanted, whole.certificate
    if certificate.bound <= wanted.below:
        return
    if whole.bound > wanted.below and whole.known:
        raise unreachable_norm_error(wanted, whole.bound, certificate.norm, whole.how)
    kind, remedy = "controller", "allow more work with effort"
    if whole.settings.full_state:
        kind, remedy = "gain", "leave out what else is asked for (gain_bound, pole_region)"
    raise SolverError(
        f"No {kind} with {wanted.in_words()} was found; the best one that is certified has the "
        f"{norm_in_words(certificate.norm)} norm {certificate.achieved:.6g}, and "
        f"{whole.lower_bound_note or 'no lower bound is known'}. Ask for a larger gamma, or "
        f"{remedy}."
    )
