"""The plant of a sampled loop through many periods at once, from the start of each to its end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robustpolish.arrays import Array, Matrix
from robustpolish.implementation.sampled.period_map import split_delay
from robustpolish.models import GeneralizedPlant
from robustpolish.simulation import first_order_hold

_SAME = 1e-6
"""Part of a step below which the control's change falls onto the grid."""

_Step = tuple[Matrix, Matrix, Matrix]


@dataclass(frozen=True, eq=False)
class PeriodFlow:
    """A period in equal steps, at one of which the control changes, or within it.

    Attributes
    ----------
    plant : GeneralizedPlant
        Continuous, with its filter.
    count : int
        Steps of a period.
    whole : int
        Whole periods of delay: after the change acts what was put out so many samples ago.
    cut : int
        The step at whose beginning, or within which, the control changes.
    steps : tuple
        The exact maps of a step, and of its parts before and after the change if that is within.
    left : float
        Seconds from the beginning of the step `cut` to the change.
    """

    plant: GeneralizedPlant
    count: int
    whole: int
    cut: int
    steps: tuple[_Step, ...]
    left: float

    @classmethod
    def of(cls, plant: GeneralizedPlant, period: float, count: int, delay: float) -> PeriodFlow:
        """Divide a period, and discretise its parts."""
        whole, rest = split_delay(period, delay)
        step = period / count
        cut = int(rest / step + _SAME)
        left = rest - cut * step
        if cut == count:
            whole, cut, left = whole + 1, 0, 0.0
        n, ny = plant.nx, plant.ny
        # What w adds directly to y cannot be sampled: its average over the period is a state.
        A = np.zeros((n + ny, n + ny))
        A[:n, :n] = plant.A
        B = np.block([[plant.B1, plant.B2], [plant.D21 / period, np.zeros((ny, plant.nu))]])
        split = left > _SAME * step
        lengths = (step, left, step - left) if split else (step,)
        steps = tuple(first_order_hold(A, B, length) for length in lengths)
        return cls(plant, count, whole, cut, steps, left if split else 0.0)

    @property
    def states(self) -> int:
        """Of the plant, and an average per measurement."""
        return self.plant.nx + self.plant.ny

    def through(
        self, w: Array, middle: Array, starts: Array, before: Array, after: Array
    ) -> tuple[Array, Array]:
        """Go through periods, each from a start of its own.

        Parameters
        ----------
        w : ndarray, shape (periods count + 1, nw)
            At the steps.
        middle : ndarray, shape (periods, nw)
            Where the control changes; only used if that is within a step.
        starts : ndarray, shape (periods, states)
        before, after : ndarray, shape (periods, nu)
            The control before and after its change.

        Returns
        -------
        ends : ndarray, shape (periods, states)
        z : ndarray, shape (periods count, nz)
        """
        plant, count = self.plant, self.count
        periods, n = len(starts), plant.nx
        now = w[:-1].reshape(periods, count, plant.nw)
        later = w[1:].reshape(periods, count, plant.nw)
        z = np.empty((periods, count, plant.nz))
        x = starts
        for j in range(count):
            changes = j == self.cut and self.left > 0
            u = before if j < self.cut or changes else after
            z[:, j] = x[:, :n] @ plant.C1.T + now[:, j] @ plant.D11.T + u @ plant.D12.T
            if changes:
                x = _advanced(self.steps[1], x, now[:, j], middle, u)
                x = _advanced(self.steps[2], x, middle, later[:, j], after)
            else:
                x = _advanced(self.steps[0], x, now[:, j], later[:, j], u)
        return x, z.reshape(periods * count, plant.nz)

    def held(self, before: Array, after: Array) -> Array:
        """Return the control at the steps, shape (periods count, nu)."""
        changed = np.arange(self.count) >= self.cut + (self.left > 0)
        u = np.where(changed[:, None], after[:, None], before[:, None])
        return u.reshape(-1, self.plant.nu)

    def maps(self) -> tuple[Matrix, Matrix, Matrix]:
        """Return what start, control before and control after its change make of the end."""
        n, nu, nw = self.states, self.plant.nu, self.plant.nw
        each = np.eye(n + 2 * nu)
        still = np.zeros((len(each) * self.count + 1, nw))
        parts = each[:, :n], each[:, n : n + nu], each[:, n + nu :]
        ends, _ = self.through(still, still[: len(each)], *parts)
        return ends[:n].T, ends[n : n + nu].T, ends[n + nu :].T


def _advanced(step: _Step, x: Array, now: Array, later: Array, u: Array) -> Array:
    """Return states after a step with w linear and u constant."""
    nw = now.shape[1]
    transition, first, last = step
    by_u = first[:, nw:] + last[:, nw:]
    return x @ transition.T + now @ first[:, :nw].T + later @ last[:, :nw].T + u @ by_u.T
