"""Scalings as stable systems with stable inverses, fitted to their sizes over frequency."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from robustpolish.arrays import AnyArray, Array, Matrix, Vector
from robustpolish.synthesis.problem.matrices import Controller

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
        return _logs(self._numbers, omega)

    @property
    def _numbers(self) -> Vector:
        return np.concatenate([[np.log(self.gain)], np.log(self.zeros), np.log(self.poles)])

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


def _logs(numbers: Vector, omega: Vector) -> Vector:
    order = (len(numbers) - 1) // 2
    zeros, poles = numbers[1 : 1 + order], numbers[1 + order :]
    total = np.full(len(omega), numbers[0])
    for zero, pole in zip(zeros, poles, strict=True):
        total += _section(omega, zero) - _section(omega, pole)
    ends = np.isinf(omega)
    total[ends] = numbers[0] - zeros.sum() + poles.sum()
    return total


def _section(omega: Vector, log_rate: float) -> Vector:
    """Return log |j omega / rate + 1|; at infinity it is left to the caller."""
    finite = np.where(np.isfinite(omega), omega, 0.0)
    return 0.5 * np.log1p((finite * np.exp(-log_rate)) ** 2)


def _slopes(numbers: Vector, omega: Vector) -> Array:
    order = (len(numbers) - 1) // 2
    columns = [np.ones(len(omega))]
    for i, log_rate in enumerate(numbers[1:]):
        finite = np.where(np.isfinite(omega), omega, 0.0)
        square = (finite * np.exp(-log_rate)) ** 2
        share = np.where(np.isfinite(omega), square / (1 + square), 1.0)
        columns.append(-share if i < order else share)
    return np.array(columns).T


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
    for _ in range(most):
        rest = logs - _logs(numbers, omega)
        tried: list[tuple[float, Vector]] = []
        for place in places:
            basis = _slopes(np.array([0.0, np.log(place)]), omega)
            coefficients: Any = np.linalg.lstsq(
                basis * weights[:, None], rest * weights, rcond=None
            )[0]
            left = float(np.linalg.norm((rest - basis @ coefficients) * weights))
            ratio = float(np.clip(coefficients[1], -np.log(_FARTHEST), np.log(_FARTHEST)))
            zero, pole = np.log(place) + ratio / 2, np.log(place) - ratio / 2
            order = (len(numbers) - 1) // 2
            start = np.concatenate(
                [
                    [numbers[0] + coefficients[0]],
                    numbers[1 : 1 + order],
                    [zero],
                    numbers[1 + order :],
                    [pole],
                ]
            )
            tried.append((left, start))
        tried.sort(key=lambda pair: pair[0])
        results = [_adjusted(start, omega, logs, weights, limits) for _, start in tried[:3]]
        numbers = min(results, key=lambda pair: pair[0])[1]
        found.append(_filter(numbers))
    return found


def _weighted_slopes(numbers: Vector, omega: Vector, weights: Vector) -> Array:
    return _slopes(numbers, omega) * weights[:, None]


def _adjusted(
    start: Vector, omega: Vector, logs: Vector, weights: Vector, limits: tuple[float, float]
) -> tuple[float, Vector]:
    low = np.concatenate([[-np.inf], np.full(len(start) - 1, limits[0])])
    high = np.concatenate([[np.inf], np.full(len(start) - 1, limits[1])])
    # The type stubs know only the names of finite differences here.
    slopes: Any = functools.partial(_weighted_slopes, omega=omega, weights=weights)
    found = least_squares(
        lambda v: (_logs(v, omega) - logs) * weights,
        np.clip(start, low + 1e-6, high - 1e-6),
        jac=slopes,
        bounds=(low, high),
        max_nfev=100,
    )
    return float(found.cost), found.x


def _filter(numbers: Vector) -> Filter:
    order = (len(numbers) - 1) // 2
    rates = np.exp(numbers[1:])
    return Filter(float(np.exp(numbers[0])), rates[:order], rates[order:])


def beside(filters: Sequence[Filter], times: Sequence[int]) -> Controller:
    """Return filters side by side, each so many times."""
    parts = [f.matrices for f, count in zip(filters, times, strict=True) for _ in range(count)]
    n, m = sum(len(p.A) for p in parts), len(parts)
    A, B, C, D = np.zeros((n, n)), np.zeros((n, m)), np.zeros((m, n)), np.zeros((m, m))
    first = 0
    for i, part in enumerate(parts):
        own = slice(first, first + len(part.A))
        A[own, own], B[own, i], C[i, own] = part.A, part.B[:, 0], part.C[0]
        D[i, i] = part.D[0, 0]
        first += len(part.A)
    return Controller(A, B, C, D)


def scaled_norms(M: AnyArray, left: Matrix, right: Matrix) -> Vector:
    """Return the norms of diag(left) M diag(right)^-1 at frequencies."""
    return np.linalg.norm(left[:, :, None] * M / right[:, None, :], 2, axis=(1, 2))
