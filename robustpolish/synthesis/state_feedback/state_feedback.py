"""State feedback u = F x for the H-infinity or the H2 norm."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.budget import Budget, enforce_deadline, progress_bar, single_threaded_blas
from robustpolish.base.checks import described, instance_of, invalid, one_of, positive
from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.linear.controllability import controllability
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import (
    Certificate,
    Gamma,
    NormTarget,
    certify,
    norm_in_words,
    unreachable_norm_error,
)
from robustpolish.synthesis.design import Design
from robustpolish.synthesis.lmi.program import BACKENDS
from robustpolish.synthesis.problem.pole_regions import (
    PoleRegion,
    checked_regions,
    violated_regions,
)
from robustpolish.synthesis.problem.preflight import with_control_penalty
from robustpolish.synthesis.problem.scaling import PlantPart, decoupled_parts, whole_plant
from robustpolish.synthesis.problem.status import Status, worst_status
from robustpolish.synthesis.state_feedback.engine import POLICY, StateEngine
from robustpolish.synthesis.state_feedback.lmi import LmiStateEngine
from robustpolish.synthesis.state_feedback.riccati import RiccatiStateEngine
from robustpolish.synthesis.state_feedback.search import message, solve_parts

ENGINES: Mapping[str, type[StateEngine]] = {"lmi": LmiStateEngine, "riccati": RiccatiStateEngine}


@single_threaded_blas
def state_feedback(
    plant: GeneralizedPlant,
    norm: Literal["hinf", "h2"] = "hinf",
    method: Literal["lmi", "riccati"] = "lmi",
    backend: Literal["cvxpy", "picos"] = "cvxpy",
    control_weight: ArrayLike | None = None,
    gain_bound: float | None = None,
    pole_region: PoleRegion | Sequence[PoleRegion] | None = None,
    *,
    gamma: Gamma | None = None,
    solver: str | None = None,
    split: bool = True,
    tolerance: float = 1e-4,
    time_limit: float = 300.0,
) -> Design:
    r"""Design u = F x that minimises the norm from w to z.

    The plant is split into parts that share no signal, each part is scaled (states, inputs,
    outputs, time) and solved alone, so that every part is as good as it can be; the whole is then
    certified afresh in the plant's own units.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous or discrete; all its states are taken as measured, whatever y is.
    norm : {"hinf", "h2"}, optional
        The norm from w to z that is minimised.
    method : {"lmi", "riccati"}, optional
        Linear matrix inequalities (10.18), (10.19) and (10.27), (10.28), or Riccati equations.
    backend : {"cvxpy", "picos"}, optional
        Library for the inequalities.
    control_weight : float or array_like, shape (nu,), optional
        Price on u in units of z per unit of u: z is extended by ``control_weight * u``, and the
        norm to this longer z is minimised and certified. The outputs are named ``price_``
        and the control's name.
    gain_bound : float, optional
        Bound on the largest singular value of F, in the plant's units. Not convex: the
        answer is a local optimum.
    pole_region : PoleRegion or sequence, optional
        HalfPlane, Disk or Sector that the closed-loop poles must lie in, for method "lmi".
    gamma : float or (float, float), optional
        A number asks for any gain with a norm below it, and the smallest that the search finds is
        taken: no control where that will do. A range (low, high) asks for the smallest norm above
        `low`; a gain near `low` will do. What no gain reaches is refused. In the plant's units, as
        ``certificate.achieved``, prices of `control_weight` included.
    solver : str, optional
        A solver of the backend: "SCS", "CVXOPT", ...
    split : bool, optional
        Whether decoupled parts are solved one by one. Where `gamma` asks for an H2 norm, which
        adds up over the parts, they are solved together.
    tolerance : float, optional
        Relative. A fifth of it is given away for a smaller gain, because the gain often
        grows without limit towards the optimum.
    time_limit : float, optional
        Seconds: a safety net for search and certificate; the search normally ends with its work
        long before, so that every machine finds the same gain. That it was reached is said in
        status and message, or by an error where no certificate was complete in time.

    Returns
    -------
    Design
        ``gain`` is F; ``plant`` and ``closed_loop`` have the prices among their outputs;
        ``details["performance_norm"]`` is the norm to the original z, ``details["gamma"]`` the
        range that `gamma` asked for. "optimal" is what comes
        within `tolerance` of ``lower_bound``, which no gain falls below. Without price, bound or
        region the infimum is often zero and not attained: the status says so, and the design
        is one of small norm and moderate gain.

    Raises
    ------
    InvalidInputError
        If an argument does not fit.
    InfeasibleError
        If no gain stabilises the plant (the modes are named), or no gain makes the H2 norm
        finite, or if the lower bound, which is told, lies above what `gamma` asks for.
    SolverError
        If no gain was found that passes its certificate, or none keeps what `gamma` asks for.

    Notes
    -----
    With Y = inv(K) > 0 and M = F Y the H-infinity norm is below gamma exactly if

    .. math:: \begin{bmatrix} AY + B_2M + (AY + B_2M)' & B_1 & (C_1Y + D_{12}M)' \\
              B_1' & -\gamma^2 I & D_{11}' \\ C_1Y + D_{12}M & D_{11} & -I \end{bmatrix} < 0

    (C. Scherer and S. Weiland, "Linear Matrix Inequalities in Control", 2000; thesis section 10.2).

    Examples
    --------
    A mass of 2 kg on a spring, damped by a force that costs 0.1 m per N:

    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices(
    ...     [[0.0, 1.0], [-50.0, 0.0]], [[0.0], [0.5]], [[0.0], [0.5]], [[1.0, 0.0]], [[1.0, 0.0]]
    ... )
    >>> design = rp.state_feedback(plant, norm="h2", method="riccati", control_weight=0.1)
    >>> design.status, design.certificate.valid
    ('optimal', True)
    >>> bool((design.closed_loop.poles().real < 0).all())
    True

    Any gain with a norm below 0.4, which is smaller:

    >>> gentle = rp.state_feedback(plant, "h2", "riccati", control_weight=0.1, gamma=0.4)
    >>> bool(gentle.certificate.bound <= 0.4)
    True
    """
    regions = _checked(plant, norm, method, backend, gain_bound, pole_region)
    tolerance, time_limit = positive("tolerance", tolerance), positive("time_limit", time_limit)
    budget = Budget.with_certificate_reserve(POLICY.work, time_limit)
    wanted = NormTarget.checked(gamma)
    whole = with_control_penalty(plant, control_weight).with_full_state()
    _refuse_infeasible(whole, norm)
    together = not split or (wanted.is_requested and norm == "h2")
    pieces = (whole_plant(whole),) if together else decoupled_parts(whole)
    engine = ENGINES[method](norm, tolerance, regions, backend, solver)
    with progress_bar("Designing a state feedback"), enforce_deadline(budget):
        found = _certified(whole, pieces, engine, gain_bound, budget, wanted)
    _require_target(wanted, found)
    size = float(np.linalg.norm(found.F, 2))
    controller = whole.static_controller(found.F)
    return Design(
        plant=whole,
        controller=controller,
        closed_loop=whole.closed_loop(controller),
        norm=norm,
        status=found.status,
        message=message(
            found.status,
            found.certificate.achieved,
            found.lower_bound,
            size,
            tolerance,
            gain_bound,
            bool(regions),
            budget.exhausted,
            found.history,
            wanted,
        ),
        certificate=found.certificate,
        method=method,
        backend=backend if method == "lmi" else "scipy",
        elapsed=budget.elapsed,
        history=found.history,
        lower_bound=found.lower_bound if found.lower_bound > 0 else None,
        details=MappingProxyType(
            {
                "performance_norm": _performance_norm(plant, found.F, norm),
                "largest_singular_value": size,
                "parts": tuple(piece.plant.states for piece in pieces),
                "pole_regions": regions,
                "gamma": (wanted.enough, wanted.below) if wanted.is_requested else None,
            }
        ),
    )


def _checked(
    plant: GeneralizedPlant,
    norm: str,
    method: str,
    backend: str,
    gain_bound: float | None,
    pole_region: PoleRegion | Sequence[PoleRegion] | None,
) -> tuple[PoleRegion, ...]:
    """Check the arguments that exclude each other, and return the regions as a tuple."""
    remedy = "Make one with GeneralizedPlant(system, measurements=..., controls=...)."
    instance_of("plant", plant, GeneralizedPlant, "a GeneralizedPlant", remedy)
    for count, what in ((plant.nx, "states"), (plant.nu, "controls"), (plant.nw, "disturbances")):
        if count == 0:
            raise invalid("plant", described(f"no {what}"), f"a plant with {what}", "Add some.")
    one_of("norm", norm, ("hinf", "h2"))
    one_of("method", method, tuple(ENGINES))
    one_of("backend", backend, BACKENDS)
    if gain_bound is not None:
        positive("gain_bound", gain_bound)
    if pole_region is None:
        return ()
    regions = checked_regions("pole_region", pole_region)
    if method != "lmi" or gain_bound is not None:
        other = "method='riccati'" if method != "lmi" else "gain_bound"
        raise invalid(
            "pole_region",
            described(f"a region together with {other}"),
            "method='lmi' and no gain_bound",
            "Leave one of them out; a Disk bounds the gain as well.",
        )
    return regions


def _refuse_infeasible(plant: GeneralizedPlant, norm: str) -> None:
    """Raise an InfeasibleError if no gain stabilises, or makes the H2 norm finite."""
    test = controllability(plant.A, plant.B2, states=plant.states, dt=plant.dt)
    if test.harmful:
        unit = "" if plant.is_discrete else " rad/s"
        named = ", ".join(f"{_shown(m.eigenvalue)}{unit} (state {m.state})" for m in test.harmful)
        raise InfeasibleError(
            f"No state feedback stabilises the plant: no control moves the mode {named}. "
            "Add an actuator that reaches it, or leave it out of the model.",
            [mode.eigenvalue for mode in test.harmful],
        )
    if norm == "h2" and not plant.is_discrete and plant.D11.any():
        raise InfeasibleError(
            "No state feedback makes the H2 norm finite: D11 is not zero, so white noise w passes "
            "straight to z. Minimise the H-infinity norm, or filter w."
        )


@dataclass(frozen=True, eq=False)
class _CertifiedGain:
    """A certified gain for the whole plant."""

    F: Matrix
    certificate: Certificate
    lower_bound: float
    status: Status
    history: tuple[Mapping[str, Any], ...]


def _certified(
    whole: GeneralizedPlant,
    pieces: Sequence[PlantPart],
    engine: StateEngine,
    gain_bound: float | None,
    budget: Budget,
    wanted: NormTarget,
) -> _CertifiedGain:
    """Solve the parts and certify the whole, with a relaxed tolerance where it fails."""
    reasons: tuple[str, ...] = ()
    for relaxation in POLICY.relaxations:
        relaxed = engine.with_least_tolerance(relaxation * engine.tolerance)
        plants = [piece.plant for piece in pieces]
        gains = solve_parts(plants, relaxed, engine.tolerance, gain_bound, budget, wanted)
        late = budget.late
        F = np.zeros((whole.nu, whole.nx))
        for piece, gain in zip(pieces, gains, strict=True):
            F[np.ix_(piece.controls, piece.states)] = gain.F
        together = max if engine.norm == "hinf" else math.hypot
        claimed = together(*(gain.claimed for gain in gains), 0.0)
        certificate = certify(whole, F, engine.norm, claimed)
        least = together(*(gain.lower_bound for gain in gains), 0.0)
        lower_bound = min(least, certificate.achieved)
        reasons = certificate.reasons + _violations(F, certificate, engine.regions, gain_bound)
        slip = -POLICY.rounding * relaxed.tolerance
        if not reasons and certificate.gap is not None and certificate.gap < slip:
            reasons = ("the gain is so large that rounding changes the norm",)
        if not reasons:
            status = worst_status([gain.status for gain in gains])
            near = certificate.achieved <= lower_bound * (1 + engine.tolerance)
            if late:
                status = "time_limit"
            elif status == "optimal" and not near:
                status = "suboptimal"
            history = tuple(
                MappingProxyType({"part": number, **entry})
                for number, gain in enumerate(gains)
                for entry in gain.history
            )
            return _CertifiedGain(F, certificate, lower_bound, status, history)
        if budget.over:
            break
    raise SolverError(
        f"A gain was found, but its certificate fails: {'; '.join(reasons)}. "
        "Try the other method or backend, a larger control_weight or a gain_bound."
    )


def _require_target(wanted: NormTarget, found: _CertifiedGain) -> None:
    """Refuse a gain that does not keep what was asked for."""
    certificate = found.certificate
    if certificate.bound <= wanted.below:
        return
    if found.lower_bound > wanted.below:
        how = "which Riccati equations tell"
        raise unreachable_norm_error(wanted, found.lower_bound, certificate.norm, how)
    floor = (
        f"none comes below {found.lower_bound:.6g}"
        if found.lower_bound > 0
        else "no lower bound is known"
    )
    raise SolverError(
        f"No gain with {wanted.in_words()} was found; the best one that is certified has the "
        f"{norm_in_words(certificate.norm)} norm {certificate.achieved:.6g}, and {floor}. Ask for "
        "a larger gamma, or leave out what else is asked for (gain_bound, pole_region)."
    )


def _violations(
    F: Matrix,
    certificate: Certificate,
    regions: Sequence[PoleRegion],
    gain_bound: float | None,
) -> tuple[str, ...]:
    """Return what the certificate does not see: bound and regions, in the plant's units."""
    reasons = []
    if gain_bound is not None and np.linalg.norm(F, 2) > gain_bound:
        reasons.append(f"the gain {np.linalg.norm(F, 2):.8g} exceeds {gain_bound:.8g}")
    return (*reasons, *violated_regions(regions, certificate.poles))


def _performance_norm(plant: GeneralizedPlant, F: Matrix, norm: str) -> float:
    loop = plant.state_feedback_loop(F)
    return float(hinf_norm(loop) if norm == "hinf" else h2_norm(loop))


def _shown(value: complex) -> str:
    return f"{value.real:.6g}" if value.imag == 0 else f"{value:.6g}"
