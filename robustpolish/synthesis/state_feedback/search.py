"""The search for a state feedback, part by part."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import control
import numpy as np
from scipy import linalg

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.budget import Budget
from robustpolish.errors import SolverError
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import Certificate, Norm
from robustpolish.synthesis.engine import Candidate, Engine, EngineResult, Settings, Task
from robustpolish.synthesis.nonsmooth.descent import Problem, Requirement, minimax
from robustpolish.synthesis.nonsmooth.measures import GainMeasure, H2Measure, HinfMeasure
from robustpolish.synthesis.nonsmooth.parametrisations import MaskedGain
from robustpolish.synthesis.problem.matrices import (
    Controller,
    PlantMatrices,
    compressed_outputs,
    in_states,
    is_regular,
    minimum_effort_problem,
    stabilises,
    state_gain_norm,
    with_noise,
    with_small_penalty,
)
from robustpolish.synthesis.problem.pole_regions import Disk, violated_regions
from robustpolish.synthesis.problem.scaling import ScaledPlant, SolverPlant
from robustpolish.synthesis.riccati.equations import solve_lyapunov
from robustpolish.synthesis.riccati.gamma import LowerBound
from robustpolish.synthesis.state_feedback.engine import POLICY, StateEngine, StateGain
from robustpolish.synthesis.state_feedback.lmi import (
    Coordinates,
    Demand,
    LmiStateEngine,
    SolvedProgram,
    StatePrograms,
)
from robustpolish.synthesis.state_feedback.riccati import (
    RiccatiStateEngine,
    central_state_gain,
    lqr_gain,
    state_norm_lower_bound,
)

# State feedback under a bound on the largest singular value of the gain.
#
# No convex condition is both necessary and sufficient for it. Priced designs that keep the bound
# are the starts. From there inequalities with a condition on the gain that is exact at the last
# Lyapunov matrix are solved again and again, each answer no worse than the one before; a descent on
# the true norm, with the bound as a requirement, ends the search.


@dataclass(frozen=True, eq=False)
class GainBound:
    """sigma_max(left F right) <= bound, where left F right is the gain in the plant's units.

    Attributes
    ----------
    left, right : ndarray
    bound : float
    """

    left: Matrix
    right: Matrix
    bound: float

    def size(self, F: Matrix) -> float:
        """Return the largest singular value in the plant's units."""
        return float(np.linalg.norm(self.left @ F @ self.right, 2)) if F.size else 0.0

    def inside(self, F: Matrix) -> Matrix:
        """Return F, shrunk to the bound if it is larger."""
        size, limit = self.size(F), self.bound * (1 - POLICY.bound_margin)
        return F * (limit / size) if size > limit else F


def minimise_bounded(
    engine: StateEngine, plant: PlantMatrices, bound: GainBound, budget: Budget
) -> StateGain | None:
    """Minimise the norm over the gains within a bound.

    Parameters
    ----------
    engine : StateEngine
    plant : PlantMatrices
        Scaled.
    bound : GainBound
    budget : Budget

    Returns
    -------
    StateGain or None
        A local optimum, or the optimum without the bound if that is within it; None if no gain
        within the bound was found that stabilises.
    """
    if is_regular(plant):
        free = engine.search(plant, budget)
        if free is not None and bound.size(free.F) <= bound.bound:
            return free
    return _BoundedSearch(engine, plant, bound, budget).run()


