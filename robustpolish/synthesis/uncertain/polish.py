"""A controller polished without fits: its numbers and the scalings of each frequency at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.arrays import Array, Vector
from robustpolish.long_calls import Budget, step_cost
from robustpolish.synthesis.nonsmooth import Parametrisation
from robustpolish.synthesis.nonsmooth.bfgs import bfgs
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.static_loop import StaticLoop, close_static
from robustpolish.synthesis.uncertain.responses import LoopResponses
from robustpolish.synthesis.uncertain.scaled_gain import ScaledGain, Scalings

# Least damping of a pole: what is narrower would fall between the frequencies of a set. A loop that
# has less to begin with may keep half of its own.
_DAMPED = 0.05
_LEAST = 1e-4
# Rate beside the lowest frequency of the set below which poles are held off.
_FENCE = 1e-2

# Numbers of scalings beyond which a step has gone astray: logarithms of D, and G in units of gain.
_LARGEST = 1e5


@dataclass(frozen=True, eq=False)
class Polished:
    """Where a descent stands.

    Attributes
    ----------
    theta : ndarray
        Numbers of the controller.
    weights : ndarray, shape (k, scalings.size)
        Those of the scalings at each frequency.
    level : float
        The largest beta that they prove at the frequencies.
    """

    theta: Vector
    weights: Array
    level: float


@dataclass(frozen=True, eq=False)
class Polish:
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
        loop = close_static(self.plant, K) if np.isfinite(K).all() else None
        return loop if loop is not None and loop.stable else None

    def squares(self, theta: Vector, weights: Array) -> Vector:
        """Return the beta^2 of each frequency."""
        loop = self.loop(theta)
        if loop is None:
            return np.full(len(self.omega), np.inf)
        M = LoopResponses.of(loop, self.omega).M
        return np.linalg.eigvalsh(ScaledGain(self.scalings, weights, M).H)[:, -1]

    def lower(
        self, start: Polished, powers: tuple[float, ...], budget: Budget, steps: int
    ) -> Polished:
        """Lower the largest beta by descents on sums of ever higher powers.

        Parameters
        ----------
        start : Polished
        powers : tuple of float
            Exponents of ``log(sum exp(p (beta^2 / beta0^2 - 1))) / p``, one descent for each.
        budget : Budget
        steps : int
            Most steps of each descent.
        """
        size, cost = len(start.theta), step_cost(self.plant.nx)
        for power in powers:
            if budget.over:
                break
            unit = start.level**2
            found = bfgs(
                lambda x, p=power, u=unit: self._value(x, size, p, u),
                np.concatenate([start.theta, start.weights.ravel()]),
                budget, cost, steps, tolerance=0.02 / power,
            )  # fmt: skip
            theta, weights = found.point[:size], found.point[size:].reshape(start.weights.shape)
            level = float(np.sqrt(max(self.squares(theta, weights).max(), 0.0)))
            if level < start.level:
                start = Polished(theta, weights, level)
        return start

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
        fence, on_K = self._fence(loop)
        on_theta = self.gain.back(theta, responses.back(on_M) + on_K)
        return float(value) + fence, np.concatenate([on_theta, on_weights.ravel()])

    @cached_property
    def _slowest(self) -> float:
        inner = self.omega[(self.omega > 0) & np.isfinite(self.omega)]
        return float(inner.min(initial=1.0))

    def _fence(self, loop: StaticLoop) -> tuple[float, Matrix]:
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
