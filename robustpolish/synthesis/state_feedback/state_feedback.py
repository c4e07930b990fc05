"""State feedback u = F x for the H-infinity or the H2 norm."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any, Literal

import control
import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from robustpolish.base.arrays import SAME
from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.budget import (
    WORK,
    Budget,
    enforce_deadline,
    progress_bar,
    single_threaded_blas,
)
from robustpolish.base.checks import described, invalid, positive
from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.linear.norms.hinf import hinf_norm
from robustpolish.linear.stability import controllability, square_root
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis import certificate, driver
from robustpolish.synthesis.design import Design
from robustpolish.synthesis.nonsmooth.descent import MaskedGain, Problem, Requirement, minimax
from robustpolish.synthesis.nonsmooth.measures import GainMeasure, norm_measure
from robustpolish.synthesis.problem import matrices, preflight
from robustpolish.synthesis.problem.matrices import solve_lyapunov
from robustpolish.synthesis.problem.pole_regions import Disk, PoleRegion
from robustpolish.synthesis.riccati.gamma import LowerBound
from robustpolish.synthesis.state_feedback import lmi
from robustpolish.synthesis.state_feedback.riccati import (
    RiccatiStateEngine,
    StateEngine,
    StateGain,
    central_state_gain,
    output_nulling_gain,
    state_norm_lower_bound,
)

# What is fixed has been refused, and no engine of a static gain asks for ranks of D12 and D21.
_SOLVABLE = preflight.SolvabilityCheck((), 0, 0, True, True)


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
    gamma: certificate.Gamma | None = None,
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
    driver.check_arguments(plant, norm, method, ("lmi", "riccati"), backend, tolerance, time_limit)
    for count, what in ((plant.nx, "states"), (plant.nu, "controls"), (plant.nw, "disturbances")):
        if count == 0:
            raise invalid("plant", described(f"no {what}"), f"a plant with {what}", "Add some.")
    if gain_bound is not None:
        positive("gain_bound", gain_bound)
    regions = certificate.checked_regions("pole_region", pole_region)
    if pole_region is not None and (method != "lmi" or gain_bound is not None):
        other = "method='riccati'" if method != "lmi" else "gain_bound"
        shown = described(f"a region together with {other}")
        remedy = "Leave one of them out; a Disk bounds the gain as well."
        raise invalid("pole_region", shown, "method='lmi' and no gain_bound", remedy)
    budget = Budget.with_certificate_reserve(WORK, time_limit)
    wanted = certificate.NormTarget.checked(gamma)
    whole = preflight.with_control_penalty(plant, control_weight).with_full_state()
    _refuse_infeasible(whole, norm)
    together = not split or (wanted.is_requested and norm == "h2")
    pieces = (preflight.whole_plant(whole),) if together else preflight.decoupled_parts(whole)
    settings = driver.Settings(
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
        found = driver.design_by_parts(whole, pieces, settings, _SOLVABLE, budget)
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


def _message(found: driver.JoinedController) -> str:
    """Say what happened and what to try next."""
    settings, status, achieved = found.settings, found.status, found.certificate.achieved
    wanted, tolerance = settings.wanted, settings.tolerance
    size = float(np.linalg.norm(found.controller.D, 2))
    least = min(found.bound, achieved)
    text = f"Norm {achieved:.6g} with a gain of {size:.4g} (largest singular value)."
    if least > 0:
        text += f" No state feedback has a norm below {least:.6g}."
    if status == "optimal":
        if least == 0 or achieved <= driver.ROUNDING * settings.reference:
            return f"{text} But for rounding w does not reach z: the design is optimal."
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


# The search for the static gain of state feedback on one part, made of several convex ones.


# Tolerance where a design only serves as a start or shows a trend; a fifth of it is a tenth of the
# norm, which keeps gains small.
_COARSE = 0.5
# Prices on u, falling by decades: from "no control" to rounding errors; and those whose designs are
# starts under a bound on the gain.
_PRICES = tuple(10.0**k for k in range(3, -9, -1))
_STARTING_PRICES = tuple(10.0**k for k in range(4, -10, -1))
# A norm that moves by less than this share from price to price has reached its limit, if the gain
# grows by less than the factor: norms can rest on a plateau.
_GAIN_CONVERGED = 1.2
# Starts from which each search under a bound on the gain is run.
_BOUND_STARTS = 2
# Steps of one descent on the true norm.
_ITERATIONS = 150
# A step that gains less than this share ends a search.
_GAINED = 1e-5
# States that w hardly reaches are still given this share of the disturbance.
_NOISE = 1e-3
_NORMS = ("claimed", "achieved", "no_gain_found_at")
History = list[dict[str, Any]]


class StateSearch(driver.Engine):
    """The static gain u = F x of one part, made by Riccati equations or by inequalities.

    Where control has no price, the norm is followed downwards by prices that shrink; a bound on the
    gain has a search of its own; and where a norm was asked for that is not the smallest one, the
    rest is given away for a smaller gain.
    """

    def __init__(self, settings: driver.Settings, problem: driver.Task, budget: Budget) -> None:
        super().__init__(settings, problem, budget)
        assert problem.scaled is not None
        self.plant, self.scaled = problem.plant, problem.scaled
        self.norm: certificate.Norm = problem.norm
        self.tolerance = settings.relaxations[0] * settings.tolerance
        self.method, kind = settings.method, RiccatiStateEngine
        if settings.method == "lmi":
            self.backend, kind = settings.backend, lmi.LmiStateEngine
        regions = tuple(region.in_unit_of_time(self.scaled.time) for region in settings.regions)
        self.engine: StateEngine = kind(
            self.norm, self.tolerance, regions, settings.backend, settings.solver
        )
        # The gain in the plant's units is left F right.
        self.left, self.right = np.diag(self.scaled.control), np.diag(1 / self.scaled.state)
        self.bound_on_gain = math.inf if settings.gain_bound is None else settings.gain_bound

    def search(self) -> None:
        """Minimise the norm; the only candidate is a static controller."""
        found, unit = self.smallest_norm(), self.scaled.norm(1.0, self.norm)
        nu, nx = found.F.shape
        K = matrices.Controller(np.zeros((0, 0)), np.zeros((0, nx)), np.zeros((nu, 0)), found.F)
        self.candidates = [driver.Candidate(K, found.achieved, found.claimed, self.method)]
        self.history = [
            entry | {key: entry[key] * unit for key in _NORMS if key in entry}
            for entry in found.history
        ]
        self.falling = found.status == "infimum_not_attained"
        self.constrained = bool(self.engine.regions) and found.status != "optimal"
        if found.lower_bound > 0 or found.achieved == 0 or found.status == "optimal":
            self.bound = LowerBound(found.lower_bound, "which Riccati equations tell")

    def objections(
        self, K: control.StateSpace, proof: certificate.Certificate, promised: float
    ) -> list[str]:
        """Tell what a certificate does not see: bound, regions and rounding errors."""
        size, most = float(np.linalg.norm(K.D, 2)), self.bound_on_gain
        said = certificate.violated_regions(self.settings.regions, proof.poles)
        if size > most:
            said.append(f"the gain {size:.8g} exceeds {most:.8g}")
        # Share of the tolerance by which a claim may be missed in the plant's own units.
        if proof.achieved > promised * (1 + 0.3 * self.tolerance) > 0:
            said.append("the gain is so large that rounding changes the norm")
        return said

    def smallest_norm(self) -> StateGain:
        """Minimise the norm in scaled units, and bound it from below."""
        p, tolerance = self.plant, self.problem.tolerance
        if is_idle(p):
            return self._stabilised()
        enough = self.problem.wanted.limited(0.0)
        bounded = any(isinstance(region, Disk) for region in self.engine.regions)
        found = None
        if math.isfinite(self.bound_on_gain):
            found = self._bounded()
        elif matrices.is_regular(p) or bounded:  # an optimum without a price on u
            found = self.engine.search(p, self.budget)
        if found is None and not self.engine.regions and math.isinf(self.bound_on_gain):
            found = self._nulling()
        if found is None:
            # A norm that keeps falling is followed down to this share of what almost no control
            # gives; the thesis's plant without a price would fall until gains overflow.
            vanished = 1e-4 * self.settings.reference
            target = max(self.scaled.scaled_norm(vanished, self.norm), enough)
            found = self._singular(target)
            if found is None:
                raise self._no_gain_error()
            if self.engine.regions and found.achieved > target:
                found = replace(found, status="suboptimal")
        if found.achieved <= enough:
            found = self._smallest_gain(enough, found)
        least = state_norm_lower_bound(p, self.norm, found.achieved, tolerance, self.budget)
        return replace(found, lower_bound=least)

    def _nulling(self) -> StateGain | None:
        """Return a gain that keeps w from z, but for rounding; None if there is none."""
        F = output_nulling_gain(self.plant)
        rounding = self.scaled.scaled_norm(driver.ROUNDING * self.settings.reference, self.norm)
        if F is None or not self._norm(F) <= rounding:
            return None
        told = {"step": "w is kept from z", "achieved": 0.0}
        return StateGain(F, rounding, rounding, 0.0, "optimal", (told,))

    def _size(self, F: Matrix) -> float:
        """Return the largest singular value of a gain in the plant's units."""
        return float(np.linalg.norm(self.left @ F @ self.right, 2)) if F.size else 0.0

    def _inside(self, F: Matrix) -> Matrix:
        """Return F, shrunk to the bound if it is larger."""
        # A bound is kept by this share, so that rounding does not break it.
        size, limit = self._size(F), self.bound_on_gain * (1 - SAME)
        return F * (limit / size) if size > limit else F

    def _norm(self, F: Matrix | None) -> float:
        """Return the norm that a gain achieves."""
        return matrices.state_gain_norm(self.plant, F, self.norm)

    def _stabilised(self) -> StateGain:
        """Stabilise a part whose norm no control changes, with little effort."""
        F = np.zeros((self.plant.nu, self.plant.nx))
        if self.engine.regions or not matrices.stabilises(self.plant, F):
            effort = matrices.minimum_effort_problem(self.plant, 1.0)
            found = replace(self.engine, norm="h2").search(effort, self.budget)
            if found is None:
                raise self._no_gain_error()
        else:
            found = StateGain(F, 0.0, 0.0)
        norm = self._norm(found.F)
        return replace(found, claimed=norm, achieved=norm, lower_bound=norm, status="optimal")

    def _no_gain_error(self) -> SolverError:
        """Return the error for a part without an answer."""
        states = ", ".join(self.scaled.original.states[:6])
        text = f"No verified state feedback was found for the part with the states {states}"
        if self.budget.late:
            text += " before the time limit. Raise time_limit"
        if self.engine.regions:
            text += ". Widen pole_region: the inequalities use one Lyapunov matrix for all demands"
        return SolverError(f"{text}. Try the other method or backend.")

    # A bound on the largest singular value of the gain. No convex condition is both necessary and
    # sufficient for it. Priced designs that keep the bound are the starts. From there inequalities
    # with a condition on the gain that is exact at the last Lyapunov matrix are solved again and
    # again, each answer no worse than the one before; a descent on the true norm, with the bound as
    # a requirement, ends the search.

    def _bounded(self) -> StateGain:
        """Minimise the norm under a bound on the gain.

        The answer is a local optimum, or the optimum without the bound if that is within it.
        """
        if matrices.is_regular(self.plant):
            free = self.engine.search(self.plant, self.budget)
            if free is not None and self._size(free.F) <= self.bound_on_gain:
                return free
        history: History = []
        starts = self._starts(history)
        best, value = None, math.inf
        for start in starts[:_BOUND_STARTS]:
            F = self._by_inequalities(start, history)
            achieved = self._norm(F)
            if achieved < value:
                best, value = F, achieved
        # Small gains that cancel a disturbance are found from small gains only (displacement
        # actuation of the bearing): from starts below half the bound.
        small = [F for F in starts if 0 < self._size(F) < 0.5 * self.bound_on_gain]
        for start in small[:_BOUND_STARTS]:
            F = self._descent(start, history, balanced=False)
            achieved = self._norm(F)
            # Share by which a descent from a small gain has to be better to be preferred.
            if achieved < value * (1 - 1e-3):
                best, value = F, achieved
        if best is None or not math.isfinite(value):
            raise SolverError(
                f"No stabilising gain with a largest singular value of at most "
                f"{self.bound_on_gain:.6g} was found. That none exists is not proven. Raise "
                "gain_bound, or set control_weight instead."
            )
        best = self._descent(best, history)
        value = self._norm(best)
        return StateGain(best, value, value, history=tuple(history))

    def _starts(self, history: History) -> list[Matrix]:
        """Return stabilising gains within the bound, the best first.

        They come from Riccati equations whatever the method: they are quick, and only starts.
        """
        quick = RiccatiStateEngine(self.norm, max(self.tolerance, _COARSE))
        idle = np.zeros((self.plant.nu, self.plant.nx))
        found = [(self._norm(idle), idle)]
        for price in _STARTING_PRICES:
            if self.budget.over:
                break
            answer = quick.search(matrices.with_small_penalty(self.plant, price), self.budget)
            if answer is not None:
                F, size = self._inside(answer.F), self._size(answer.F)
                found.append((self._norm(F), F))
                told = {"step": "price", "price": price, "achieved": found[-1][0], "gain": size}
                history.append(told)
        ranked = sorted(found, key=lambda pair: pair[0])
        return [F for value, F in ranked if math.isfinite(value)]

    def _by_inequalities(self, start: Matrix, history: History) -> Matrix:
        """Solve the bounded inequalities about the Lyapunov matrix of the last gain, repeatedly."""
        p = matrices.compressed_outputs(self.plant)
        programs = lmi.StatePrograms(p, self.engine, self.budget, history)
        held = (self.left / self.bound_on_gain, self.right)

        def solved(c: lmi.Coordinates, step: str, **demand: Any) -> Any:
            plain = c.without_congruence()
            attempts = [(c, lmi.SOLVER_TOLERANCE), (plain, lmi.EASED_TOLERANCE)]
            return programs.first(attempts, step, noise=_NOISE, **demand)

        def improved(F: Matrix, value: float) -> Matrix | None:
            if not value > 0:
                return None
            coordinates = lmi.Coordinates.plain(p, value)
            for _ in range(2):
                found = solved(coordinates, "Lyapunov matrix of a gain", fixed=F)
                if found is None:
                    return None
                coordinates = replace(found.next, unit=value)
            found = solved(coordinates, "inequalities with the bound", held=held)
            return None if found is None else self._inside(found.gain.F)

        return self._repeated(start, improved, programs.loop_norm_of, 15)

    def _descent(self, start: Matrix, history: History, balanced: bool = True) -> Matrix:
        """Descend on the true norm, if asked in states in which the last loop is balanced."""
        p = self.plant

        def improved(F: Matrix, _: float) -> Matrix:
            T, V = _coordinates(p, F) if balanced else (np.eye(p.nx), np.eye(p.nu))
            q, back = matrices.in_states(p, T), np.linalg.inv(T)
            loop = q.replace(B2=q.B2 @ V, D12=q.D12 @ V)
            held = GainMeasure(self.left @ V, back @ self.right)
            gains, theta = _free_gain(np.linalg.solve(V, F @ T))
            problem = Problem(
                gains, norm_measure(loop, self.norm), (Requirement(held, self.bound_on_gain),)
            )
            descent = minimax(problem, theta, self.budget, _ITERATIONS)
            new = self._inside(V @ gains.gain(descent.point) @ back)
            told = {"step": "descent on the true norm", "achieved": self._norm(new)}
            history.append({**told, "ended": descent.reason})
            return new

        return self._repeated(start, improved, self._norm, 3)

    def _repeated(
        self,
        F: Matrix,
        improved: Callable[[Matrix, float], Matrix | None],
        norm: Callable[[Matrix], float],
        rounds: int,
    ) -> Matrix:
        """Improve a gain again and again, as long as its norm falls."""
        value = norm(F)
        for _ in range(rounds):
            new = None if self.budget.over else improved(F, value)
            achieved = math.inf if new is None else norm(new)
            if new is None or not achieved < value:
                break
            gained = 1 - achieved / value
            F, value = new, achieved
            if gained < _GAINED:
                break
        return F

    # Control that is free: a price on u and x shrinks until the norm stops falling.

    def _singular(self, target: float) -> StateGain | None:
        """Lower the price until the norm settles or falls below `target`.

        The first descent gives a tenth of the norm away on every rung, which keeps gains small;
        it decides where the norm falls without limit. Where it does not, a second descent looks
        for the infimum to the tolerance.

        Returns
        -------
        StateGain or None
            The smallest gain within the tolerance of the best norm seen; None if nothing
            stabilises. "infimum_not_attained" if norm or gain still moved; "suboptimal" if both
            settled, or if the budget was over before that could be seen.
        """
        coarse = replace(self.engine, tolerance=max(self.tolerance, _COARSE))
        found = self._falling_price(coarse, target)
        if found is None or found.achieved <= target or self.norm == "h2":
            return found
        return self._falling_price(self.engine, target) or found

    def _falling_price(self, engine: StateEngine, target: float) -> StateGain | None:
        """Design with prices that fall, and return the rung that is chosen."""
        history: History = []

        def rung(price: float) -> StateGain | None:
            """Design with a price; the norm is the one without."""
            found = engine.search(matrices.with_small_penalty(self.plant, price), self.budget)
            if found is None:
                return None
            achieved, size = self._norm(found.F), self._size(found.F)
            history.append({"step": "price", "price": price, "achieved": achieved, "gain": size})
            return replace(found, achieved=achieved, claimed=achieved)

        rungs: list[StateGain] = []
        settled = False
        for price in _PRICES:
            if self.budget.over:
                break
            now = rung(price)
            if now is None or not math.isfinite(now.achieved):
                continue
            rungs.append(now)
            if now.achieved <= target:
                # The price is raised again as far as the norm stays below the target: gains shrink.
                low, high = math.log(price), math.log(10.0 * price)
                high += 3 * math.log(10.0) if price == _PRICES[0] else 0.0
                for _ in range(4):
                    if self.budget.over:
                        break
                    middle = (low + high) / 2
                    other = rung(math.exp(middle))
                    if other is not None and other.achieved <= target:
                        now, low = other, middle
                    else:
                        high = middle
                return replace(now, status=self._limit(rungs, now), history=tuple(history))
            # Only below it can a norm have reached its limit: above it is the norm of no control.
            if price <= 1e-4 and len(rungs) > 1:
                before = rungs[-2]
                same_norm = before.achieved < now.achieved * (1 + driver.SETTLED)
                settled = same_norm and self._size(now.F) < _GAIN_CONVERGED * self._size(before.F)
            if settled:
                break
        if not rungs:
            return None
        least = min(each.achieved for each in rungs) * (1 + max(engine.tolerance, driver.SETTLED))
        smallest = min((g for g in rungs if g.achieved <= least), key=lambda g: self._size(g.F))
        over = settled or self.budget.over
        status = "suboptimal" if over else self._limit(rungs, smallest)
        return replace(smallest, status=status, history=tuple(history))

    def _limit(self, rungs: list[StateGain], now: StateGain) -> preflight.Status:
        """Say whether the last tenfold fall of the norm took a larger gain."""
        before = [g for g in rungs if g.achieved >= 10 * now.achieved]
        grown = not before or self._size(now.F) > _GAIN_CONVERGED * self._size(before[-1].F)
        return "infimum_not_attained" if grown else "suboptimal"

    # A norm that will do: the smallest gain that keeps it. No control at all is tried, then the
    # central gain of the target and the design with the highest price on u that keeps it; from the
    # smallest of these the largest singular value is lowered further, the norm being held. That is
    # a local optimum: a smaller gain is not ruled out.

    def _smallest_gain(self, target: float, found: StateGain) -> StateGain:
        """Give what lies between the norm of a gain and a target away for a smaller gain."""
        p, regions = self.plant, self.engine.regions
        kept = [found]
        idle = None if regions else np.zeros((p.nu, p.nx))
        if idle is not None and self._norm(idle) <= target:
            kept.append(self._keeping(idle, target, "no control"))
        else:
            if self.norm == "hinf" and matrices.is_regular(p) and not regions:
                central = central_state_gain(p, target)
                if central is not None:
                    kept.append(self._keeping(central, target, "central gain"))
            kept += filter(None, [self._singular(target)])
        smallest = min((g for g in kept if g.achieved <= target), key=lambda g: self._size(g.F))
        history = found.history + smallest.history if smallest is not found else found.history
        smallest = replace(smallest, status="suboptimal", history=history)
        # A descent leaves poles where they need not be in a region, and a norm that is not zero.
        if not (smallest.F.any() and target > 0) or regions or self.budget.over:
            return smallest
        gains, theta = _free_gain(smallest.F)
        held = Requirement(norm_measure(p, self.norm), target * (1 - SAME))
        problem = Problem(gains, GainMeasure(self.left, self.right), (held,))
        descent = minimax(problem, theta, self.budget, _ITERATIONS)
        F = gains.gain(descent.point)
        achieved = self._norm(F)
        if achieved > target or self._size(F) >= self._size(smallest.F):
            return smallest
        told = {"step": "descent on the gain", "achieved": achieved, "ended": descent.reason}
        return StateGain(F, target, achieved, 0.0, "suboptimal", (*history, told))

    def _keeping(self, F: Matrix, target: float, step: str) -> StateGain:
        achieved = self._norm(F)
        return StateGain(F, target, achieved, history=({"step": step, "achieved": achieved},))