class _BoundedSearch:
    """The search from several starts, and its history."""

    def __init__(
        self, engine: StateEngine, plant: PlantMatrices, bound: GainBound, budget: Budget
    ) -> None:
        self.engine, self.plant, self.bound, self.budget = engine, plant, bound, budget
        self.history: list[dict[str, Any]] = []

    def run(self) -> StateGain | None:
        """Search from the best starts, then from small ones, and descend from the best end."""
        starts = self.starts()
        best: Matrix | None = None
        value = math.inf
        for start in starts[: POLICY.bound_starts]:
            F = self.by_inequalities(start)
            achieved = self.norm(F)
            if achieved < value:
                best, value = F, achieved
        # Small gains that cancel a disturbance are found from small gains only.
        # Starts below this share of the bound are small: gains that cancel a disturbance are
        # found from them only (displacement actuation of the bearing).
        limit = 0.5 * self.bound.bound
        small = [F for F in starts if 0 < self.bound.size(F) < limit]
        for start in small[: POLICY.bound_starts]:
            F = self.nonsmooth_descent(start, balanced=False)
            achieved = self.norm(F)
            # Share by which a descent from a small gain has to be better to be preferred.
            if achieved < value * (1 - 1e-3):
                best, value = F, achieved
        if best is None or not math.isfinite(value):
            return None
        best = self.nonsmooth_descent(best)
        value = self.norm(best)
        return StateGain(best, value, value, history=tuple(self.history))

    def norm(self, F: Matrix) -> float:
        """Return the norm that a gain achieves."""
        return state_gain_norm(self.plant, F, self.engine.norm)

    def starts(self) -> list[Matrix]:
        """Return stabilising gains within the bound, the best first.

        They come from Riccati equations whatever the method: they are quick, and only starts.
        """
        tolerance = max(self.engine.tolerance, POLICY.coarse)
        quick = RiccatiStateEngine(self.engine.norm, tolerance)
        idle = np.zeros((self.plant.nu, self.plant.nx))
        found: list[tuple[float, Matrix]] = [(self.norm(idle), idle)]
        for price in POLICY.starting_prices:
            if self.budget.over:
                break
            answer = quick.search(with_small_penalty(self.plant, price), self.budget)
            if answer is None:
                continue
            F, size = self.bound.inside(answer.F), self.bound.size(answer.F)
            achieved = self.norm(F)
            told = {"step": "price", "price": price, "achieved": achieved, "gain": size}
            self.history.append(told)
            found.append((achieved, F))
        ranked = sorted(found, key=lambda pair: pair[0])
        return [F for value, F in ranked if math.isfinite(value)]

    def by_inequalities(self, start: Matrix) -> Matrix:
        """Solve the bounded inequalities about the Lyapunov matrix of the last gain, repeatedly."""
        p = compressed_outputs(self.plant)
        programs = StatePrograms(p, self.engine, self.budget, self.history)
        held = (self.bound.left / self.bound.bound, self.bound.right)
        F, value = start, programs.loop_norm_of(start)
        for _ in range(15):
            if self.budget.over or not value > 0:
                break
            coordinates = Coordinates.plain(p, value)
            for _ in range(2):
                about = Demand(noise=POLICY.bound_noise, fixed=F)
                solved = _solved_either(programs, coordinates, about, "Lyapunov matrix of a gain")
                if solved is None:
                    return F
                coordinates = replace(solved.next, unit=value)
            within = Demand(noise=POLICY.bound_noise, held=held)
            solved = _solved_either(programs, coordinates, within, "inequalities with the bound")
            if solved is None:
                break
            new = self.bound.inside(solved.gain.F)
            achieved = programs.loop_norm_of(new)
            if not achieved < value:
                break
            gained = 1 - achieved / value
            F, value = new, achieved
            if gained < POLICY.gained:
                break
        return F

    def nonsmooth_descent(self, start: Matrix, balanced: bool = True) -> Matrix:
        """Descend on the true norm, if asked in states in which the last loop is balanced."""
        p, bound = self.plant, self.bound
        F, value = start, self.norm(start)
        for _ in range(3):
            if self.budget.over:
                break
            T, V = _coordinates(p, F) if balanced else (np.eye(p.nx), np.eye(p.nu))
            q = in_states(p, T)
            loop = q.replace(B2=q.B2 @ V, D12=q.D12 @ V)
            measure = HinfMeasure(loop) if self.engine.norm == "hinf" else H2Measure(loop)
            back = np.linalg.inv(T)
            held = Requirement(GainMeasure(bound.left @ V, back @ bound.right), bound.bound)
            gains = MaskedGain(np.ones(F.shape, dtype=bool))
            theta = gains.coordinates(np.linalg.solve(V, F @ T))
            problem = Problem(gains, measure, (held,))
            descent = minimax(problem, theta, self.budget, POLICY.iterations)
            new = bound.inside(V @ gains.gain(descent.point) @ back)
            achieved = self.norm(new)
            ended = descent.reason
            told = {"step": "descent on the true norm", "achieved": achieved, "ended": ended}
            self.history.append(told)
            if not achieved < value:
                break
            gained = 1 - achieved / value
            F, value = new, achieved
            if gained < POLICY.gained:
                break
        return F


