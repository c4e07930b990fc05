"""Dynamic output feedback for the H-infinity or the H2 norm, of full order or of a given one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from numpy.typing import ArrayLike

from robustpolish.base.budget import (
    Budget,
    enforce_deadline,
    progress_bar,
    single_threaded_blas,
    step_cost,
)
from robustpolish.base.checks import described, invalid, positive
from robustpolish.errors import SolverError
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import Gamma, Norm, NormTarget, norm_in_words
from robustpolish.synthesis.design import Design
from robustpolish.synthesis.driver import (
    JoinedController,
    check_arguments,
    combined_norm,
    design_by_parts,
    time_limit_note,
)
from robustpolish.synthesis.engine import Engine, Settings
from robustpolish.synthesis.output_feedback.lmi import LmiH2, LmiHinf, Slycot
from robustpolish.synthesis.output_feedback.riccati import Lqg, RegularisedRiccati
from robustpolish.synthesis.problem.preflight import (
    SolvabilityCheck,
    check_solvability,
    with_control_penalty,
    with_measurement_noise,
)
from robustpolish.synthesis.problem.scaling import decoupled_parts, whole_plant
from robustpolish.synthesis.structured.methods import (
    StructuredOptions,
    checked_order,
    design_fixed_order,
    refuse_with_order,
)
from robustpolish.synthesis.structured.search import TIME_LIMIT

Method = Literal["auto", "riccati", "lmi", "slycot"]

# The order in which each method calls the engines. To add one, write a subclass of
# :class:`~robustpolish.synthesis.engine.Engine` in a file of its own and name it here.

ENGINES: Mapping[str, Mapping[str, tuple[type[Engine], ...]]] = {
    "hinf": {
        "auto": (RegularisedRiccati, LmiHinf),
        "riccati": (RegularisedRiccati,),
        "lmi": (LmiHinf,),
        "slycot": (Slycot,),
    },
    "h2": {"auto": (Lqg,), "riccati": (Lqg,), "lmi": (LmiH2,), "slycot": (Slycot,)},
}
# Steps that one call may spend before `effort` is applied: about ten times what the slowest of 24
# COMPleib plants needs, and a few seconds.
_WORK = 20_000.0


@single_threaded_blas
def output_feedback(
    plant: GeneralizedPlant,
    norm: Norm = "hinf",
    method: Method = "auto",
    *,
    backend: str = "cvxpy",
    solver: str | None = None,
    control_weight: ArrayLike | None = None,
    measurement_noise: ArrayLike | None = None,
    gamma: Gamma | None = None,
    tolerance: float = 4e-3,
    effort: float = 1.0,
    time_limit: float | None = None,
    split: bool = True,
    order: int | None = None,
) -> Design:
    r"""Design a dynamic controller u = K y from the measurements for the smallest norm.

    The controller has at most as many states as the plant, or as `order` says. Scaling of
    signals, states and time, decoupled parts, D11 and D22, rank-deficient D12 and D21 and zeros
    on the stability boundary are taken care of. Only what is computed afresh from the closed loop
    is believed, and every design carries a proof of its stability and norm.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous or discrete.
    norm : {"hinf", "h2"}
        The norm of the loop from w to z that is minimised.
    method : {"auto", "riccati", "lmi", "slycot"}
        "riccati": two Riccati equations on plants regularised less and less; "lmi": linear matrix
        inequalities, thesis (10.20) to (10.24), projected, and (10.29) to (10.32), in states
        that Riccati equations balance and at norms that the lower bound tells; "slycot": the SLICOT
        routines SB10AD and SB10HD in a process of their own; "auto": Riccati, and
        matrix inequalities where that leaves doubt.
    backend : {"cvxpy", "picos"}
        Who solves the matrix inequalities.
    solver : str, optional
        A solver of that backend, such as "SCS"; Clarabel or CVXOPT by default.
    control_weight : float or array_like, shape (nu,), optional
        Price on u, in units of z per unit of u, appended to z.
    measurement_noise : float or array_like, shape (ny,), optional
        Noise on y, in units of y per unit of w, appended to w. Where D12 or D21 is rank-deficient,
        price and noise together make a problem with an optimum of finite gain.
    gamma : float or (float, float), optional
        A number asks for any controller with a norm below it: the central one, which has
        less gain and more robustness than those near the infimum. A range (low, high) asks for the
        smallest norm above `low`; a controller near `low` will do. What no controller
        reaches is refused. In the plant's units, as `certificate.achieved`.
    tolerance : float
        How far above the infimum, relative, a controller may lie to have a smaller gain or fewer
        states.
    effort : float
        Factor on the work that the search may do. It is counted in steps, so that every machine,
        busy or idle, gives the same answer.
    time_limit : float, optional
        A safety net, in seconds; 60 s, and 300 s with `order`. If it is reached the status is
        "time_limit", and another machine may find something else; otherwise it changes nothing.
        It covers the certificate, for which the search leaves a quarter of the time, at most 5 s;
        where its proof is not complete half a second after the limit, there is no design.
        Functions are compiled once per user and version; these seconds are not counted.
    split : bool
        Whether to solve parts of the plant that share no signal one by one, which is quicker and
        gives the same norm.
    order : int, optional
        The most states that the controller may have; 0 is static feedback u = F y. The problem is
        then not convex: full-order designs are reduced, and from these, from controllers of fewer
        states and from random ones the norm itself is lowered. The result is certified, a local
        minimum, and its message says how far it is from what any order reaches.

    Returns
    -------
    Design
        Its status is "optimal" if the norm lies within `tolerance` of ``lower_bound``;
        "infimum_not_attained" if ever larger gains were still improving it; "time_limit" if
        the safety net was reached; "suboptimal" otherwise. ``details`` hold the ``diagnosis``,
        the ``claim`` of the method, which may be false, the ``work`` done in steps, the range
        that ``gamma`` asked for, per part the states (``parts``) and norms (``part_norms``),
        and an ``estimated_infimum`` where no bound is known: of doubles, and no bound. Its plant
        includes price and noise.

    Raises
    ------
    InfeasibleError
        If no controller stabilises the plant; it names the mode and the state that carries it. For
        the H2 norm also if D11 cannot be cancelled, which makes the norm infinite. And if the
        lower bound, which is told, lies above what `gamma` asks for.
    SolverError
        If no controller was found, none could be certified, or none keeps what `gamma` asks for.
    InvalidInputError
        If an argument does not fit.

    Notes
    -----
    Zhou, Doyle, Glover, "Robust and Optimal Control", 1996, theorem 17.1, for the Riccati
    equations; Stoorvogel, "The singular H-infinity control problem with dynamic measurement
    feedback", SIAM J. Control and Optimization 29 (1991) 160-184, for the lower bound where D12 or
    D21 is rank-deficient; Scherer, Gahinet, Chilali, "Multiobjective output-feedback control via
    LMI optimization", IEEE Trans. Automatic Control 42 (1997) 896-911, for the inequalities.

    Discrete-time plants are mapped to continuous time for the H-infinity norm, which keeps it
    exactly, and solved by discrete Riccati equations for the H2 norm.

    A plant of more than 100 states is searched without those that change its response by less than
    1e-8 of its largest Hankel singular value, if these are at least half of them: the controller
    has as few states. The certificate is that of the whole plant; where its loop has another norm,
    or its equations a solution below the bound, all states are searched. The message says so.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices(
    ...     [[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [1.0, 0.0]], [[0.0], [1.0]],
    ...     [[1.0, 0.0], [0.0, 0.0]], [[1.0, 0.0]], D12=[[0.0], [1.0]], D21=[[0.0, 1.0]])
    >>> design = rp.output_feedback(plant)
    >>> design.status, round(design.certificate.achieved, 1), design.certificate.valid
    ('optimal', 2.6, True)

    Any controller with a norm below 4, which has less gain:

    >>> gentle = rp.output_feedback(plant, gamma=4.0)
    >>> bool(gentle.certificate.bound <= 4.0)
    True

    A single state instead of two:

    >>> lean = rp.output_feedback(plant, order=1, effort=0.1)
    >>> lean.controller.nstates, lean.certificate.valid
    (1, True)
    """
    seconds = (60.0 if order is None else TIME_LIMIT) if time_limit is None else time_limit
    check_arguments(plant, norm, method, ENGINES["hinf"], backend, tolerance, seconds)
    positive("effort", effort)
    if norm == "h2" and plant.is_discrete and method in ("lmi", "slycot"):
        shown = described(f"{method!r} for the H2 norm of a discrete-time plant")
        remedy = "Only the Riccati equations are written for it."
        raise invalid("method", shown, "'riccati' or 'auto'", remedy)
    if not (plant.nu and plant.ny):
        shown = described(f"{plant.nu} controls and {plant.ny} measurements")
        remedy = "Check controls= and measurements= of the plant."
        raise invalid("plant", shown, "at least one of each", remedy)
    wanted = NormTarget.checked(gamma)
    whole = with_measurement_noise(with_control_penalty(plant, control_weight), measurement_noise)
    if order is not None:
        most = checked_order(order)
        refuse_with_order(method, gamma)
        orders = StructuredOptions.checked(norm, seconds, 0, effort=effort)
        options: Any = {"backend": backend, "solver": solver, "tolerance": tolerance}
        try:
            limit = min(60.0, seconds / 2)
            full = output_feedback(whole, norm, effort=effort, time_limit=limit, **options)
        except SolverError:
            full = None  # nothing proven: few states may do where this found nothing
        return design_fixed_order(plant, whole, most, full, norm, tolerance, orders)
    plant = whole
    settings = Settings(norm, method, backend, solver, tolerance, wanted, ENGINES[norm][method])
    # Steps on the size of the plant that a call may spend at least: a search over gamma of a
    # plant of 120 states takes 40, where `work` would leave one of 250 states seven.
    work = max(_WORK, 80.0 * step_cost(plant.nx))
    budget = Budget.with_certificate_reserve(effort * work, seconds)
    diagnosis = check_solvability(plant)
    diagnosis.require_stabilisable()
    # Delays are approximated in the parts; the whole is certified with them as they are.
    parts = decoupled_parts(plant) if split else (whole_plant(plant.without_delays()),)
    with progress_bar("Designing an output feedback"), enforce_deadline(budget):
        found = design_by_parts(plant, parts, settings, diagnosis, budget)
    # Up to so many states of a plant its zeros on the axis are looked for, to explain a result.
    if plant.nx <= 30 and not (diagnosis.regular_feedthrough and found.status == "optimal"):
        diagnosis = diagnosis.with_zeros(plant)
    bound = found.bound if found.known else None
    details = {
        "diagnosis": diagnosis,
        "parts": tuple(part.states for part in parts),
        "part_norms": tuple(c.achieved if c else None for c in found.chosen),
        "claim": combined_norm((c.claim for c in found.done), norm),
        "work": budget.spent,
        "estimated_infimum": None if found.known or not found.bound else found.bound,
    }
    return found.design(_message(found, diagnosis), bound, details)


def _message(found: JoinedController, diagnosis: SolvabilityCheck) -> str:
    achieved, bound, floor = found.certificate.achieved, found.bound, found.lower_bound_note
    wanted, status = found.settings.wanted, found.status
    if bound > 0 and status == "suboptimal" and found.known:
        floor = f"that is at most {achieved / bound - 1:.2g} of it above the infimum: {floor}"
    known = floor if bound > 0 else "it is not known how far above the infimum that is"
    text = f"The {norm_in_words(found.settings.norm)} norm is {achieved:.6g}"
    text += {
        "optimal": f"; {floor}.",
        "suboptimal": f"; {known}.",
        "infimum_not_attained": " and could still be lowered by ever larger gains: the infimum is "
        "not attained. Price u (D12) and add noise to y (D21) to choose how much gain is worth it.",
        "time_limit": f"; {floor}." if bound > 0 else ".",
    }[status]
    if wanted.is_requested:
        text += f" It was asked for {wanted.in_words()}."
    remarks = [remark for c in found.done for remark in c.findings.remarks]
    text += time_limit_note(found.budget)
    return " ".join([text, *diagnosis.findings, *dict.fromkeys(remarks)])
