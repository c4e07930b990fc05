"""D-K iteration: H-infinity designs with scalings (K step), and fits of the scalings (D step).

J. C. Doyle, "Structured uncertainty in control system design", CDC 1985.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import least_squares

from robustpolish.base.arrays import AnyArray, Array, Matrix, Vector
from robustpolish.base.budget import Budget
from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.implementation.reduction import Reducer
from robustpolish.linear.arithmetic.realisation import state_scales
from robustpolish.plants.blocks import matrices_of, named_system
from robustpolish.synthesis.certificate import NormTarget
from robustpolish.synthesis.engine import Settings, Task
from robustpolish.synthesis.output_feedback.output_feedback import output_feedback
from robustpolish.synthesis.output_feedback.riccati import RegularisedRiccati
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices
from robustpolish.synthesis.riccati.gamma import estimated_lower_bound, has_full_rank
from robustpolish.synthesis.uncertain.scaled_gain import (
    LoopResponses,
    MuBounds,
    RobustProblem,
    ScaledGain,
    Scalings,
)

# The K step: the Riccati engine of output feedback on a plant with scalings around it.

# How far above the infimum a controller is made, relative: far enough for the equations to be well
# conditioned. Gains fall fast with it.
_BACK_OFF = 0.01
# How near the infimum the search for gamma ends, relative.
_TOLERANCE = 1e-3
_SETTINGS = Settings("hinf", "riccati", "scipy", None, _TOLERANCE)


def k_step(plant: PlantMatrices, unit: float, budget: Budget) -> Controller:
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


def _even(plant: PlantMatrices, unit: float) -> PlantMatrices:
    """Balance the states by powers of two, and give z the expected norm as its unit.

    In the units of the search for one norm, the feedthrough of weights with a slow pole is next to
    nothing, and rounding decides.
    """
    B, C = np.hstack([plant.B1, plant.B2]), np.vstack([plant.C1 / unit, plant.C2])
    scales, _ = state_scales(plant.A, B, C)
    return plant.replace(
        A=plant.A * scales / scales[:, None],
        B1=plant.B1 / scales[:, None],
        B2=plant.B2 / scales[:, None],
        C1=plant.C1 * scales / unit,
        C2=plant.C2 * scales,
        D11=plant.D11 / unit,
        D12=plant.D12 / unit,
    )


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
    def matrices(self) -> Controller:
        """The sections in series: A, B, C and D."""
        A, B, C, D = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.eye(1) * self.gain
        for zero, pole in zip(self.zeros, self.poles, strict=True):
            # (s/z + 1)/(s/p + 1) = p/z + (1 - p/z) p / (s + p)
            ratio = pole / zero
            c, b = np.array([[(1 - ratio) * np.sqrt(pole)]]), np.array([[np.sqrt(pole)]])
            A = np.block([[A, np.zeros((len(A), 1))], [b @ C, -pole * np.eye(1)]])
            B, C, D = np.vstack([B, b @ D]), np.hstack([ratio * C, c]), ratio * D
        return Controller(A, B, C, D)

    @property
    def inverse(self) -> Filter:
        """One over it."""
        return Filter(1 / self.gain, self.poles, self.zeros)


def _signs(numbers: Vector) -> Vector:
    """Return 1 for the zeros and -1 for the poles among [log gain, log zeros, log poles]."""
    return np.repeat([1.0, -1.0], len(numbers) // 2)


def _logs(numbers: Vector, omega: Vector) -> Vector:
    """Return log |d|, a sum of log |j omega / rate + 1|; at infinity only ratios of rates count."""
    rates, signs = numbers[1:], _signs(numbers)
    finite = np.where(np.isfinite(omega), omega, 0.0)
    sections = 0.5 * np.log1p((finite[:, None] * np.exp(-rates)) ** 2)
    return numbers[0] + np.where(np.isfinite(omega), sections @ signs, -(rates @ signs))


def _slopes(numbers: Vector, omega: Vector) -> Array:
    """Return the derivatives of the logarithms over the numbers."""
    with np.errstate(divide="ignore"):
        shares = 1 / (1 + (np.exp(numbers[1:]) / omega[:, None]) ** 2)
    return np.hstack([np.ones((len(omega), 1)), -shares * _signs(numbers)])


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
    places = np.geomspace(
        inner[0], inner[-1], max(2, int(_PLACES * np.log10(inner[-1] / inner[0])))
    )
    numbers = np.array([np.average(logs, weights=weights**2)])
    found = [_filter(numbers)]
    limits = np.log(inner[0] / 10), np.log(inner[-1] * 10)
    for order in range(most):
        rest = logs - _logs(numbers, omega)
        tried: list[tuple[float, Vector]] = []
        for place in np.log(places):
            basis = _slopes(np.array([0.0, place]), omega)
            coefficients: Any = np.linalg.lstsq(
                basis * weights[:, None], rest * weights, rcond=None
            )[0]
            left = float(np.linalg.norm((rest - basis @ coefficients) * weights))
            ratio = float(np.clip(coefficients[1], -np.log(_FARTHEST), np.log(_FARTHEST)))
            ends = [place + ratio / 2, place - ratio / 2]
            start = np.insert(numbers, [1 + order, len(numbers)], ends)
            start[0] += coefficients[0]
            tried.append((left, start))
        tried.sort(key=lambda pair: pair[0])
        results = [_adjusted(start, omega, logs, weights, limits) for _, start in tried[:3]]
        numbers = min(results, key=lambda pair: pair[0])[1]
        found.append(_filter(numbers))
    return found


def _adjusted(
    start: Vector, omega: Vector, logs: Vector, weights: Vector, limits: tuple[float, float]
) -> tuple[float, Vector]:
    low = np.concatenate([[-np.inf], np.full(len(start) - 1, limits[0])])
    high = np.concatenate([[np.inf], np.full(len(start) - 1, limits[1])])
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


def _filter(numbers: Vector) -> Filter:
    gain, *rates = np.exp(numbers)
    zeros, poles = np.array(rates).reshape(2, -1)
    return Filter(float(gain), zeros, poles)


def repeated_filters(filters: Sequence[Filter], times: Sequence[int]) -> Controller:
    """Return filters side by side, each so many times."""
    parts = [f.matrices for f, count in zip(filters, times, strict=True) for _ in range(count)]
    return Controller(*(block_diag(*each) for each in zip(*parts, strict=True)))  # pyright: ignore[reportArgumentType]


def scaled_norms(M: AnyArray, left: Matrix, right: Matrix) -> Vector:
    """Return the norms of diag(left) M diag(right)^-1 at frequencies."""
    return np.linalg.norm(left[:, :, None] * M / right[:, None, :], 2, axis=(1, 2))


# The D step: scalings of low order, and the plant with these scalings.


# Largest order of a scaling.
_ORDERS = 4
# A fit is good if it raises the level of no frequency by more than this share.
_NEAR = 0.01
# Levels below this share of the peak count as so much: there a fit matters little.
_LOW = 0.5
# No scaling.
_ONE = Filter(1.0, np.zeros(0), np.zeros(0))


def unit_scalings(problem: RobustProblem) -> list[Filter]:
    """Return the scalings to begin with: none."""
    return [_ONE] * len(problem.as_complex.blocks)


def scaled_plant(problem: RobustProblem, filters: Sequence[Filter]) -> PlantMatrices:
    """Return the plant with D on the signals z and its inverse on the signals w."""
    plant, blocks = problem.matrices, problem.as_complex.blocks
    into = repeated_filters([f.inverse for f in filters], [b.rows for b in blocks])
    out = repeated_filters(filters, [b.columns for b in blocks])
    n, i, o = plant.nx, len(into.A), len(out.A)
    zeros = np.zeros
    A = np.block(
        [
            [plant.A, plant.B1 @ into.C, zeros((n, o))],
            [zeros((i, n)), into.A, zeros((i, o))],
            [out.B @ plant.C1, out.B @ plant.D11 @ into.C, out.A],
        ]
    )
    return PlantMatrices(
        A=A,
        B1=np.vstack([plant.B1 @ into.D, into.B, out.B @ plant.D11 @ into.D]),
        B2=np.vstack([plant.B2, zeros((i, plant.nu)), out.B @ plant.D12]),
        C1=np.hstack([out.D @ plant.C1, out.D @ plant.D11 @ into.C, out.C]),
        C2=np.hstack([plant.C2, plant.D21 @ into.C, zeros((plant.ny, o))]),
        D11=out.D @ plant.D11 @ into.D,
        D12=out.D @ plant.D12,
        D21=plant.D21 @ into.D,
        D22=plant.D22,
    )


def scalings_of(problem: RobustProblem, found: MuBounds, M: AnyArray) -> list[Filter]:
    """Return the scalings of lowest order that raise the levels next to nothing."""
    blocks = problem.as_complex.blocks
    sizes = found.diagonals()
    weights = (found.values / found.peak) ** 2 + 1e-3
    offered = [
        fitted(found.omega, np.log(sizes[:, k]), weights, _ORDERS) for k in range(len(blocks) - 1)
    ]
    wanted = np.maximum(found.values, _LOW * found.peak)

    def loss(orders: list[int]) -> float:
        chosen = [one[order] for one, order in zip(offered, orders, strict=True)] + [_ONE]
        logs = np.array([f.sizes(found.omega) for f in chosen]).T
        left = np.exp(np.repeat(logs, [b.columns for b in blocks], axis=1))
        right = np.exp(np.repeat(logs, [b.rows for b in blocks], axis=1))
        return float((scaled_norms(M, left, right) / wanted).max())

    losses = [loss([order] * len(offered)) for order in range(_ORDERS + 1)]
    enough = max(min(losses), 1 + _NEAR)
    order = next(k for k, value in enumerate(losses) if value <= enough)
    orders = [order] * len(offered)
    for k in range(len(offered)):
        while orders[k] and loss([*orders[:k], orders[k] - 1, *orders[k + 1 :]]) <= enough:
            orders[k] -= 1
    return [one[order] for one, order in zip(offered, orders, strict=True)] + [_ONE]


# Order reduction of a controller, judged by the scalings of the one of full order.

# The share of its usual work that a search for fixed order gets, and its safety net in seconds.
_EFFORT = 0.1
_SECONDS = 300.0


def reduced_controllers(problem: RobustProblem, K: Controller, order: int) -> Iterator[Controller]:
    """Yield stabilising controllers of an order that stand for a longer one, in scaled units."""
    if len(K.A) <= order:
        yield K
        return
    plant = problem.scaled
    states = [f"xk{i}" for i in range(len(K.A))]
    named = named_system(tuple(K), 0, plant.measurement_names, plant.control_names, states)
    for candidate in Reducer(plant, named).of_order(order):
        found = Controller(*matrices_of(candidate.controller))
        loop = problem.loop(found)
        if loop is not None and loop.stable:
            yield found


def of_order(problem: RobustProblem, order: int, budget: Budget) -> Controller | None:
    """Return a controller of few states by the search for fixed order; None if it finds none."""
    share = min(max(budget.seconds_left, 1.0), _SECONDS)
    try:
        design = output_feedback(problem.scaled, order=order, effort=_EFFORT, time_limit=share)
    except (InfeasibleError, SolverError):
        return None
    return Controller(*matrices_of(design.controller))


def level_of(problem: RobustProblem, K: Controller, omega: Vector, weights: Array) -> float:
    """Return the largest level that scalings prove of a controller at frequencies."""
    loop = problem.loop(K)
    if loop is None or not loop.stable:
        return float(np.inf)
    M = LoopResponses.of(loop, omega).M
    squares = ScaledGain(Scalings(problem.structure), weights, M).squares
    return float(np.sqrt(max(squares.max(), 0.0)))