def _solved_either(
    programs: StatePrograms, coordinates: Coordinates, demand: Demand, step: str
) -> SolvedProgram | None:
    solved = programs.solve(coordinates, demand, step)
    if solved is None:
        plain = coordinates.without_congruence()
        solved = programs.solve(plain, demand, step, POLICY.eased_tolerance)
    return solved


def _coordinates(p: PlantMatrices, F: Matrix) -> tuple[Matrix, Matrix]:
    """Return states of equal variance under white noise, and controls of order one."""
    noisy = with_noise(p, POLICY.bound_noise)
    W, closed = noisy.B1 @ noisy.B1.T, p.A + p.B2 @ F
    X = linalg.solve_discrete_lyapunov(closed, W) if p.discrete else solve_lyapunov(closed.T, W)
    if X is None:
        return np.eye(p.nx), np.eye(p.nu)
    values, vectors = np.linalg.eigh((X + X.T) / 2)
    T = vectors * np.sqrt(np.maximum(values, values[-1] * 1e-14))
    size = np.linalg.norm(F @ T, axis=1)
    largest = float(size.max(initial=0.0)) or 1.0
    return T, np.diag(np.maximum(size, 1e-3 * largest))


# Problems in which control is free: a price on u and x shrinks until the norm stops falling.


def least_control_norm(plant: PlantMatrices, norm: str) -> float:
    """Return the norm without control or, if that is unstable, with the least that stabilises."""
    idle = state_gain_norm(plant, np.zeros((plant.nu, plant.nx)), norm)
    if math.isfinite(idle):
        return idle
    # Weight of the states against the controls where only stability is asked for.
    least = lqr_gain(minimum_effort_problem(plant, 1e-3))
    return state_gain_norm(plant, least, norm)


def solve_singular(
    engine: StateEngine,
    plant: PlantMatrices,
    target: float,
    size: Callable[[np.ndarray], float],
    budget: Budget,
) -> StateGain | None:
    """Lower the price until the norm settles or falls below `target`.

    The first descent gives a tenth of the norm away on every rung, which keeps gains small;
    it decides where the norm falls without limit. Where it does not, a second
    descent looks for the infimum to the tolerance.

    Parameters
    ----------
    engine : StateEngine
    plant : PlantMatrices
        Scaled; D12 may lack rank.
    target : float
        A norm small enough to stop at.
    size : callable
        Gain in the plant's units.
    budget : Budget

    Returns
    -------
    StateGain or None
        The smallest gain within the tolerance of the best norm seen; None if nothing
        stabilises. "infimum_not_attained" if norm or gain still moved; "suboptimal" if both
        settled, or if the budget was over before that could be seen.
    """
    found, fell = _PenaltyDescent(
        engine.with_least_tolerance(POLICY.coarse), plant, target, size, budget
    ).run()
    if found is None or fell or engine.norm == "h2":
        return found
    return _PenaltyDescent(engine, plant, target, size, budget).run()[0] or found


