"""A loop with the delays of its plant as they are, over frequency."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from robustpolish.analysis import DelayedSystem, HinfNorm
from robustpolish.analysis.delays.delayed_system import resolvent_response
from robustpolish.arrays import AnyArray, Matrix, Vector
from robustpolish.loops.response import Response

_POINTS_PER_TURN = 8
"""So many points show every turn of the delays' phase."""
_MOST_POINTS = 4000
_FAINT = 1e-3
"""Above the last frequency with this gain no turn is followed: it is 60 dB from any margin."""
_CANDIDATES = 5
"""Highest points of a grid that are climbed to their tops."""


def closed_values(G: AnyArray, K: AnyArray) -> AnyArray:
    """Return a loop from (disturbance at u, noise at y) to (u, y), frequency by frequency.

    Parameters
    ----------
    G, K : ndarray of complex, shapes (k, ny, nu) and (k, nu, ny)

    Returns
    -------
    ndarray of complex, shape (k, nu + ny, nu + ny)
    """
    nu, ny = K.shape[1], G.shape[1]
    both = np.concatenate([np.broadcast_to(np.eye(nu), (len(K), nu, nu)), K], axis=2)
    u = np.linalg.solve(np.eye(nu) - K @ G, both)
    return np.concatenate([u, G @ u + np.eye(ny, nu + ny, k=nu)], axis=1)


def opened_values(G: AnyArray, K: AnyArray, at_input: bool, broken: Sequence[int]) -> AnyArray:
    """Return L where a loop is broken, at inputs or outputs of the plant, the rest closed.

    Parameters
    ----------
    G, K : ndarray of complex, shapes (k, ny, nu) and (k, nu, ny)
    at_input : bool
    broken : sequence of int

    Returns
    -------
    ndarray of complex, shape (k, len(broken), len(broken))
    """
    around = K @ G if at_input else G @ K
    shut = np.eye(around.shape[1])
    entry = shut[:, broken]
    shut[broken, broken] = 0.0
    back = np.linalg.solve(np.eye(len(shut)) - around @ shut, around @ entry)
    return -back[:, broken]


@dataclass(frozen=True, eq=False)
class DelayedLoop:
    """Plant and controller over frequency, exp(-s tau) for every delay.

    Attributes
    ----------
    plant : DelayedSystem
        From u to y.
    controller : tuple of ndarray
        A, B, C and D of K.
    """

    plant: DelayedSystem
    controller: tuple[Matrix, Matrix, Matrix, Matrix]

    @property
    def seconds(self) -> float:
        """All delays together, which is the most that a signal can meet."""
        return float(sum(line.seconds for line in self.plant.lines))

    def closed(self, omega: Vector) -> AnyArray:
        """Return the loop from (disturbance at u, noise at y) to (u, y) at frequencies in rad/s."""
        return closed_values(*self._values(omega))

    def opened(self, at_input: bool, broken: Sequence[int], omega: Vector) -> AnyArray:
        """Return L where it is broken, at inputs or outputs of the plant, the rest closed."""
        return opened_values(*self._values(omega), at_input, broken)

    def _values(self, omega: Vector) -> tuple[AnyArray, AnyArray]:
        """Return plant and controller at frequencies."""
        omega = np.atleast_1d(omega)
        A, B, C, D = self.controller
        return self.plant.response(omega), resolvent_response(A, B, C, D, 1j * omega)


@dataclass(frozen=True, eq=False)
class DelayedResponse(Response):
    """A response whose values are those of exact delays, its Pade model showing where to look.

    Attributes
    ----------
    exact : callable
        Values at frequencies above 0 in rad/s.
    seconds : float
        Delay that turns the phase.
    """

    exact: Callable[[Vector], AnyArray] = field(kw_only=True)
    seconds: float = field(kw_only=True)

    def at(self, frequencies: Vector | float) -> AnyArray:
        """Return the response; at 0 and at infinity that of the Pade model, which is right there.

        At infinity its size is meant, of which the delays are no part.
        """
        omega = np.atleast_1d(np.asarray(frequencies, dtype=float))
        inside = (omega > 0) & np.isfinite(omega)
        values = np.empty((omega.size, *self.model.D.shape), dtype=complex)
        if not inside.all():
            values[~inside] = super().at(omega[~inside])
        if inside.any():
            values[inside] = self.exact(omega[inside])
        return values

    @cached_property
    def grid(self) -> Vector:
        """The points of the Pade model, and enough to follow every turn of the phase."""
        base = super().grid
        if not base.size:
            return base
        strong = self.sizes(base)[:, 0] > _FAINT
        top = float(base[strong].max(initial=0.0))
        step = 2 * math.pi / _POINTS_PER_TURN / self.seconds
        count = min(math.ceil(top / step), _MOST_POINTS)
        turns: Vector = step * np.arange(1, count + 1, dtype=float)
        return np.unique(np.concatenate([base, turns])).astype(float)

    def peak(self) -> HinfNorm:
        """Return the largest singular value: points, and the tops beside the highest of them."""
        omega = np.concatenate([[0.0], self.grid, [math.inf]])
        sizes = self.sizes(omega)[:, 0]
        best = int(np.argmax(sizes))
        top, where = float(sizes[best]), float(omega[best])
        for i in np.argsort(-sizes[1:-1])[:_CANDIDATES] + 1:
            low, high = omega[max(i - 1, 0)], omega[min(i + 1, len(omega) - 2)]
            found: Any = minimize_scalar(
                lambda w: -self.sizes(w)[0, 0], bounds=(low, high), method="bounded",
                options={"xatol": 1e-10 * high},
            )  # fmt: skip
            if -found.fun > top:
                top, where = float(-found.fun), float(found.x)
        reason = "with exact delays, over frequency: no proof"
        return HinfNorm(top, where, top, math.inf, True, reason)
