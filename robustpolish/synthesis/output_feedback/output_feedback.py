"""Dynamic output feedback for the H-infinity or the H2 norm, of full order or of a given one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Literal

import control
import numpy as np
from numpy.typing import ArrayLike

from robustpolish.base.budget import (
    Budget,
    enforce_deadline,
    progress_bar,
    single_threaded_blas,
    step_cost,
)
from robustpolish.base.checks import described, instance_of, invalid, one_of, positive
from robustpolish.errors import SolverError
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import (
    ANY_NORM,
    Certificate,
    Gamma,
    Norm,
    NormTarget,
    certify,
    norm_in_words,
    unreachable_norm_error,
)
from robustpolish.synthesis.design import Design
from robustpolish.synthesis.output_feedback.engine import POLICY, Settings
from robustpolish.synthesis.output_feedback.search import (
    METHODS,
    ChosenController,
    PartSearch,
    choose_controller,
)
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.preflight import (
    SolvabilityCheck,
    check_solvability,
    infeasible_modes_error,
    refuse_unstable,
    with_control_penalty,
    with_measurement_noise,
)
from robustpolish.synthesis.problem.scaling import (
    PlantPart,
    decoupled_parts,
    joined_controller,
    whole_plant,
    with_dummy_signals,
)
from robustpolish.synthesis.problem.status import Status, worst_status
from robustpolish.synthesis.riccati.lqg import no_finite_h2_norm
from robustpolish.synthesis.structured.methods import (
    StructuredOptions,
    checked_order,
    design_fixed_order,
    refuse_with_order,
)
from robustpolish.synthesis.structured.search import TIME_LIMIT

Method = Literal["auto", "riccati", "lmi", "slycot"]


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
    _check(plant, norm, method, backend, tolerance, seconds, effort)
    if order is not None:
        most = checked_order(order)
        refuse_with_order(method, gamma)
        orders = StructuredOptions.checked(norm, seconds, 0, effort=effort)
        whole = with_measurement_noise(
            with_control_penalty(plant, control_weight), measurement_noise
        )
        try:
            full = output_feedback(
                whole,
                norm,
                backend=backend,
                solver=solver,
                tolerance=tolerance,
                effort=effort,
                time_limit=min(60.0, seconds / 2),
            )
        except SolverError:
            full = None  # nothing proven: few states may do where this found nothing
        return design_fixed_order(plant, whole, most, full, norm, tolerance, orders)
    wanted = NormTarget.checked(gamma)
    if control_weight is not None or measurement_noise is not None:
        plant = with_measurement_noise(
            with_control_penalty(plant, control_weight), measurement_noise
        )
    settings = Settings(norm, method, backend, solver, tolerance, wanted)
    work = max(POLICY.work, POLICY.attempts * step_cost(plant.nx))
    budget = Budget.with_certificate_reserve(effort * work, seconds)
    diagnosis = check_solvability(plant)
    exact = [mode for mode in diagnosis.fixed_modes if mode.exact]
    if exact:
        raise infeasible_modes_error(exact)
    # Delays are approximated in the parts; the whole is certified with them as they are.
    parts = decoupled_parts(plant) if split else (whole_plant(plant.without_delays()),)
    with progress_bar("Designing an output feedback"), enforce_deadline(budget):
        chosen = _solve_parts(parts, settings, diagnosis, budget)
        controller = joined_controller(plant, parts, [c.controller if c else None for c in chosen])
        idle = _open_loop_norms(parts, chosen, norm)
        certificate = _certificate(plant, parts, controller, norm, chosen, idle)
    done = [c for c in chosen if c is not None]
    known = _has_lower_bound(done)
    bound = _combined_norm([*(c.bound.value if c.bound else 0.0 for c in done), *idle], norm)
    _require_target(wanted, certificate, bound, done)
    status = _overall_status(done, certificate, bound, tolerance, budget)
    if plant.nx <= POLICY.zero_states and not (
        diagnosis.regular_feedthrough and status == "optimal"
    ):
        diagnosis = diagnosis.with_zeros(plant)
    return Design(
        plant=plant,
        controller=controller,
        closed_loop=plant.closed_loop(controller),
        norm=norm,
        status=status,
        message=_message(status, diagnosis, certificate, done, bound, budget, wanted),
        certificate=certificate,
        method=" and ".join(dict.fromkeys(c.findings.method for c in done)) or method,
        backend=" and ".join(dict.fromkeys(c.findings.backend for c in done)) or "scipy",
        elapsed=budget.elapsed,
        history=tuple(
            MappingProxyType({"part": i, **note})
            for i, c in enumerate(chosen)
            for note in (c.findings.history if c else ())
        ),
        details=MappingProxyType(
            {
                "diagnosis": diagnosis,
                "parts": tuple(part.states for part in parts),
                "part_norms": tuple(c.certificate.achieved if c else None for c in chosen),
                "gamma": (wanted.enough, wanted.below) if wanted.is_requested else None,
                "claim": _combined_norm([c.claim for c in done], norm),
                "work": budget.spent,
                "estimated_infimum": None if known or not bound else bound,
            }
        ),
        lower_bound=bound if known else None,
    )


def _check(
    plant: Any,
    norm: str,
    method: str,
    backend: str,
    tolerance: float,
    time_limit: float,
    effort: float,
) -> None:
    remedy = "Build one with GeneralizedPlant(system, measurements=..., controls=...)."
    instance_of("plant", plant, GeneralizedPlant, "a GeneralizedPlant", remedy)
    one_of("norm", norm, ("hinf", "h2"))
    one_of("method", method, METHODS)
    one_of("backend", backend, ("cvxpy", "picos"))
    positive("tolerance", tolerance)
    positive("time_limit", time_limit, "s")
    positive("effort", effort)
    if norm == "h2" and plant.is_discrete and method in ("lmi", "slycot"):
        raise invalid(
            "method",
            described(f"{method!r} for the H2 norm of a discrete-time plant"),
            "'riccati' or 'auto'",
            "Only the Riccati equations are written for it.",
        )
    if not (plant.nu and plant.ny):
        raise invalid(
            "plant",
            described(f"{plant.nu} controls and {plant.ny} measurements"),
            "at least one of each",
            "Check controls= and measurements= of the plant.",
        )


def _solve_parts(
    parts: Sequence[PlantPart], settings: Settings, diagnosis: SolvabilityCheck, budget: Budget
) -> list[ChosenController | None]:
    """Solve every decoupled part with its share of the work; identical ones once."""
    searched: dict[tuple[bytes, ...], PartSearch] = {}
    keys: list[tuple[bytes, ...] | None] = []
    weights = [p.plant.nx**2 + 1 if p.plant.nu and p.plant.ny else 0 for p in parts]
    for i, part in enumerate(parts):
        P = part.plant
        if not (P.nu and P.ny):
            refuse_unstable(P)
            if settings.norm == "h2" and not P.is_discrete and P.D11.any():
                raise no_finite_h2_norm()
            keys.append(None)
            continue
        key = PlantMatrices.of(P).fingerprint
        keys.append(key)
        if key not in searched:
            share = budget.share(weights[i] / sum(weights[i:]))
            # Norms of parts add up for the H2 norm, so that only a single one can be told.
            alone = settings.norm == "hinf" or len(parts) == 1
            own = settings if alone else replace(settings, wanted=ANY_NORM)
            searched[key] = PartSearch.of(with_dummy_signals(P), own, diagnosis, share)
    # No part has to be much better than the one that decides the norm of the whole.
    enough = POLICY.enough * max((s.best for s in searched.values()), default=0.0)
    chosen = {key: _choose(search, diagnosis, enough) for key, search in searched.items()}
    return [None if key is None else chosen[key] for key in keys]


def _require_target(
    wanted: NormTarget, certificate: Certificate, bound: float, done: Sequence[ChosenController]
) -> None:
    """Refuse a controller that does not keep what was asked for."""
    if certificate.bound <= wanted.below:
        return
    kind = norm_in_words(certificate.norm)
    how = " and ".join(dict.fromkeys(c.bound.how for c in done if c.bound is not None))
    if bound > wanted.below and _has_lower_bound(done):
        raise unreachable_norm_error(wanted, bound, certificate.norm, how)
    floor = _lower_bound_note(bound, how, done) or "no lower bound is known"
    raise SolverError(
        f"No controller with {wanted.in_words()} was found; the best one that is certified "
        f"has the {kind} norm {certificate.achieved:.6g}, and {floor}. Ask for a larger gamma, or "
        "allow more work with effort."
    )


def _choose(search: PartSearch, diagnosis: SolvabilityCheck, enough: float) -> ChosenController:
    chosen, reasons = choose_controller(
        search.part, search.problem, search.searches, enough, search.budget
    )
    if chosen is not None:
        return chosen
    if search.shortened:
        return _choose(search.with_all_states(), diagnosis, enough)
    why = "; ".join(dict.fromkeys(reasons)) or "no engine found a stabilising controller"
    remarks = [remark for found in search.searches for remark in found.remarks]
    original = search.part.original
    if search.problem.norm == "h2" and not original.is_discrete and original.D11.any():
        remarks.append(
            "The feedthrough D11 can be cancelled up to rounding only, which leaves the H2 norm "
            "infinite. Filter w or z so that D11 vanishes, or use norm='hinf'."
        )
    remarks += [f"It has the {mode}." for mode in diagnosis.fixed_modes]
    more = _time_limit_note(search.budget)
    raise SolverError(" ".join([f"No certified controller was found: {why}.{more}", *remarks]))


def _time_limit_note(budget: Budget) -> str:
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


def _certificate(
    plant: GeneralizedPlant,
    parts: Sequence[PlantPart],
    controller: control.StateSpace,
    norm: Norm,
    chosen: Sequence[ChosenController | None],
    idle: Sequence[float],
) -> Certificate:
    """Certify the whole loop, which for a single part has been done."""
    done = [c for c in chosen if c is not None]
    own = [part.plant.nx for part, c in zip(parts, chosen, strict=True) if c is not None]
    if own == [plant.nx] and not idle and not plant.delays:
        return done[0].certificate
    claims = [*(c.certificate.claimed or 0.0 for c in done), *idle]
    certificate = certify(plant, controller, norm, _combined_norm(claims, norm))
    if not certificate.valid:
        raise SolverError(
            "The controllers of the parts are certified, the whole is not: "
            + "; ".join(certificate.reasons)
        )
    return certificate


def _combined_norm(norms: Sequence[float], norm: Norm) -> float:
    """Return the norm of a whole from those of its decoupled parts."""
    return float(max(norms, default=0.0) if norm == "hinf" else np.linalg.norm(norms))


def _overall_status(
    done: Sequence[ChosenController],
    certificate: Certificate,
    bound: float,
    tolerance: float,
    budget: Budget,
) -> Status:
    """Return the status of the whole: that of the parts that decide its norm."""
    if budget.was_late:
        return "time_limit"
    if _has_lower_bound(done) and certificate.achieved <= bound * (1 + tolerance):
        return "optimal"
    largest = max((c.certificate.achieved for c in done), default=0.0)
    return worst_status(
        c.status
        for c in done
        if certificate.norm == "h2" or c.certificate.achieved >= 0.99 * largest
    )


def _has_lower_bound(done: Sequence[ChosenController]) -> bool:
    """Tell whether the infimum of some part is bounded from below, and of none only estimated."""
    bounds = [c.bound for c in done if c.bound is not None]
    return bool(bounds) and all(b.proven for b in bounds)


def _lower_bound_note(bound: float, how: str, done: Sequence[ChosenController]) -> str:
    """Say how low the norm can be; nothing if that is not known."""
    if not how:
        return ""
    if _has_lower_bound(done):
        return f"no controller comes below {bound:.6g}, {how}"
    return f"the infimum may be near {bound:.6g}, {how}, which is no bound"


def _message(
    status: Status,
    diagnosis: SolvabilityCheck,
    certificate: Certificate,
    done: Sequence[ChosenController],
    bound: float,
    budget: Budget,
    wanted: NormTarget,
) -> str:
    kind = norm_in_words(certificate.norm)
    achieved = certificate.achieved
    how = " and ".join(dict.fromkeys(c.bound.how for c in done if c.bound is not None))
    floor = _lower_bound_note(bound, how, done)
    if bound > 0 and status == "suboptimal" and _has_lower_bound(done):
        floor = f"that is at most {achieved / bound - 1:.2g} of it above the infimum: {floor}"
    text = {
        "optimal": f"The {kind} norm is {achieved:.6g}; {floor}.",
        "suboptimal": f"The {kind} norm is {achieved:.6g}; "
        f"{floor if bound > 0 else 'it is not known how far above the infimum that is'}.",
        "infimum_not_attained": f"The {kind} norm is {achieved:.6g} and could still be "
        "lowered by ever larger gains: the infimum is not attained. Price u (D12) and add noise "
        "to y (D21) to choose how much gain is worth it.",
        "time_limit": f"The {kind} norm is {achieved:.6g}{f'; {floor}' if bound > 0 else ''}.",
    }[status]
    if wanted.is_requested:
        text += f" It was asked for {wanted.in_words()}."
    remarks = [remark for c in done for remark in c.findings.remarks]
    return " ".join([text + _time_limit_note(budget), *diagnosis.findings, *dict.fromkeys(remarks)])