@dataclass(frozen=True, eq=False)
class _PenaltyDescent:
    """One descent of the price; every rung is a design with that price."""

    engine: StateEngine
    plant: PlantMatrices
    target: float
    size: Callable[[np.ndarray], float]
    budget: Budget
    history: list[dict[str, Any]] = field(default_factory=list)

    def run(self) -> tuple[StateGain | None, bool]:
        """Return the rung that was chosen, and whether the norm still fell at the target."""
        rungs: list[StateGain] = []
        settled = False
        for price in POLICY.prices:
            if self.budget.over:
                break
            rung = self.rung(price)
            if rung is None or not math.isfinite(rung.achieved):
                continue
            rungs.append(rung)
            if rung.achieved <= self.target:
                return self.told(self.landed(rung, price), False), True
            # Only below it can a norm have reached its limit: above it is the norm of no control.
            low = price <= 1e-4 and len(rungs) > 1
            if low and self.has_converged(rungs[-2], rungs[-1]):
                settled = True
                break
        if not rungs:
            return None, False
        least = min(rung.achieved for rung in rungs)
        share = max(self.engine.tolerance, POLICY.converged)
        near = [rung for rung in rungs if rung.achieved <= least * (1 + share)]
        smallest = min(near, key=lambda rung: self.size(rung.F))
        return self.told(smallest, settled or self.budget.over), False

    def rung(self, price: float) -> StateGain | None:
        """Design with a price; the norm is the one without."""
        found = self.engine.search(with_small_penalty(self.plant, price), self.budget)
        if found is None:
            return None
        achieved = state_gain_norm(self.plant, found.F, self.engine.norm)
        told = {"step": "price", "price": price, "achieved": achieved, "gain": self.size(found.F)}
        self.history.append(told)
        return replace(found, achieved=achieved, claimed=achieved)

    def landed(self, rung: StateGain, price: float) -> StateGain:
        """Raise the price again as far as the norm stays below the target: gains shrink."""
        low, high = math.log(price), math.log(price * POLICY.price_step)
        if price == POLICY.prices[0]:
            high += 3 * math.log(POLICY.price_step)
        # Halvings between the last two prices, to meet the target with a small gain.
        for _ in range(4):
            if self.budget.over:
                break
            middle = (low + high) / 2
            other = self.rung(math.exp(middle))
            if other is not None and other.achieved <= self.target:
                rung, low = other, middle
            else:
                high = middle
        return rung

    def has_converged(self, before: StateGain, after: StateGain) -> bool:
        """Return whether neither norm nor gain still moved."""
        same_norm = before.achieved < after.achieved * (1 + POLICY.converged)
        # ... if the gain grows by less than this factor: norms can rest on a plateau.
        return same_norm and self.size(after.F) < 1.2 * self.size(before.F)

    def told(self, rung: StateGain, settled: bool) -> StateGain:
        """Return a rung with the history of all and its status."""
        status = "suboptimal" if settled else "infimum_not_attained"
        return replace(rung, status=status, history=tuple(self.history))


# A norm that will do: the smallest gain that keeps it.


@dataclass(frozen=True, eq=False)
class SmallestGain:
    """The search for the smallest gain whose norm stays below a target.

    No control at all is tried, then the central gain of the target and the design with the highest
    price on u that keeps it; from the smallest of these the largest singular value is lowered
    further, the norm being held. That is a local optimum: a smaller gain is not ruled out.

    Attributes
    ----------
    engine : StateEngine
    plant : PlantMatrices
        Scaled.
    units : GainBound
        Of the gain.
    budget : Budget
    """

    engine: StateEngine
    plant: PlantMatrices
    units: GainBound
    budget: Budget

    def within(self, target: float, found: StateGain) -> StateGain:
        """Give what lies between the norm of a gain and a target away for a smaller gain.

        Parameters
        ----------
        target : float
            A norm that will do.
        found : StateGain
            A gain that keeps it; it is returned if no other is smaller.

        Returns
        -------
        StateGain
        """
        kept = [g for g in (found, *self._others(target)) if g.achieved <= target]
        smallest = min(kept, key=lambda g: self.units.size(g.F))
        history = found.history + smallest.history if smallest is not found else found.history
        smallest = replace(smallest, status="suboptimal", history=history)
        # A descent leaves poles where they need not be in a region, and a norm that is not zero.
        if not (smallest.F.any() and target > 0) or self.engine.regions or self.budget.over:
            return smallest
        return self._lowered(target, smallest)

    def _others(self, target: float) -> Iterator[StateGain]:
        idle = self._if_admissible(np.zeros((self.plant.nu, self.plant.nx)), target, "no control")
        if idle is not None:
            yield idle
            return
        if self.engine.norm == "hinf" and is_regular(self.plant):
            central = self._if_admissible(
                central_state_gain(self.plant, target), target, "central gain"
            )
            if central is not None:
                yield central
        priced = solve_singular(self.engine, self.plant, target, self.units.size, self.budget)
        if priced is not None:
            yield priced

    def _if_admissible(self, F: Matrix | None, target: float, step: str) -> StateGain | None:
        """Return a gain that no region asks for more, if it keeps the target."""
        achieved = state_gain_norm(self.plant, F, self.engine.norm)
        if F is None or self.engine.regions or achieved > target:
            return None
        return StateGain(F, target, achieved, history=({"step": step, "achieved": achieved},))

    def _lowered(self, target: float, start: StateGain) -> StateGain:
        """Descend on the gain, with the norm as a requirement."""
        p = self.plant
        norm = HinfMeasure(p) if self.engine.norm == "hinf" else H2Measure(p)
        gains = MaskedGain(np.ones(start.F.shape, dtype=bool))
        measure = GainMeasure(self.units.left, self.units.right)
        problem = Problem(gains, measure, (Requirement(norm, target * (1 - POLICY.bound_margin)),))
        descent = minimax(problem, gains.coordinates(start.F), self.budget, POLICY.iterations)
        F = gains.gain(descent.point)
        achieved = state_gain_norm(p, F, self.engine.norm)
        if achieved > target or self.units.size(F) >= self.units.size(start.F):
            return start
        told = {"step": "descent on the gain", "achieved": achieved, "ended": descent.reason}
        return replace(
            start, F=F, claimed=target, achieved=achieved, history=(*start.history, told)
        )


