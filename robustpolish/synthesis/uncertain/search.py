"""Mu synthesis: D-K iteration, then a descent over controller and scalings at once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from robustpolish.base.arrays import AnyArray, Array, Vector
from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.budget import Budget, step_cost
from robustpolish.errors import SolverError
from robustpolish.robust.loop_model import DeltaStructure
from robustpolish.synthesis.nonsmooth.descent import bfgs
from robustpolish.synthesis.nonsmooth.parametrisations import Parametrisation
from robustpolish.synthesis.problem.matrices import (
    Controller,
    PlantMatrices,
    StaticLoop,
    augmented,
    close_static_loop,
)
from robustpolish.synthesis.uncertain.dk_iteration import (
    k_step,
    level_of,
    of_order,
    reduced_controllers,
    scaled_plant,
    scalings_of,
    unit_scalings,
)
from robustpolish.synthesis.uncertain.scaled_gain import (
    LoopResponses,
    ModalGain,
    MuBounds,
    RobustProblem,
    ScaledGain,
    Scalings,
    controller_from_matrix,
    grid,
    mu_bounds,
    unproven_frequencies,
)

# The descent over the numbers of a controller and the scalings of each frequency at once.

# Least damping of a pole: what is narrower would fall between the frequencies of a set. A loop that
# has less to begin with may keep half of its own.
_DAMPED = 0.05
_LEAST = 1e-4
# Rate beside the lowest frequency of the set below which poles are held off.
_FENCE = 1e-2

# Numbers of scalings beyond which a step has gone astray: logarithms of D, and G in units of gain.
_LARGEST = 1e5


MuDescentPoint = tuple[Vector, Array, float]
"""Numbers of the controller, those of the scalings at each frequency, and the largest beta."""


@dataclass(frozen=True, eq=False)
class MuDescent:
    """The descent over K(theta) and the scalings of a set of frequencies.

    Attributes
    ----------
    plant : PlantMatrices
        With integrators for the states of the controller.
    gain : Parametrisation
        From numbers to [[Ak, Bk], [Ck, Dk]].
    scalings : Scalings
    omega : ndarray, shape (k,)
    damping : float
        Least damping of the poles, softly.
    """

    plant: PlantMatrices
    gain: Parametrisation
    scalings: Scalings
    omega: Vector
    damping: float = _LEAST

    def loop(self, theta: Vector) -> StaticLoop | None:
        """Return the loop; None if it is not well posed, or not stable."""
        K: Matrix = self.gain.gain(theta)
        loop = close_static_loop(self.plant, K) if np.isfinite(K).all() else None
        return loop if loop is not None and loop.stable else None

    def squares(self, theta: Vector, weights: Array) -> Vector:
        """Return the beta^2 of each frequency."""
        loop = self.loop(theta)
        if loop is None:
            return np.full(len(self.omega), np.inf)
        M = LoopResponses.of(loop, self.omega).M
        return ScaledGain(self.scalings, weights, M).squares

    def lower(
        self, start: MuDescentPoint, powers: tuple[float, ...], budget: Budget, steps: int
    ) -> MuDescentPoint:
        """Lower the largest beta by descents on sums of ever higher powers.

        Parameters
        ----------
        start : MuDescentPoint
        powers : tuple of float
            Exponents of ``log(sum exp(p (beta^2 / beta0^2 - 1))) / p``, one descent for each.
        budget : Budget
        steps : int
            Most steps of each descent.
        """
        theta, weights, level = start
        size, cost = len(theta), step_cost(self.plant.nx)
        for power in powers:
            if budget.over:
                break
            found = bfgs(
                lambda x, p=power, u=level**2: self._value(x, size, p, u),
                np.concatenate([theta, weights.ravel()]),
                budget, cost, steps, tolerance=0.02 / power,
            )  # fmt: skip
            point = found.point[:size], found.point[size:].reshape(weights.shape)
            lower = float(np.sqrt(max(self.squares(*point).max(), 0.0)))
            if lower < level:
                theta, weights, level = *point, lower
        return theta, weights, level

    def _value(self, x: Vector, size: int, power: float, unit: float) -> tuple[float, Vector]:
        theta, weights = x[:size], x[size:].reshape(len(self.omega), -1)
        loop = self.loop(theta)
        if loop is None or not np.abs(weights).max(initial=0) < _LARGEST:
            return np.inf, np.zeros_like(x)
        responses = LoopResponses.of(loop, self.omega)
        scaled = ScaledGain(self.scalings, weights, responses.M)
        H = scaled.H
        if not np.isfinite(H).all():
            return np.inf, np.zeros_like(x)
        values, vectors = np.linalg.eigh(H / unit)
        largest = values.max()
        shares = np.exp(power * (values - largest))
        total = shares.sum()
        value = largest - 1 + np.log(total) / power
        weighted = (vectors * (shares / total / unit)[:, None, :]) @ np.conj(
            np.swapaxes(vectors, 1, 2)
        )
        on_M, on_weights = scaled.back(weighted)
        fence, on_K = self._stability_penalty(loop)
        on_theta = self.gain.back(theta, responses.back(on_M) + on_K)
        return float(value) + fence, np.concatenate([on_theta, on_weights.ravel()])

    @cached_property
    def _slowest(self) -> float:
        inner = self.omega[(self.omega > 0) & np.isfinite(self.omega)]
        return float(inner.min(initial=1.0))

    def _stability_penalty(self, loop: StaticLoop) -> tuple[float, Matrix]:
        """Return a penalty on poles that all but touch the axis, and its derivatives over K.

        Modes that hardly anything moves or sees would drift across unseen, and end the descent.
        """
        poles, vectors = loop.modes
        room = self.damping * np.abs(poles) + _FENCE * self._slowest
        inside = np.maximum(0.0, 1 + poles.real / room)
        near = np.flatnonzero(inside > 0)
        on_T = np.zeros(loop.K.shape)
        if not near.size:
            return 0.0, on_T
        try:
            rows = np.linalg.solve(vectors.T, np.eye(len(poles))[:, near]).T
        except np.linalg.LinAlgError:
            return 0.0, on_T
        # The room grows with the pole's size, which changes too.
        sizes = np.maximum(np.abs(poles[near]), 1e-300)
        turned = self.damping * poles[near].real * np.conj(poles[near]) / sizes / room[near]
        slopes = 2 * inside[near] * (1 - turned) / room[near]
        moved, seen = rows @ self.plant.B2, self.plant.C2 @ vectors[:, near]
        on_T = np.real(np.einsum("i,ia,bi->ab", slopes, moved, seen))
        return float((inside**2).sum()), loop.back(on_T)


def damping(loop: StaticLoop) -> float:
    """Return the least damping that is asked for in a descent that begins with a loop."""
    poles = loop.poles[loop.poles.imag > 0]
    least = float((-poles.real / np.abs(poles)).min(initial=1.0))
    return min(max(0.5 * least, _LEAST), _DAMPED)


# Steps of descents and Riccati equations, weighted by their size.
WORK = 60_000.0
# Share of it for the search by scenarios, where there are real numbers.
SCENARIO_SHARE = 0.5
# K steps at most.
_ROUNDS = 4
# A round that lowers the level by less than this share is the last.
_WORTHWHILE = 0.01
# Powers of the sums that descents lower: between K steps, and at the end.
_QUICK = (30.0, 100.0)
_FULL = (100.0, 400.0, 2000.0)
# Most steps of each.
_QUICK_STEPS = 400
_FULL_STEPS = 1200
# How often frequencies join the set of the last descent.
_SETS = 6
# Level of a frequency above that of the set, relative, from which on it joins.
_HOLE = 0.002
# By how much the proof may lie above the set's level: with less, intervals are narrow where the
# level is flat, as it is at an optimum.
_ROOM = 0.003
# A proof so far above the set's level, relative, is good enough.
AGREES = 0.005
# How often a proof may add frequencies.
PROOFS = 4
# A controller is shortened as long as its level rises by less than this share.
_SHORTENED = 0.02


@dataclass(frozen=True, eq=False)
class AnalysedController:
    """A controller, and what is known of its loop.

    Attributes
    ----------
    controller : Controller
        In scaled units.
    level : float
        The largest beta at a set of frequencies.
    omega : ndarray
        These frequencies.
    weights : ndarray
        Their scalings.
    """

    controller: Controller
    level: float
    omega: Vector
    weights: Array

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.controller.A)


class ScalingSearch:
    """One search.

    Parameters
    ----------
    problem : RobustProblem
    order : int or None
        Most states of the controller; None for as few as cost next to nothing.
    budget : Budget
    """

    def __init__(self, problem: RobustProblem, order: int | None, budget: Budget) -> None:
        self.problem, self.order, self.budget = problem, order, budget
        self.scalings = Scalings(problem.structure)
        self.history: list[dict[str, Any]] = []
        self.best: AnalysedController | None = None

    def run(self) -> AnalysedController:
        """Return the best controller.

        Raises
        ------
        SolverError
            If the first K step finds none, or none of the order asked for is stable.
        """
        level, filters = 1.0, unit_scalings(self.problem)
        for count in range(_ROUNDS):
            try:
                full = k_step(scaled_plant(self.problem, filters), level, self.budget)
            except SolverError:
                if count == 0:
                    raise
                break
            self._record_step("K step", full, sum(len(f.poles) for f in filters))
            before = self.best.level if self.best else np.inf
            found = self._started(full)
            if found is None:
                break
            found = self._lowered(found, _QUICK, _QUICK_STEPS, 1)
            self._record_step("descent", found.controller, level=found.level)
            if self.best is None or found.level < self.best.level:
                self.best = found
            if self.budget.over or not found.level < before * (1 - _WORTHWHILE):
                break
            level = found.level
            known, M = self._levels(found.controller, self.problem.as_complex, best=True)
            filters = scalings_of(self.problem, known, M)
        if self.best is None:
            raise SolverError("No stable loop was found with so few states.")
        found = self._lowered(self.best, _FULL, _FULL_STEPS, _SETS)
        self._record_step("last descent", found.controller, level=found.level)
        return found

    def _record_step(
        self, what: str, K: Controller, scalings: int = 0, level: float = np.nan
    ) -> None:
        entry = {"step": what, "states": len(K.A), "mu": level}
        self.history.append({**entry, "scaling_states": scalings, "work": self.budget.spent})

    def _levels(
        self, K: Controller, structure: DeltaStructure, best: bool
    ) -> tuple[MuBounds, AnyArray]:
        loop = self.problem.loop(K)
        if loop is None or not loop.stable:
            raise SolverError("The loop of a controller became unstable.")
        omega = grid([loop.poles, np.linalg.eigvals(self.problem.matrices.A)])
        M = LoopResponses.of(loop, omega).M
        self.budget.spend((len(omega) if best else 1) * step_cost(len(loop.A)))
        return mu_bounds(structure, omega, M, best), M

    def _started(self, full: Controller) -> AnalysedController | None:
        """Shorten a controller; None if no shorter one is stable."""
        loop = self.problem.loop(full)
        if loop is None or not loop.stable:
            return None
        known, _ = self._levels(full, self.problem.structure, best=False)
        orders = [self.order] if self.order is not None else range(1, len(full.A) + 1)
        enough = known.peak * (1 + _SHORTENED)
        weights = self.scalings.of_bounds(known.found)
        for order in orders:
            tried = [
                (level_of(self.problem, K, known.omega, weights), i, K)
                for i, K in enumerate(reduced_controllers(self.problem, full, order))
            ]
            if not tried and self.order is not None and self.best is None:
                other = of_order(self.problem, order, self.budget)
                tried = [] if other is None else [(np.inf, 0, other)]
            if not tried:
                continue
            level, _, K = min(tried)
            if self.order is not None or level <= enough:
                own, _ = self._levels(K, self.problem.structure, best=False)
                return AnalysedController(
                    K, own.peak, own.omega, self.scalings.of_bounds(own.found)
                )
        return None

    def _lowered(
        self, found: AnalysedController, powers: tuple[float, ...], steps: int, sets: int
    ) -> AnalysedController:
        """Lower the level at the set, and add frequencies where it has risen in between."""
        for _ in range(sets):
            form, theta = ModalGain.of(found.controller)
            plant, begun = augmented(self.problem.matrices, form.order), form.gain(theta)
            start = close_static_loop(plant, begun)
            assert start is not None
            descent = MuDescent(plant, form, self.scalings, found.omega, damping(start))
            theta, weights, level = descent.lower(
                (theta, found.weights, found.level), powers, self.budget, steps
            )
            loop = descent.loop(theta)
            if loop is None:
                return found
            K = controller_from_matrix(form.gain(theta), form.order)
            found = replace(found, controller=K, weights=weights, level=level)
            high = level * (1 + _HOLE)
            more = unproven_frequencies(loop, self.scalings, found.omega, found.weights, high)
            if not len(more[0]):
                break
            found = self._joined(found, *more)
            powers = powers[-2:]
        return found

    def _joined(
        self, found: AnalysedController, omega: Vector, weights: Array
    ) -> AnalysedController:
        """Add frequencies to the set."""
        found = replace(
            found,
            omega=np.concatenate([found.omega, omega]),
            weights=np.vstack([found.weights, weights]),
        )
        level = level_of(self.problem, found.controller, found.omega, found.weights)
        return replace(found, level=level)

    def with_refined_frequencies(self, found: AnalysedController) -> AnalysedController:
        """Look for frequencies at which a proof needs more than the set, and lower these too."""
        loop = self.problem.loop(found.controller)
        if loop is None or self.budget.over:
            return found
        coverage, model = self.problem.cover(loop, found.level * (1 + _ROOM))
        self.budget.spend(len(coverage.intervals) * step_cost(2 * len(loop.A)))
        self._record_step("proof", found.controller, level=coverage.level * model.gain)
        if not coverage.peaks:
            return found
        omega = np.array([model.omega(peak[0]) for peak in coverage.peaks])
        weights = self.scalings.of_bounds([peak[2] for peak in coverage.peaks], model.gain)
        found = self._joined(found, omega, weights)
        found = self._lowered(found, _FULL[1:], _FULL_STEPS, _SETS)
        self._record_step("descent after the proof", found.controller, level=found.level)
        return found