def _free_gain(F: Matrix) -> tuple[MaskedGain, Any]:
    """Return a gain all of whose entries are free, and its coordinates at F."""
    gains = MaskedGain(np.ones(F.shape, dtype=bool))
    return gains, gains.coordinates(F)


def _coordinates(p: matrices.PlantMatrices, F: Matrix) -> tuple[Matrix, Matrix]:
    """Return states of equal variance under white noise, and controls of order one."""
    noisy = matrices.with_noise(p, _NOISE)
    W, closed = noisy.B1 @ noisy.B1.T, p.A + p.B2 @ F
    X = linalg.solve_discrete_lyapunov(closed, W) if p.discrete else solve_lyapunov(closed.T, W)
    if X is None:
        return np.eye(p.nx), np.eye(p.nu)
    T = square_root(X, 1e-14)
    size = np.linalg.norm(F @ T, axis=1)
    largest = float(size.max(initial=0.0)) or 1.0
    return T, np.diag(np.maximum(size, 1e-3 * largest))


def is_idle(p: matrices.PlantMatrices) -> bool:
    """Return whether nothing is to be minimised: no disturbance, or no performance output."""
    return not p.B1.any() or not (p.C1.any() or p.D12.any() or p.D11.any())


def reference_norm(parts: Iterable[GeneralizedPlant], norm: certificate.Norm) -> float:
    """Return the norm, with almost no control, of the parts that have no optimum.

    It is the norm without control or, if that is unstable, with the least that stabilises.
    """
    known: dict[tuple[bytes, ...], float] = {}
    norms = []
    for part in parts:
        key = matrices.PlantMatrices.of(part).fingerprint
        if key not in known and part.nu and part.nx:
            prepared = preflight.SolverPlant.of(part, mapped=False, full_state=True)
            p, value = prepared.matrices, 0.0
            if not (is_idle(p) or matrices.is_regular(p)):
                value = matrices.state_gain_norm(p, np.zeros((p.nu, p.nx)), norm)
                if not math.isfinite(value):
                    # Weight of the states against the controls where only stability is asked for.
                    least = central_state_gain(matrices.minimum_effort_problem(p, 1e-3), math.inf)
                    value = matrices.state_gain_norm(p, least, norm)
            known[key] = prepared.norm(value, norm) if math.isfinite(value) else 0.0
        norms.append(known.get(key, 0.0))
    return max(norms, default=0.0) if norm == "hinf" else math.hypot(*norms)