# The search on one decoupled part of a plant, which the driver has scaled.


class StateSearch(Engine):
    """The static gain u = F x of one part, made by Riccati equations or by inequalities.

    Where control has no price, the norm is followed downwards by prices that shrink; a bound on the
    gain has a search of its own; and where a norm was asked for that is not the smallest one, the
    rest is given away for a smaller gain.
    """

    solver: type[StateEngine]

    def search(self, problem: Task, budget: Budget) -> EngineResult:
        """Minimise the norm; the only candidate is a static controller."""
        settings, scaled = self.settings, problem.scaled
        assert scaled is not None
        tolerance = settings.relaxations[0] * settings.tolerance
        regions = tuple(region.in_unit_of_time(scaled.time) for region in settings.regions)
        solver = self.solver(settings.norm, tolerance, regions, settings.backend, settings.solver)
        found = _PartSearch(problem, solver, settings, budget, scaled).run()
        unit = scaled.norm(1.0, settings.norm)
        nu, nx = found.F.shape
        K = Controller(np.zeros((0, 0)), np.zeros((0, nx)), np.zeros((nu, 0)), found.F)
        bound = None
        if found.lower_bound > 0 or found.achieved == 0:
            bound = LowerBound(found.lower_bound, "which Riccati equations tell")

        def objections(K: control.StateSpace, proof: Certificate, promised: float) -> list[str]:
            """Tell what a certificate does not see: bound, regions and rounding errors."""
            size, most = float(np.linalg.norm(K.D, 2)), settings.gain_bound
            said = violated_regions(settings.regions, proof.poles)
            if most is not None and size > most:
                said.append(f"the gain {size:.8g} exceeds {most:.8g}")
            # Share of the tolerance by which a claim may be missed in the plant's own units.
            if proof.achieved > promised * (1 + 0.3 * tolerance) > 0:
                said.append("the gain is so large that rounding changes the norm")
            return said

        return EngineResult(
            settings.method,
            settings.backend if settings.method == "lmi" else "scipy",
            [Candidate(K, found.achieved, found.claimed, settings.method)],
            [
                entry | {key: entry[key] * unit for key in _NORMS if key in entry}
                for entry in found.history
            ],
            falling=found.status == "infimum_not_attained",
            bound=bound,
            constrained=bool(regions) and found.status != "optimal",
            objections=objections,
        )


class RiccatiStateSearch(StateSearch):
    """Gains by Riccati equations."""

    solver = RiccatiStateEngine


class LmiStateSearch(StateSearch):
    """Gains by linear matrix inequalities."""

    solver = LmiStateEngine


def reference_norm(parts: Iterable[GeneralizedPlant], norm: Norm) -> float:
    """Return the norm, with almost no control, of the parts that have no optimum."""
    known: dict[tuple[bytes, ...], float] = {}
    norms = []
    for part in parts:
        key = PlantMatrices.of(part).fingerprint
        if key not in known and part.nu and part.nx:
            prepared = SolverPlant.of(part, mapped=False, full_state=True)
            p = prepared.matrices
            free = not (is_idle(p) or is_regular(p))
            value = least_control_norm(p, norm) if free else 0.0
            known[key] = prepared.norm(value, norm) if math.isfinite(value) else 0.0
        norms.append(known.get(key, 0.0))
    return max(norms, default=0.0) if norm == "hinf" else math.hypot(*norms)


