"""Full-order dynamic output feedback for the H-infinity or the H2 norm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

import control
import numpy as np
from numpy.typing import ArrayLike

from robustpolish.analysis import h2_norm, hinf_norm
from robustpolish.errors import SolverError
from robustpolish.models import GeneralizedPlant
from robustpolish.progress import working
from robustpolish.synthesis.certificate.certificate import Certificate, Norm, certify
from robustpolish.synthesis.design.design import Design, Status
from robustpolish.synthesis.output_search.candidates import Findings
from robustpolish.synthesis.output_search.choice import Chosen, choose
from robustpolish.synthesis.output_search.engines import METHODS, Settings, run_engines
from robustpolish.synthesis.problem.deadline import Deadline
from robustpolish.synthesis.problem.decoupling import (
    PlantPart,
    decoupled_parts,
    joined_controller,
    undivided,
)
from robustpolish.synthesis.problem.fixed_modes import refuse_unstable
from robustpolish.synthesis.problem.preflight import Diagnosis, diagnose, refuse
from robustpolish.synthesis.problem.pricing import noisy, priced
from robustpolish.synthesis.problem.solver_plant import SolverPlant
from robustpolish.synthesis.riccati.output_h2 import no_finite_h2_norm
from robustpolish.validation import described, invalid, one_of, positive

Method = Literal["auto", "riccati", "lmi", "slycot"]
_WORST_FIRST: tuple[Status, ...] = ("time_limit", "suboptimal", "infimum_not_attained", "optimal")


def output_feedback(
    plant: GeneralizedPlant,
    norm: Norm = "hinf",
    method: Method = "auto",
    *,
    backend: str = "cvxpy",
    solver: str | None = None,
    control_weight: ArrayLike | None = None,
    measurement_noise: ArrayLike | None = None,
    tolerance: float = 4e-3,
    time_limit: float = 5.0,
    split: bool = True,
) -> Design:
    r"""Design a dynamic controller u = K y from the measurements for the smallest norm.

    The controller has at most as many states as the plant. Scaling of signals, states and
    time, decoupled parts, D11 and D22, rank-deficient D12 and D21 and zeros on the
    stability boundary are taken care of. Only what is computed afresh from the closed
    loop is believed, and every design carries a proof of its stability and norm.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous or discrete.
    norm : {"hinf", "h2"}
        The norm of the loop from w to z that is minimised.
    method : {"auto", "riccati", "lmi", "slycot"}
        "riccati": two Riccati equations on plants regularised less and less; "lmi": linear matrix
        inequalities, thesis (10.20) to (10.24) and (10.29) to (10.32); "slycot": the SLICOT
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
    tolerance : float
        How far above the best norm found, relative, a controller may lie to have a smaller
        gain or fewer states.
    time_limit : float
        Seconds for the search. The certificate, up to about 2 s for 60 states, is computed
        within them if possible, and in any case.
    split : bool
        Whether to solve parts of the plant that share no signal one by one, which is quicker and
        gives the same norm.

    Returns
    -------
    Design
        Its status is "optimal" if the norm had settled; "infimum_not_attained" if ever larger gains
        were still improving it; "suboptimal" or "time_limit" otherwise. ``details`` hold
        the ``diagnosis``, the ``claim`` of the method, which may be false, and per part
        the states (``parts``) and norms (``part_norms``). Its plant includes price and noise.

    Raises
    ------
    InfeasibleError
        If no controller stabilises the plant; it names the mode and the state that carries it. For
        the H2 norm also if D11 cannot be cancelled, which makes the norm infinite.
    SolverError
        If no controller was found or none could be certified in the time given.
    InvalidInputError
        If an argument does not fit.

    Notes
    -----
    Zhou, Doyle, Glover, "Robust and Optimal Control", 1996, theorem 17.1, for the Riccati
    equations; Scherer, Gahinet, Chilali, "Multiobjective output-feedback control via LMI
    optimization", IEEE Trans. Automatic Control 42 (1997) 896-911, for the inequalities.

    Discrete-time plants are mapped to continuous time for the H-infinity norm, which keeps it
    exactly, and solved by discrete Riccati equations for the H2 norm.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices(
    ...     [[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [1.0, 0.0]], [[0.0], [1.0]],
    ...     [[1.0, 0.0], [0.0, 0.0]], [[1.0, 0.0]], D12=[[0.0], [1.0]], D21=[[0.0, 1.0]])
    >>> design = rp.output_feedback(plant)
    >>> design.status, round(design.certificate.achieved, 1), design.certificate.valid
    ('optimal', 2.6, True)
    """
    _check(plant, norm, method, backend, tolerance, time_limit)
    plant = noisy(priced(plant, control_weight), measurement_noise)
    deadline = Deadline(time_limit)
    settings = Settings(norm, method, backend, solver, tolerance)
    diagnosis = diagnose(plant)
    exact = [mode for mode in diagnosis.fixed_modes if mode.exact]
    if exact:
        raise refuse(exact)
    parts = decoupled_parts(plant) if split else (undivided(plant),)
    with working("Designing an output feedback"):
        chosen = _solve_parts(parts, settings, diagnosis, deadline)
        controller = joined_controller(plant, parts, [c.controller if c else None for c in chosen])
        certificate = _certificate(plant, parts, controller, norm, chosen)
    if deadline.remaining > 0.5 * time_limit and plant.nx <= 30:
        diagnosis = diagnose(plant, zeros=True)
    done = [c for c in chosen if c is not None]
    status = _overall(done, norm)
    return Design(
        plant=plant,
        controller=controller,
        closed_loop=plant.closed_loop(controller),
        norm=norm,
        status=status,
        message=_message(status, diagnosis, certificate, done),
        certificate=certificate,
        method=" and ".join(dict.fromkeys(c.findings.method for c in done)) or method,
        backend=" and ".join(dict.fromkeys(c.findings.backend for c in done)) or "scipy",
        elapsed=deadline.elapsed,
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
                "claim": _joined([c.claim for c in done], norm),
            }
        ),
    )


def _check(
    plant: Any, norm: str, method: str, backend: str, tolerance: float, time_limit: float
) -> None:
    if not isinstance(plant, GeneralizedPlant):
        raise invalid(
            "plant",
            described(type(plant).__name__),
            "a GeneralizedPlant",
            "Build one with GeneralizedPlant(system, measurements=..., controls=...).",
        )
    one_of("norm", norm, ("hinf", "h2"))
    one_of("method", method, METHODS)
    one_of("backend", backend, ("cvxpy", "picos"))
    positive("tolerance", tolerance)
    positive("time_limit", time_limit, "s")
    if not (plant.nu and plant.ny):
        raise invalid(
            "plant",
            described(f"{plant.nu} controls and {plant.ny} measurements"),
            "at least one of each",
            "Check controls= and measurements= of the plant.",
        )


def _solve_parts(
    parts: Sequence[PlantPart], settings: Settings, diagnosis: Diagnosis, deadline: Deadline
) -> list[Chosen | None]:
    """Solve every decoupled part within its share of the time; identical ones once."""
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
        system = P.system
        key = tuple(M.tobytes() + str(M.shape).encode() for M in map(np.array, _matrices(system)))
        keys.append(key)
        if key not in searched:
            share = deadline.share(weights[i] / sum(weights[i:]))
            searched[key] = _search(_with_signals(P), settings, diagnosis, share)
    # No part has to be much better than the one that decides the norm of the whole.
    enough = 0.01 * max((s.best for s in searched.values()), default=0.0)
    chosen = {key: _choose(search, settings, diagnosis, enough) for key, search in searched.items()}
    return [None if key is None else chosen[key] for key in keys]


def _matrices(system: control.StateSpace) -> tuple[Any, ...]:
    return system.A, system.B, system.C, system.D


@dataclass(frozen=True, eq=False)
class PartSearch:
    """The findings of the engines on one part, and the time left to choose."""

    problem: SolverPlant
    searches: list[Findings]
    deadline: Deadline
    norm: str

    @property
    def best(self) -> float:
        """The smallest norm found, in the plant's units; zero if none was found."""
        found = min((search.best for search in self.searches), default=np.inf)
        return self.problem.norm(found, self.norm) if np.isfinite(found) else 0.0


def _with_signals(part: GeneralizedPlant) -> GeneralizedPlant:
    """Add a w or a z without effect to a part that has none and only has to be stabilised."""
    P = part
    if P.nw and P.nz:
        return P
    w, z = max(P.nw, 1), max(P.nz, 1)
    return GeneralizedPlant.from_matrices(
        P.A,
        _padded(P.B1, (P.nx, w)),
        P.B2,
        _padded(P.C1, (z, P.nx)),
        P.C2,
        _padded(P.D11, (z, w)),
        _padded(P.D12, (z, P.nu)),
        _padded(P.D21, (P.ny, w)),
        P.D22,
        dt=P.dt,
        states=P.states,
        controls=P.control_names,
        measurements=P.measurement_names,
    )


def _padded(M: Any, shape: tuple[int, int]) -> Any:
    return M if M.shape == shape else np.zeros(shape)


def _search(
    plant: GeneralizedPlant, settings: Settings, diagnosis: Diagnosis, deadline: Deadline
) -> PartSearch:
    problem = SolverPlant.of(plant, mapped=settings.norm == "hinf")
    # The certificate of a loop with n states takes about 1e-6 n^3 seconds.
    reserve = min(0.4 * deadline.seconds, 1e-6 * (2 * plant.nx) ** 3)
    limit = Deadline(deadline.remaining - reserve)
    regular = diagnosis.d12_full and diagnosis.d21_full
    searches = run_engines(problem, settings, regular, limit)
    return PartSearch(problem, searches, limit, settings.norm)


def _choose(search: PartSearch, settings: Settings, diagnosis: Diagnosis, enough: float) -> Chosen:
    # The H2 optimum is known exactly where the plant is regular, so that it is returned.
    tolerance = settings.tolerance if settings.norm == "hinf" else min(settings.tolerance, 2e-5)
    chosen, reasons = choose(
        search.problem, search.searches, settings.norm, tolerance, enough, search.deadline
    )
    if chosen is not None:
        return chosen
    if diagnosis.fixed_modes:
        raise refuse(diagnosis.fixed_modes)
    late = " Time ran out; allow more with time_limit." if search.deadline.expired else ""
    why = "; ".join(dict.fromkeys(reasons)) or "no engine found a stabilising controller"
    remarks = [remark for found in search.searches for remark in found.remarks]
    original = search.problem.original
    if settings.norm == "h2" and not original.is_discrete and original.D11.any():
        remarks.append(
            "The feedthrough D11 can be cancelled up to rounding only, which leaves the H2 norm "
            "infinite. Filter w or z so that D11 vanishes, or use norm='hinf'."
        )
    raise SolverError(" ".join([f"No certified controller was found: {why}.{late}", *remarks]))


def _certificate(
    plant: GeneralizedPlant,
    parts: Sequence[PlantPart],
    controller: control.StateSpace,
    norm: Norm,
    chosen: Sequence[Chosen | None],
) -> Certificate:
    """Certify the whole loop, which for a single part has been done."""
    idle = [part.plant for part, c in zip(parts, chosen, strict=True) if c is None]
    silent = all(P.nx == 0 and not P.D11.any() for P in idle)
    if len(chosen) == len(idle) + 1 and silent:
        return next(c.certificate for c in chosen if c is not None)
    size = hinf_norm if norm == "hinf" else h2_norm
    claims = [
        float(size(part.plant.open_loop)) if c is None else c.certificate.claimed or 0.0
        for part, c in zip(parts, chosen, strict=True)
        if c is not None or (part.plant.nw and part.plant.nz)
    ]
    claimed = _joined(claims, norm)
    certificate = certify(plant, controller, norm, claimed)
    if not certificate.valid:
        raise SolverError(
            "The controllers of the parts are certified, the whole is not: "
            + "; ".join(certificate.reasons)
        )
    return certificate


def _joined(norms: Sequence[float], norm: Norm) -> float:
    """Return the norm of a whole from those of its decoupled parts."""
    return float(max(norms, default=0.0) if norm == "hinf" else np.linalg.norm(norms))


def _overall(done: Sequence[Chosen], norm: Norm) -> Status:
    """Return the status of the whole: that of the parts that decide its norm."""
    largest = max((c.certificate.achieved for c in done), default=0.0)
    counts = [c for c in done if norm == "h2" or c.certificate.achieved >= 0.99 * largest]
    found = {c.status for c in counts}
    for status in _WORST_FIRST:
        if status in found:
            return status
    return "optimal"


def _message(
    status: Status, diagnosis: Diagnosis, certificate: Certificate, done: Sequence[Chosen]
) -> str:
    kind = "H-infinity" if certificate.norm == "hinf" else "H2"
    text = {
        "optimal": f"The {kind} norm had settled at {certificate.achieved:.6g}.",
        "suboptimal": f"The {kind} norm is {certificate.achieved:.6g}; it is not known how far "
        "above the infimum that is.",
        "infimum_not_attained": f"The {kind} norm is {certificate.achieved:.6g} and could still be "
        "lowered by ever larger gains: the infimum is not attained. Price u (D12) and add noise "
        "to y (D21) to choose how much gain is worth it.",
        "time_limit": f"Time ran out at a {kind} norm of {certificate.achieved:.6g}; allow more "
        "with time_limit.",
    }[status]
    remarks = [remark for c in done for remark in c.findings.remarks]
    return " ".join([text, *diagnosis.findings, *dict.fromkeys(remarks)])
