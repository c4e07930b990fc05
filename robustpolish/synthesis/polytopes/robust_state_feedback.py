"""State feedback for all plants of a polytope at once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal

from numpy.typing import ArrayLike

from robustpolish.deadline import OutOfTimeError, ends_with
from robustpolish.errors import SolverError
from robustpolish.long_calls import Budget, same_bits, working
from robustpolish.models import GeneralizedPlant, UncertainSystem
from robustpolish.models.plant.sorting import Chosen
from robustpolish.robust import WorstCaseGain, worst_case_gain
from robustpolish.robust.reached import up
from robustpolish.synthesis.certificate.certificate import Norm, certify
from robustpolish.synthesis.lmi.semidefinite import ProgramSolver
from robustpolish.synthesis.polytopes.family import LyapunovFamily
from robustpolish.synthesis.polytopes.feasible_part import refused_vertices, share_with_gain
from robustpolish.synthesis.polytopes.inequalities import Question
from robustpolish.synthesis.polytopes.loops import state_loop, uncertain_loop
from robustpolish.synthesis.polytopes.policy import POLICY
from robustpolish.synthesis.polytopes.proof import prove
from robustpolish.synthesis.polytopes.robust_gain import Lyapunov, RobustStateFeedback, Status
from robustpolish.synthesis.polytopes.state_gain import GainProblem, candidates
from robustpolish.synthesis.polytopes.vertices import Polytope, polytope, scaled_vertices
from robustpolish.validation import described, invalid, one_of, positive


@same_bits
def robust_state_feedback(
    plant: Sequence[GeneralizedPlant] | UncertainSystem,
    norm: Literal["hinf", "h2"] = "hinf",
    *,
    controls: Chosen | None = None,
    lyapunov: Lyapunov = "vertices",
    control_weight: ArrayLike | None = None,
    backend: Literal["cvxpy", "picos"] = "cvxpy",
    solver: str | None = None,
    time_limit: float = 300.0,
) -> RobustStateFeedback:
    r"""Design one gain u = F x for all plants of a polytope, for the smallest worst norm.

    Linear matrix inequalities with a Lyapunov matrix for each vertex and a slack that all share
    give a first gain; gain and slack are then improved in turns. What is returned is proven afresh.

    Parameters
    ----------
    plant : sequence of GeneralizedPlant, or UncertainSystem
        The vertices, of the same sizes, continuous or discrete, all states taken as measured; or a
        system with real numbers, whose vertices are the corners of their box. All its
        outputs are z.
    norm : {"hinf", "h2"}, optional
        The norm from w to z whose largest value is minimised.
    controls : int, str or sequence of str, optional
        Of an uncertain system: which inputs are u, by name, or how many of the last ones.
    lyapunov : {"vertices", "common"}, optional
        One Lyapunov matrix for each vertex, for plants that do not change with time. "common" is
        one for all (quadratic stability): it costs performance, and covers plants that move within
        the polytope however fast.
    control_weight : float or array_like, shape (nu,), optional
        Price on u in units of z per unit of u: ``control_weight * u`` joins z.
    backend, solver : str, optional
        Who solves the inequalities; "cvxpy" (with Clarabel) or "picos".
    time_limit : float, optional
        Seconds: a safety net for the search, whose work is limited otherwise; the status says if it
        was reached.

    Returns
    -------
    RobustStateFeedback

    Raises
    ------
    InvalidInputError
        If plants do not fit each other, or something else than real numbers is uncertain.
    InfeasibleError
        If a vertex has an unstable mode that no control moves; it is named.
    SolverError
        If no gain was found and proven for the whole polytope; the message tells for which part of
        it there is one.

    Notes
    -----
    Gains that exist may be missed: the inequalities are sufficient. For a list of plants
    the matrices that prove the bound are checked in ball arithmetic, for every mixture of the
    vertices. That is the whole box of an uncertain system if its matrices depend on a line
    on each number, or on a function of it such as 1 / m; otherwise the vertices only guide the
    search, and the bound is that of ``worst_case``, proven for numbers that do not change with
    time. It is taken too where it is the smaller one.

    References
    ----------
    M.C. de Oliveira, J. Bernussou, J.C. Geromel, "A new discrete-time robust stability condition",
    Systems & Control Letters 37 (1999). M.C. de Oliveira, J.C. Geromel, J. Bernussou, "Extended H2
    and H-infinity norm characterizations and controller parametrizations for discrete-time
    systems", Int. J. Control 75 (2002). U. Shaked, "Improved LMI representations for the analysis
    and the design of continuous-time systems with polytopic type uncertainty", IEEE TAC 46 (2001).

    Examples
    --------
    A mass on a spring that is known to 80 %:

    >>> import robustpolish as rp
    >>> k = rp.uncertain_real("k", 5.0, percent=80)
    >>> mass = rp.uncertain_system([[0, 1], [-k, -0.1]], [[0, 0], [1, 1]], [[1, 0]], 0)
    >>> design = rp.robust_state_feedback(mass, controls=1, control_weight=0.3)
    >>> design.status, design.worst_case.proven, bool(design.bound < 0.31)
    ('proven', True, True)
    """
    one_of("norm", norm, ("hinf", "h2"))
    one_of("lyapunov", lyapunov, ("vertices", "common"))
    positive("time_limit", time_limit)
    whole = polytope(plant, controls, None, control_weight).with_full_state()
    _check_norm(whole, norm)
    refused_vertices(whole)
    budget = Budget(POLICY.work, time_limit)
    programs = ProgramSolver(backend, solver, budget, POLICY.tolerance)
    count = len(whole.plants)
    makes = LyapunovFamily.common if lyapunov == "common" else LyapunovFamily.one_each
    with working("Designing for all vertices"), ends_with(budget):
        scaled, vertices = scaled_vertices(whole)
        problem = GainProblem(vertices, Question(makes(count), norm, vertices[0].discrete))
        for found in candidates(problem, programs):
            F = found.gains[0]
            loops = [state_loop(p, F) for p in vertices]
            proof = prove(loops, problem.question, programs, found.claimed)
            # Units are powers of two, but for the root of that of time in an H2 norm.
            bound = math.inf if proof is None else up(scaled.norm(proof.bound, norm))
            design = _judged(whole, norm, lyapunov, scaled.state_gain(F), bound, budget)
            if design is not None:
                return design
        share = share_with_gain(problem, programs)
    raise SolverError(_failure(lyapunov, share, budget.late))


def _judged(
    whole: Polytope, norm: Norm, lyapunov: Lyapunov, F: Any, bound: float, budget: Budget
) -> RobustStateFeedback | None:
    """Return the design of a gain with all that is proven of it; None if that is too little."""
    certificates = tuple(certify(p, F, norm) for p in whole.plants)
    if not all(c.valid for c in certificates):
        return None
    worst: WorstCaseGain | None = None
    loop = None
    if whole.system is not None:
        loop = uncertain_loop(whole.system, whole.plants[0].nz, F)
        worst = _worst_in_time(loop, bound) if norm == "hinf" else None
    varying = lyapunov == "common" and whole.all_mixtures and math.isfinite(bound)
    if not whole.all_mixtures:
        bound = math.inf
    if not varying and worst is not None and worst.proven:
        bound = min(bound, worst.upper)
    if whole.all_mixtures and not math.isfinite(bound):
        return None
    status: Status = "proven" if math.isfinite(bound) else "vertices only"
    if status == "proven" and budget.late:
        status = "time_limit"
    return RobustStateFeedback(
        gain=F,
        norm=norm,
        bound=bound,
        vertex_norms=tuple(c.achieved for c in certificates),
        points=whole.points,
        certificates=certificates,
        lyapunov=lyapunov,
        time_varying=varying,
        worst_case=worst,
        loop=loop,
        status=status,
        message=_message(whole, status, varying, worst),
    )


def _message(whole: Polytope, status: Status, varying: bool, worst: WorstCaseGain | None) -> str:
    if whole.all_mixtures:
        text = "The bound is proven for every mixture of the vertices"
        text += ", also if they change with time." if varying else ", unless they change with time."
    else:
        text = (
            "Not all plants of the box are mixtures of its corners, where alone the inequalities "
            "hold. "
        )
        if status == "vertices only":
            text += "Nothing is proven in between; look at rp.robust_stability(design.loop)."
        else:
            text += "The bound is that of worst_case, for numbers that do not change with time."
    if worst is not None and math.isinf(worst.upper) and worst.status == "unstable":
        text += " Some machine in between is unstable, see worst_case.witness."
    if status == "time_limit":
        text += " The time limit was reached: a better gain may exist."
    return text


def _failure(lyapunov: Lyapunov, share: float, late: bool) -> str:
    kind = "one Lyapunov matrix for all" if lyapunov == "common" else "one slack for all"
    text = f"No gain was found and proven for the whole polytope, with {kind} vertices. "
    if late:
        return text + "The time limit was reached; raise time_limit."
    text += (
        "Each vertex alone can be stabilised, but not even a small part around the middle. "
        if share == 0
        else f"For {100 * share:.0f} % of it around its middle there is one. "
    )
    other = 'Try lyapunov="vertices"' if lyapunov == "common" else "Make the ranges smaller"
    return text + f"{other}, or measure the numbers and use scheduled_feedback."


def _worst_in_time(loop: UncertainSystem, bound: float) -> WorstCaseGain | None:
    """Return the worst-case gain; None if there was no time for it and the bound is proven."""
    try:
        return worst_case_gain(loop)
    except OutOfTimeError:
        if not math.isfinite(bound):
            raise
        return None


def _check_norm(whole: Polytope, norm: Norm) -> None:
    if norm == "hinf" or whole.plants[0].is_discrete:
        return
    for name, plant in zip(whole.names, whole.plants, strict=True):
        if plant.D11.any():
            raise invalid(
                "plant",
                described(f"D11 that is not zero at {name}"),
                "no direct path from w to z, through which the H2 norm is infinite",
                'Use norm="hinf", or filter z.',
            )
