"""K = [[Ak, Bk], [Ck, Dk]] as a function of the numbers of blocks, with its adjoint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.arrays import AnyVector as Vector
from robustpolish.synthesis.blocks.coordinate import Coordinate
from robustpolish.synthesis.blocks.stage import Stage


@dataclass(frozen=True, eq=False)
class WiredStage:
    """A stage at its place among all of them.

    Attributes
    ----------
    stage : Stage
    numbers : ndarray of int
        Which of the free numbers each slot takes; -1 for one that is held.
    held : ndarray
        Values of the held slots, in the units of the search; 0 elsewhere.
    sizes : ndarray
        Units of the slots.
    rows, columns : ndarray of int
        Where its matrix stands in that of all stages.
    """

    stage: Stage
    numbers: NDArray[np.int_]
    held: Vector
    sizes: Vector
    rows: NDArray[np.int_]
    columns: NDArray[np.int_]

    def values(self, numbers: Vector) -> Vector:
        """Return the values of its slots, in the units of the search."""
        if not len(self.numbers):
            return self.held
        free = self.numbers >= 0
        return np.where(free, numbers[self.numbers] / self.sizes, self.held)


@dataclass(frozen=True, eq=False)
class BlockGain:
    """The matrix M of all stages, side by side, wired to one controller.

    K = leave T enter with T = M (I - wires M)^-1: what stages put out goes into those behind them.
    As no wire leads back, the inverse exists for any M.

    Attributes
    ----------
    coordinates : sequence of Coordinate
        Of the free numbers.
    stages : sequence of WiredStage
    enter, wires, leave : ndarray
        From (xk, y) to the inputs of M; from its outputs to its inputs; from its outputs to
        (xk', u).
    """

    coordinates: Sequence[Coordinate]
    stages: Sequence[WiredStage]
    enter: Matrix
    wires: Matrix
    leave: Matrix

    @property
    def size(self) -> int:
        """Number of free numbers."""
        return len(self.coordinates)

    def numbers(self, theta: Vector) -> Vector:
        """Return the free numbers in their units."""
        return np.array([c.value(t) for c, t in zip(self.coordinates, theta, strict=True)])

    def gain(self, theta: Vector) -> Matrix:
        """Return K(theta)."""
        M = self._side_by_side(self.numbers(theta))
        return self.leave @ (M @ self._around(M)) @ self.enter

    def back(self, theta: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over K into one over theta."""
        numbers = self.numbers(theta)
        M = self._side_by_side(numbers)
        around = self._around(M)
        # dT = (I - M wires)^-1 dM (I - wires M)^-1, and (I - M wires)^-1 = I + T wires.
        on_t = self.leave.T @ gradient @ self.enter.T
        on_m = (on_t + (M @ around @ self.wires).T @ on_t) @ around.T
        found = np.zeros(self.size)
        for wired in self.stages:
            own = on_m[wired.rows[:, None], wired.columns]
            slopes = wired.stage.back(wired.values(numbers), own)
            for number, slope, size in zip(wired.numbers, slopes, wired.sizes, strict=True):
                if number >= 0:
                    found[number] += slope / size
        return found * [c.slope(t) for c, t in zip(self.coordinates, theta, strict=True)]

    def _side_by_side(self, numbers: Vector) -> Matrix:
        M = np.zeros(self.wires.T.shape)
        for wired in self.stages:
            M[wired.rows[:, None], wired.columns] = wired.stage.matrix(wired.values(numbers))
        return M

    def _around(self, M: Matrix) -> Matrix:
        """Return (I - wires M)^-1."""
        one = np.eye(len(self.wires))
        return np.linalg.inv(one - self.wires @ M) if self.wires.any() else one
