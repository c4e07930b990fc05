"""Mu synthesis: D-K iteration, then a descent over controller and scalings at once.

J. C. Doyle, "Structured uncertainty in control system design", CDC 1985.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import least_squares

from robustpolish.base.arrays import AnyArray, Array, Vector
from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.budget import Budget, step_cost
from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.implementation.reduction import Reducer
from robustpolish.linear.arithmetic.exact import state_scales
from robustpolish.linear.systems import named_system
from robustpolish.plants.blocks import matrices_of
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.robust.loop_model import DeltaStructure
from robustpolish.synthesis.certificate import NormTarget
from robustpolish.synthesis.design import Design
from robustpolish.synthesis.driver import Settings, Task
from robustpolish.synthesis.nonsmooth.descent import Parametrisation, bfgs
from robustpolish.synthesis.output_feedback.output_feedback import (
    RegularisedRiccati,
    output_feedback,
)
from robustpolish.synthesis.problem import matrices
from robustpolish.synthesis.riccati.gamma import estimated_lower_bound, has_full_rank
from robustpolish.synthesis.uncertain.scaled_gain import (
    LoopResponses,
    ModalGain,
    MuBounds,
    RobustProblem,
    ScaledGain,
    Scalings,
    grid,
    unproven_frequencies,
)

# The K step: the Riccati engine of output feedback on a plant with scalings around it.

# How far above the infimum a controller is made, relative: far enough for the equations to be well
# conditioned. Gains fall fast with it.
_BACK_OFF = 0.01
# How near the infimum the search for gamma ends, relative.
_TOLERANCE = 1e-3
_SETTINGS = Settings("hinf", "riccati", "scipy", None, _TOLERANCE)


def k_step(plant: matrices.PlantMatrices, unit: float, budget: Budget) -> matrices.Controller:
    """Return a controller of full order whose norm is near the infimum.

    Full order matters: a shorter controller may reach the same norm, but is worse where the scaled
    gain is below its peak, and there the next scalings would have nothing to gain.

    Parameters
    ----------
    plant : PlantMatrices
        Continuous, without D22.
    unit : float
        A norm that is expected.
    budget : Budget

    Raises
    ------
    SolverError
        If no equation has a solution that stabilises.
    """
    even = _even(plant, unit)
    bound = estimated_lower_bound(even, _TOLERANCE, budget)
    enough = 0.0 if bound is None else bound.value * (1 + _BACK_OFF)
    task = Task(even, "hinf", has_full_rank(even), _BACK_OFF / 2, bound, NormTarget(enough, np.inf))
    engine = RegularisedRiccati(_SETTINGS, task, budget)
    engine.search()
    found = engine.candidates
    if not found:
        raise SolverError("The Riccati equations of the scaled plant have no solution in doubles.")
    return min(found, key=lambda candidate: candidate.achieved).controller


def _even(plant: matrices.PlantMatrices, unit: float) -> matrices.PlantMatrices:
    """Balance the states by powers of two, and give z the expected norm as its unit.

    In the units of the search for one norm, the feedthrough of weights with a slow pole is next to
    nothing, and rounding decides.
    """
    even = plant.replace(C1=plant.C1 / unit, D11=plant.D11 / unit, D12=plant.D12 / unit)
    scales, _ = state_scales(*even.system[:3])
    return even.in_states(np.diag(1 / scales), np.diag(scales))


# Scalings as stable systems with stable inverses, fitted to their sizes over frequency.

# Places per decade at which a new pole and zero are tried.
_PLACES = 2.0
# Largest ratio of a zero and its pole at the start of a fit.
_FARTHEST = 30.0


@dataclass(frozen=True, eq=False)
class Filter:
    """d(s) = gain prod (s / zero + 1) / (s / pole + 1), zeros and poles negative by their signs.

    Attributes
    ----------
    gain : float
    zeros, poles : ndarray
        Rates, positive.
    """

    gain: float
    zeros: Vector
    poles: Vector

    def sizes(self, omega: Vector) -> Vector:
        """Return the logarithm of |d| at frequencies, infinity included."""
        rates = np.log(np.concatenate([self.zeros, self.poles]))
        return _logs(np.array([np.log(self.gain), *rates]), omega)

    @property
    def matrices(self) -> matrices.SystemMatrices:
        """The sections in series."""
        none = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))
        K = matrices.SystemMatrices(*none, np.eye(1) * self.gain)
        for zero, pole in zip(self.zeros, self.poles, strict=True):
            # (s/z + 1)/(s/p + 1) = p/z + (1 - p/z) p / (s + p)
            one, ratio, root = np.eye(1), pole / zero, np.sqrt(pole)
            section = matrices.SystemMatrices(
                -pole * one, root * one, (1 - ratio) * root * one, ratio * one
            )
            K = matrices.in_series(K, section)
        return K

    @classmethod
    def of(cls, numbers: Vector) -> Filter:
        """Return the filter of [log gain, log zeros, log poles]."""
        gain, *rates = np.exp(numbers)
        zeros, poles = np.array(rates).reshape(2, -1)
        return cls(float(gain), zeros, poles)

    @property
    def inverse(self) -> Filter:
        """One over it."""
        return Filter(1 / self.gain, self.poles, self.zeros)


def _logs(numbers: Vector, omega: Vector) -> Vector:
    """Return log |d|, a sum of log |j omega / rate + 1|; at infinity only ratios of rates count."""
    rates = numbers[1:]
    signs = np.repeat([1.0, -1.0], len(rates) // 2)
    finite = np.where(np.isfinite(omega), omega, 0.0)
    sections = 0.5 * np.log1p((finite[:, None] * np.exp(-rates)) ** 2)
    return numbers[0] + np.where(np.isfinite(omega), sections @ signs, -(rates @ signs))


def _slopes(numbers: Vector, omega: Vector) -> Array:
    """Return the derivatives of the logarithms over the numbers."""
    with np.errstate(divide="ignore"):
        shares = 1 / (1 + (np.exp(numbers[1:]) / omega[:, None]) ** 2)
    signs = np.repeat([1.0, -1.0], len(numbers) // 2)
    return np.hstack([np.ones((len(omega), 1)), -shares * signs])


def fitted(omega: Vector, logs: Vector, weights: Vector, most: int) -> list[Filter]:
    """Return filters of order 0, 1, ... whose sizes come near given ones.

    Parameters
    ----------
    omega : ndarray
        0 and infinity may be among them.
    logs : ndarray
        Logarithms of the sizes.
    weights : ndarray
        How much each matters.
    most : int
        Largest order.
    """
    inner = omega[np.isfinite(omega) & (omega > 0)]
    count = max(2, int(_PLACES * np.log10(inner[-1] / inner[0])))
    places = np.log(np.geomspace(inner[0], inner[-1], count))
    limits, far = (np.log(inner[0] / 10), np.log(inner[-1] * 10)), np.log(_FARTHEST)

    def adjusted(start: Vector) -> tuple[float, Vector]:
        rates = np.ones(len(start) - 1)
        low, high = np.append(-np.inf, limits[0] * rates), np.append(np.inf, limits[1] * rates)
        # The type stubs know only the names of finite differences here.
        slopes: Any = lambda v: _slopes(v, omega) * weights[:, None]  # noqa: E731
        found = least_squares(
            lambda v: (_logs(v, omega) - logs) * weights,
            np.clip(start, low + 1e-6, high - 1e-6),
            jac=slopes,
            bounds=(low, high),
            max_nfev=100,
        )
        return float(found.cost), found.x

    numbers = np.array([np.average(logs, weights=weights**2)])
    found = [Filter.of(numbers)]
    for order in range(most):
        rest = logs - _logs(numbers, omega)
        tried: list[tuple[float, Vector]] = []
        for place in places:
            basis = _slopes(np.array([0.0, place]), omega)
            best: Any = np.linalg.lstsq(basis * weights[:, None], rest * weights, rcond=None)[0]
            left = float(np.linalg.norm((rest - basis @ best) * weights))
            ratio = float(np.clip(best[1], -far, far))
            ends = [place + ratio / 2, place - ratio / 2]
            start = np.insert(numbers, [1 + order, len(numbers)], ends)
            start[0] += best[0]
            tried.append((left, start))
        tried.sort(key=lambda pair: pair[0])
        numbers = min((adjusted(start) for _, start in tried[:3]), key=lambda pair: pair[0])[1]
        found.append(Filter.of(numbers))
    return found


# No scaling.
ONE = Filter(1.0, np.zeros(0), np.zeros(0))


def repeated_filters(
    filters: Sequence[Filter], times: Sequence[int], others: int
) -> matrices.SystemMatrices:
    """Return filters side by side, each so many times, and other signals as they are."""
    times = [*times, others]
    parts = [f.matrices for f, n in zip([*filters, ONE], times, strict=True) for _ in range(n)]
    return matrices.SystemMatrices(*(block_diag(*each) for each in zip(*parts, strict=True)))  # pyright: ignore[reportArgumentType]


# The D step: scalings of low order, and the plant with these scalings.


# Largest order of a scaling.
_ORDERS = 4
# A fit is good if it raises the level of no frequency by more than this share.
_NEAR = 0.01
# Levels below this share of the peak count as so much: there a fit matters little.
_LOW = 0.5


def scaled_plant(problem: RobustProblem, filters: Sequence[Filter]) -> matrices.PlantMatrices:
    """Return the plant with D on the signals z and its inverse on the signals w."""
    plant, blocks = problem.matrices, problem.as_complex.blocks
    into = repeated_filters([f.inverse for f in filters], [b.rows for b in blocks], plant.nu)
    out = repeated_filters(filters, [b.columns for b in blocks], plant.ny)
    whole = matrices.in_series(matrices.in_series(into, plant.system), out)
    return matrices.PlantMatrices.of_system(whole, plant.nw, plant.nz)


def scalings_of(problem: RobustProblem, found: MuBounds, M: AnyArray) -> list[Filter]:
    """Return the scalings of lowest order that raise the levels next to nothing."""
    blocks = problem.as_complex.blocks
    sizes = found.diagonals()
    weights = (found.values / found.peak) ** 2 + 1e-3
    offered = [
        fitted(found.omega, np.log(sizes[:, k]), weights, _ORDERS) for k in range(len(blocks) - 1)
    ]
    wanted = np.maximum(found.values, _LOW * found.peak)

    def chosen(orders: Sequence[int]) -> list[Filter]:
        return [one[order] for one, order in zip(offered, orders, strict=True)] + [ONE]

    def loss(orders: list[int]) -> float:
        logs = np.array([f.sizes(found.omega) for f in chosen(orders)]).T
        left = np.exp(np.repeat(logs, [b.columns for b in blocks], axis=1))
        right = np.exp(np.repeat(logs, [b.rows for b in blocks], axis=1))
        norms = np.linalg.norm(left[:, :, None] * M / right[:, None, :], 2, axis=(1, 2))
        return float((norms / wanted).max())

    losses = [loss([order] * len(offered)) for order in range(_ORDERS + 1)]
    enough = max(min(losses), 1 + _NEAR)
    order = next(k for k, value in enumerate(losses) if value <= enough)
    orders = [order] * len(offered)
    for k in range(len(offered)):
        while orders[k] and loss([*orders[:k], orders[k] - 1, *orders[k + 1 :]]) <= enough:
            orders[k] -= 1
    return chosen(orders)


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


def largest_level(
    loop: matrices.StaticLoop | None, scalings: Scalings, omega: Vector, weights: Array
) -> float:
    """Return the largest beta that scalings prove of a loop at frequencies; infinite of none."""
    if loop is None:
        return np.inf
    squares = ScaledGain(scalings, weights, LoopResponses.of(loop, omega).M).squares
    return float(np.sqrt(max(squares.max(), 0.0)))


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

    plant: matrices.PlantMatrices
    gain: Parametrisation
    scalings: Scalings
    omega: Vector
    damping: float = _LEAST

    def loop(self, theta: Vector) -> matrices.StaticLoop | None:
        """Return the loop; None if it is not well posed, or not stable."""
        K: Matrix = self.gain.gain(theta)
        loop = matrices.close_static_loop(self.plant, K) if np.isfinite(K).all() else None
        return loop if loop is not None and loop.stable else None

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
            lower = largest_level(self.loop(point[0]), self.scalings, self.omega, point[1])
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
        adjoint = np.conj(np.swapaxes(vectors, 1, 2))
        on_M, on_weights = scaled.back((vectors * (shares / total / unit)[:, None, :]) @ adjoint)
        fence, on_K = self._stability_penalty(loop)
        on_theta = self.gain.back(theta, responses.back(on_M) + on_K)
        return float(value) + fence, np.concatenate([on_theta, on_weights.ravel()])

    def _stability_penalty(self, loop: matrices.StaticLoop) -> tuple[float, Matrix]:
        """Return a penalty on poles that all but touch the axis, and its derivatives over K.

        Modes that hardly anything moves or sees would drift across unseen, and end the descent.
        """
        poles, vectors = loop.modes
        slowest = self.omega[(self.omega > 0) & np.isfinite(self.omega)].min(initial=1.0)
        room = self.damping * np.abs(poles) + _FENCE * slowest
        inside = np.maximum(0.0, 1 + poles.real / room)
        near = np.flatnonzero(inside > 0)
        nothing = 0.0, np.zeros(loop.K.shape)
        if not near.size:
            return nothing
        try:
            rows = np.linalg.solve(vectors.T, np.eye(len(poles))[:, near]).T
        except np.linalg.LinAlgError:
            return nothing
        # The room grows with the pole's size, which changes too.
        sizes = np.maximum(np.abs(poles[near]), 1e-300)
        turned = self.damping * poles[near].real * np.conj(poles[near]) / sizes / room[near]
        slopes = 2 * inside[near] * (1 - turned) / room[near]
        moved, seen = rows @ self.plant.B2, self.plant.C2 @ vectors[:, near]
        on_T = np.real(np.einsum("i,ia,bi->ab", slopes, moved, seen))
        return float((inside**2).sum()), loop.back(on_T)


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
SHORTENED = 0.02
"""A controller is shortened as long as its level rises by less than this share."""

# The share of its usual work that a search for fixed order of one machine gets, and the seconds of
# it when the safety net of the whole search is nearly reached: no search ends at once.
_EFFORT, _LEAST_SECONDS = 0.1, 0.01


def design_one(plant: GeneralizedPlant, order: int | None, budget: Budget) -> Design | None:
    """Design a controller for one machine, of at most some order; None if none is found."""
    try:
        return output_feedback(
            plant,
            order=order,
            effort=1.0 if order is None else _EFFORT,
            time_limit=max(budget.seconds_left, _LEAST_SECONDS),
        )
    except (InfeasibleError, SolverError):
        return None


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

    controller: matrices.Controller
    level: float
    omega: Vector
    weights: Array


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
        problem, level = self.problem, 1.0
        filters = [ONE] * len(problem.as_complex.blocks)
        for count in range(_ROUNDS):
            try:
                full = k_step(scaled_plant(problem, filters), level, self.budget)
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
            if self.best is None or found.level < before:
                self.best = found
            if self.budget.over or not found.level < before * (1 - _WORTHWHILE):
                break
            level = found.level
            filters = scalings_of(problem, *self._levels(found.controller, problem.as_complex))
        if self.best is None:
            raise SolverError("No stable loop was found with so few states.")
        found = self._lowered(self.best, _FULL, _FULL_STEPS, _SETS)
        self._record_step("last descent", found.controller, level=found.level)
        return found

    def _analysed(self, K: matrices.Controller) -> AnalysedController | None:
        """Return a controller with the scalings of its own loop; None if that is not stable."""
        if self.problem.loop(K) is None:
            return None
        known, _ = self._levels(K)
        return AnalysedController(K, known.peak, known.omega, self.scalings.of_bounds(known.found))

    def _record_step(
        self, what: str, K: matrices.Controller, scalings: int = 0, level: float = np.nan
    ) -> None:
        entry = {"step": what, "states": len(K.A), "mu": level}
        self.history.append({**entry, "scaling_states": scalings, "work": self.budget.spent})

    def _levels(
        self, K: matrices.Controller, structure: DeltaStructure | None = None
    ) -> tuple[MuBounds, AnyArray]:
        """Return bounds of mu, the best ones of a structure, or quick ones; and the responses."""
        loop = self.problem.loop(K)
        if loop is None:
            raise SolverError("The loop of a controller became unstable.")
        omega = grid([loop.poles, np.linalg.eigvals(self.problem.matrices.A)])
        M = LoopResponses.of(loop, omega).M
        quick = structure is None
        self.budget.spend((1 if quick else len(omega)) * step_cost(len(loop.A)))
        asked = self.problem.structure if structure is None else structure
        return MuBounds.over(asked, omega, M, best=not quick), M

    def _level(self, K: matrices.Controller, omega: Vector, weights: Array) -> float:
        return largest_level(self.problem.loop(K), self.scalings, omega, weights)

    def _started(self, full: matrices.Controller) -> AnalysedController | None:
        """Shorten a controller; None if no shorter one is stable."""
        known = self._analysed(full)
        if known is None:
            return None
        orders = [self.order] if self.order is not None else range(1, len(full.A) + 1)
        enough = known.level * (1 + SHORTENED)
        for order in orders:
            tried = [
                (self._level(K, known.omega, known.weights), i, K)
                for i, K in enumerate(self._reduced(full, order))
            ]
            if not tried and self.order is not None and self.best is None:
                design = design_one(self.problem.scaled, order, self.budget)
                found = design and matrices.Controller(*matrices_of(design.controller))
                tried = [] if found is None else [(np.inf, 0, found)]
            if not tried:
                continue
            level, _, K = min(tried)
            if self.order is not None or level <= enough:
                return self._analysed(K)
        return None

    def _reduced(self, K: matrices.Controller, order: int) -> Iterator[matrices.Controller]:
        """Yield stabilising controllers of an order that stand for a longer one."""
        if len(K.A) <= order:
            yield K
            return
        plant = self.problem.scaled
        states = [f"xk{i}" for i in range(len(K.A))]
        named = named_system(tuple(K), 0, plant.measurement_names, plant.control_names, states)
        for candidate in Reducer(plant, named).of_order(order):
            found = matrices.Controller(*matrices_of(candidate.controller))
            if self.problem.loop(found) is not None:
                yield found

    def _lowered(
        self, found: AnalysedController, powers: tuple[float, ...], steps: int, sets: int
    ) -> AnalysedController:
        """Lower the level at the set, and add frequencies where it has risen in between."""
        for _ in range(sets):
            form, theta = ModalGain.of(found.controller)
            plant = matrices.augmented(self.problem.matrices, form.order)
            start = matrices.close_static_loop(plant, form.gain(theta))
            assert start is not None
            poles = start.poles[start.poles.imag > 0]
            own = float((-poles.real / np.abs(poles)).min(initial=1.0))
            damping = min(max(0.5 * own, _LEAST), _DAMPED)
            descent = MuDescent(plant, form, self.scalings, found.omega, damping)
            begin = theta, found.weights, found.level
            theta, weights, level = descent.lower(begin, powers, self.budget, steps)
            loop = descent.loop(theta)
            if loop is None:
                return found
            K = matrices.controller_from_matrix(form.gain(theta), form.order)
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
        omega = np.concatenate([found.omega, omega])
        weights = np.vstack([found.weights, weights])
        level = self._level(found.controller, omega, weights)
        return replace(found, omega=omega, weights=weights, level=level)

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