def is_idle(p: PlantMatrices) -> bool:
    """Return whether nothing is to be minimised: no disturbance, or no performance output."""
    return not p.B1.any() or not (p.C1.any() or p.D12.any() or p.D11.any())


@dataclass(frozen=True, eq=False)
class _PartSearch:
    """The search on one part in scaled units."""

    task: Task
    engine: StateEngine
    settings: Settings
    budget: Budget
    scaled: ScaledPlant

    @property
    def plant(self) -> PlantMatrices:
        return self.task.plant

    @property
    def limits(self) -> GainBound:
        """The units of a gain, and its bound."""
        bound = self.settings.gain_bound
        left, right = np.diag(self.scaled.control), np.diag(1 / self.scaled.state)
        return GainBound(left, right, math.inf if bound is None else bound)

    def run(self) -> StateGain:
        """Minimise the norm, and bound it from below."""
        p, norm, tolerance = self.plant, self.task.norm, self.task.tolerance
        if is_idle(p):
            return self.stabilised()
        enough = self.task.wanted.limited(0.0)
        bounded = any(isinstance(region, Disk) for region in self.engine.regions)
        found = None
        if self.settings.gain_bound is not None:
            found = self.bounded()
        elif is_regular(p) or bounded:  # an optimum without a price on u
            found = self.engine.search(p, self.budget)
        if found is None:
            found = self.singular(enough)
        if found.achieved <= enough:
            found = SmallestGain(self.engine, p, self.limits, self.budget).within(enough, found)
        least = state_norm_lower_bound(p, norm, found.achieved, tolerance, self.budget)
        return replace(found, lower_bound=least)

    def stabilised(self) -> StateGain:
        """Stabilise a part whose norm no control changes, with little effort."""
        p, engine = self.plant, self.engine
        none = np.zeros((p.nu, p.nx))
        if not engine.regions and stabilises(p, none):
            found = StateGain(none, 0.0, 0.0)
        else:
            effort = minimum_effort_problem(p, 1.0)
            found = replace(engine, norm="h2").search(effort, self.budget)
        if found is None:
            raise self.no_gain_error()
        norm = state_gain_norm(p, found.F, engine.norm)
        return replace(found, claimed=norm, achieved=norm, lower_bound=norm, status="optimal")

    def bounded(self) -> StateGain:
        """Minimise the norm under a bound on the gain."""
        found = minimise_bounded(self.engine, self.plant, self.limits, self.budget)
        if found is None:
            raise SolverError(
                f"No stabilising gain with a largest singular value of at most "
                f"{self.limits.bound:.6g} was found. That none exists is not proven. Raise "
                "gain_bound, or set control_weight instead."
            )
        return found

    def singular(self, enough: float) -> StateGain:
        """Follow the infimum of a norm for which control is free, down to `enough`."""
        # A norm that keeps falling is followed down to this share of what almost no control
        # gives; the thesis's plant without a price would fall until gains overflow.
        vanished = 1e-4 * self.settings.reference
        target = max(self.scaled.scaled_norm(vanished, self.task.norm), enough)
        found = solve_singular(self.engine, self.plant, target, self.limits.size, self.budget)
        if found is None:
            raise self.no_gain_error()
        fell = found.achieved <= target
        return replace(found, status="suboptimal") if self.engine.regions and not fell else found

    def no_gain_error(self) -> SolverError:
        """Return the error for a part without an answer."""
        states = ", ".join(self.scaled.original.states[:6])
        return SolverError(
            f"No verified state feedback was found for the part with the states {states}"
            + (" before the time limit. Raise time_limit" if self.budget.late else "")
            + (
                ". Widen pole_region: the inequalities use one Lyapunov matrix for all demands"
                if self.engine.regions
                else ""
            )
            + ". Try the other method or backend."
        )


_NORMS = ("claimed", "achieved", "no_gain_found_at")
