"""From the findings of the engines to one certified controller for a part of a plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import control
import numpy as np

from robustpolish.synthesis.certificate.certificate import Certificate, Norm, certify
from robustpolish.synthesis.design.status import Status
from robustpolish.synthesis.output_search.candidates import Candidate, Findings, preferred
from robustpolish.synthesis.output_search.simplification import simplify
from robustpolish.synthesis.problem.deadline import Deadline
from robustpolish.synthesis.problem.solver_plant import SolverPlant

# An infimum that is approached without end counts as zero below this share of the norm at the
# start of the descent; smaller norms would cost gain for nothing.
_AS_GOOD_AS_ZERO = 1e-6
# Matrix inequalities have been backed off from their optimum already.
_AFTER_BACK_OFF = 2e-3


@dataclass(frozen=True, eq=False)
class Chosen:
    """A certified controller of one part, in the plant's units, and what its method claimed."""

    controller: control.StateSpace
    certificate: Certificate
    claim: float
    findings: Findings
    candidate: Candidate
    status: Status


def choose(
    problem: SolverPlant,
    searches: Sequence[Findings],
    norm: Norm,
    tolerance: float,
    enough: float,
    deadline: Deadline,
) -> tuple[Chosen | None, list[str]]:
    """Pick the smallest gain among the controllers near the best norm, and certify it.

    Parameters
    ----------
    problem : SolverPlant
    searches : sequence of Findings
    norm : {"hinf", "h2"}
    tolerance : float
        How far above the best norm, relative, a smaller gain is preferred to a smaller norm.
    enough : float
        A norm, in the plant's units, below which a falling search need not go.
    deadline : Deadline
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
    level = _zero_level(searches, enough / problem.norm(1.0, norm))
    if all(found.method == "lmi" for found in searches):
        tolerance = min(tolerance, _AFTER_BACK_OFF)
    limit = max(best * (1 + tolerance), level)
    reasons: list[str] = []
    spare: list[Chosen] = []
    ranked = preferred(everything, tolerance, level)
    for trial in _trials(len(ranked)):
        candidate = ranked[trial]
        if trial and deadline.expired:
            # The last chance goes to the gentlest controller, the easiest one to prove.
            candidate = min(everything, key=lambda c: c.gain)
        bound = max(limit, candidate.achieved)
        short = simplify(problem.matrices, candidate, bound, deadline, norm)
        for each in (short, candidate) if short is not candidate else (candidate,):
            found = _certified(problem, each, norm, reasons)
            if found is None:
                continue
            owner = owners[id(candidate)]
            # LQG promises no number; what it achieves is its claim.
            promised = candidate.claimed if np.isfinite(candidate.claimed) else candidate.achieved
            claim = problem.norm(promised, norm)
            if found[1].achieved <= problem.norm(each.achieved, norm) * (1 + 1e-3):
                status = _status(owner, searches, each, best)
                return Chosen(*found, claim, owner, each, status), reasons
            # Its loop is worse in the plant's own units than the search saw in scaled ones.
            spare.append(Chosen(*found, claim, owner, each, "suboptimal"))
        if trial and deadline.expired:
            break
    return min(spare, key=lambda c: c.certificate.achieved, default=None), reasons


def _trials(count: int) -> list[int]:
    """Skip ever more where one refusal follows the other, for neighbours fail alike."""
    steps = [0, 1, 2, 3, 5, 8, 12, 17, 23, 30, 40, 55, 75]
    return [i for i in steps if i < count]


def _certified(
    problem: SolverPlant, candidate: Candidate, norm: Norm, reasons: list[str]
) -> tuple[control.StateSpace, Certificate] | None:
    K = problem.controller(candidate.controller)
    if K is None:
        reasons.append("the loop with D22 is not well posed")
        return None
    certificate = certify(problem.original, K, norm)
    loose = certificate.bound > (1 + 2e-3) * certificate.achieved
    if certificate.valid and not loose:
        # The promise of the method, or what its loop has, if that is more.
        promised = candidate.claimed if np.isfinite(candidate.claimed) else candidate.achieved
        return K, certificate.with_claim(max(problem.norm(promised, norm), certificate.achieved))
    reasons += certificate.reasons or [f"only the bound {certificate.bound:.6g} could be proven"]
    return None


def _zero_level(searches: Sequence[Findings], enough: float) -> float:
    """Return the norm below which a falling search need not go; zero if none is falling."""
    falling = [found for found in searches if found.falling and found.candidates]
    if not falling:
        return 0.0
    best = min(found.best for found in falling)
    zero = _AS_GOOD_AS_ZERO * max(found.candidates[0].achieved for found in falling)
    # A single part, or the one that decides the norm of the whole, has to do its best.
    return max(zero, enough if enough > 2 * best else 0.0)


def _status(
    owner: Findings, searches: Sequence[Findings], chosen: Candidate, best: float
) -> Status:
    if any(found.falling and not found.expired for found in searches):
        return "infimum_not_attained"
    if owner.expired:
        return "time_limit"
    settled = any(found.converged for found in searches)
    return "optimal" if settled and chosen.achieved <= 1.01 * best else "suboptimal"
