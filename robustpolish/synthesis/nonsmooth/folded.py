"""Free numbers within bounds for descents that know of none: the line of numbers is folded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.arrays import AnyVector as Vector
from robustpolish.synthesis.nonsmooth.parametrisations import Parametrisation

Bounds = tuple[Vector, Vector]


@dataclass(frozen=True, eq=False)
class Folded:
    """A parametrisation whose free numbers turn back at their bounds.

    A minimum at a bound becomes one at a kink, which BFGS with a weak Wolfe search finds; a smooth
    change of variables would make every bound stationary instead.

    Attributes
    ----------
    inner : Parametrisation
    bounds : pair of ndarray
        Infinite for none; the lower below the upper.
    """

    inner: Parametrisation
    bounds: Bounds

    @property
    def size(self) -> int:
        """Number of free numbers."""
        return self.inner.size

    def point(self, theta: Vector) -> Vector:
        """Return where `theta` is folded to."""
        return self._folded(theta)[0]

    def gain(self, theta: Vector) -> Matrix:
        """Return K(theta)."""
        return self.inner.gain(self._folded(theta)[0])

    def back(self, theta: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over K into one over theta."""
        point, slope = self._folded(theta)
        return slope * self.inner.back(point, gradient)

    def _folded(self, theta: Vector) -> tuple[Vector, Vector]:
        low, high = self.bounds
        point, slope = np.array(theta, dtype=float), np.ones(len(theta))
        both = np.isfinite(low) & np.isfinite(high)
        if both.any():
            width = (high - low)[both]
            along = np.mod(point[both] - low[both], 2 * width)
            slope[both] = np.where(along <= width, 1.0, -1.0)
            point[both] = low[both] + np.minimum(along, 2 * width - along)
        for bound, sign in ((low, 1.0), (high, -1.0)):
            # Below a lower bound, or above an upper one, where it is the only one.
            out = ~both & np.isfinite(bound) & (sign * (point - bound) < 0)
            point[out], slope[out] = 2 * bound[out] - point[out], -1.0
        return np.clip(point, low, high), slope
