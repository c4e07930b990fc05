"""State feedback u = F x for the H-infinity or the H2 norm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from robustpolish.base.budget import Budget, enforce_deadline, progress_bar, single_threaded_blas
from robustpolish.base.checks import described, invalid, positive
from robustpolish.errors import InfeasibleError
from robustpolish.linear.controllability import controllability
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import Gamma, NormTarget
from robustpolish.synthesis.design import Design
from robustpolish.synthesis.driver import JoinedController, check_arguments, design_by_parts
from robustpolish.synthesis.engine import Settings
from robustpolish.synthesis.problem.pole_regions import PoleRegion, checked_regions
from robustpolish.synthesis.problem.preflight import SolvabilityCheck, with_control_penalty
from robustpolish.synthesis.problem.scaling import decoupled_parts, whole_plant
from robustpolish.synthesis.state_feedback.search import StateSearch, reference_norm

# Steps that one design may take, a few milliseconds each. A bound on the gain of the brush's plant
# takes 13 000 of them, everything else on it less than 1 000, and one program for 40 states 15 000.
_WORK = 1e5
# What is fixed has been refused, and no engine of a static gain asks for ranks of D12 and D21.
_SOLVABLE = SolvabilityCheck((), 0, 0, True, True)


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
    check_arguments(plant, norm, method, ("lmi", "riccati"), backend, tolerance, time_limit)
    for count, what in ((plant.nx, "states"), (plant.nu, "controls"), (plant.nw, "disturbances")):
        if count == 0:
            raise invalid("plant", described(f"no {what}"), f"a plant with {what}", "Add some.")
    if gain_bound is not None:
        positive("gain_bound", gain_bound)
    regions = checked_regions("pole_region", pole_region)
    if pole_region is not None and (method != "lmi" or gain_bound is not None):
        other = "method='riccati'" if method != "lmi" else "gain_bound"
        shown = described(f"a region together with {other}")
        remedy = "Leave one of them out; a Disk bounds the gain as well."
        raise invalid("pole_region", shown, "method='lmi' and no gain_bound", remedy)
    budget = Budget.with_certificate_reserve(_WORK, time_limit)
    wanted = NormTarget.checked(gamma)
    whole = with_control_penalty(plant, control_weight).with_full_state()
    _refuse_infeasible(whole, norm)
    together = not split or (wanted.is_requested and norm == "h2")
    pieces = (whole_plant(whole),) if together else decoupled_parts(whole)
    settings = Settings(
        norm,
        method,
        backend,
        solver,
        tolerance,
        wanted,
        engines=(StateSearch,),
        full_state=True,
        regions=regions,
        gain_bound=gain_bound,
        reference=reference_norm([piece.plant for piece in pieces], norm),
        # Factors on the tolerance, one after the other: gains next to the optimum can be too
        # large to certify (random plants in wild units).
        relaxations=(1.0, 10.0, 100.0),
    )
    with progress_bar("Designing a state feedback"), enforce_deadline(budget):
        found = design_by_parts(whole, pieces, settings, _SOLVABLE, budget)
    F = np.asarray(found.controller.D)
    loop = plant.state_feedback_loop(F)
    details = {
        "performance_norm": float(hinf_norm(loop) if norm == "hinf" else h2_norm(loop)),
        "largest_singular_value": float(np.linalg.norm(F, 2)),
        "parts": tuple(piece.plant.states for piece in pieces),
        "pole_regions": regions,
    }
    least = min(found.bound, found.certificate.achieved)
    return found.design(_message(found), least if least > 0 else None, details)


def _refuse_infeasible(plant: GeneralizedPlant, norm: str) -> None:
    """Raise an InfeasibleError if no gain stabilises, or makes the H2 norm finite."""
    test = controllability(plant.A, plant.B2, states=plant.states, dt=plant.dt)
    if test.harmful:
        unit = "" if plant.is_discrete else " rad/s"
        values = [m.eigenvalue if m.eigenvalue.imag else m.eigenvalue.real for m in test.harmful]
        named = ", ".join(
            f"{value:.6g}{unit} (state {m.state})"
            for value, m in zip(values, test.harmful, strict=True)
        )
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


def _message(found: JoinedController) -> str:
    """Say what happened and what to try next."""
    settings, status, achieved = found.settings, found.status, found.certificate.achieved
    wanted, tolerance = settings.wanted, settings.tolerance
    size = float(np.linalg.norm(found.controller.D, 2))
    least = min(found.bound, achieved)
    text = f"Norm {achieved:.6g} with a gain of {size:.4g} (largest singular value)."
    if least > 0:
        text += f" No state feedback has a norm below {least:.6g}."
    if status == "optimal":
        return f"{text} That is within {tolerance:.0e} of it: the design is optimal."
    if status == "time_limit":
        return (
            f"{text} Time ran out before the search ended: another run may find another gain. "
            "Raise time_limit for a better one."
        )
    if status == "infimum_not_attained":
        # How the norm of the first part falls with the gain, from the steps with a price.
        steps = found.chosen[0].findings.history if found.chosen[0] else ()
        priced = [e for e in steps if "price" in e and "gain" in e][:12]
        shown = ", ".join(f"{e['achieved']:.2g} at {e['gain']:.2g}" for e in priced)
        trade_off = f" (norm at gain of the first part: {shown})" if shown else ""
        return (
            f"{text} The infimum is not attained: smaller norms need ever larger gains"
            f"{trade_off}. Set control_weight, gain_bound or pole_region to ask for a "
            "problem that has an optimum."
        )
    if any(c.findings.remarks for c in found.done):  # all of it was spent
        return f"{text} The search ended with its work, because the plant is large."
    if wanted.is_requested:
        text += f" It was asked for {wanted.in_words()}."
        if achieved <= wanted.enough:
            return text + " What lies below that was given away for a smaller gain."
    if settings.gain_bound is not None:
        return (
            f"{text} The bound {settings.gain_bound:.6g} on the gain is kept. It makes the problem "
            "nonconvex: this is a local optimum, and a better gain is not ruled out."
        )
    if settings.regions:
        return (
            f"{text} The poles lie in the region. One Lyapunov matrix serves norm and region, "
            "which is sufficient but not necessary: a better gain is not ruled out."
        )
    return (
        f"{text} It could not be shown to be within {tolerance:.0e} of the optimum: gains next to "
        "it are too large to compute with, or a control has no price. Try the other method, or set "
        "control_weight."
    )
