"""What every surface that is polished can be asked."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robustpolish.validation import invalid

Floats = NDArray[np.float64]


class PolishedSurface(ABC):
    """A height over the plane, with slopes, bends and what follows from them."""

    @abstractmethod
    def height(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Height f(x, y) [m] over the zero plane; x, y in m, broadcast together."""

    @abstractmethod
    def gradient(self, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
        """Slopes df/dx and df/dy [-]; x, y in m, broadcast together."""

    @abstractmethod
    def bends(self, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Second derivatives f_xx, f_xy and f_yy [1/m]; x, y in m, broadcast together."""

    @property
    @abstractmethod
    def sharpest_bend(self) -> float:
        """Largest second derivative of the height anywhere [1/m], at least 0."""

    @property
    @abstractmethod
    def packed(self) -> Floats:
        """What compiled code reads of it; nothing of a trough, which it knows by its bends."""

    def elevation(
        self, x: ArrayLike, y: ArrayLike, direction: tuple[ArrayLike, ArrayLike]
    ) -> Floats:
        """Angle of elevation [rad] in a direction (eqs. 9.4 and 9.5).

        Parameters
        ----------
        x, y : array_like
            Places [m].
        direction : tuple of array_like
            Components (n_x, n_y) of the direction, of any length but zero.

        Returns
        -------
        ndarray
            atan of the slope in the direction, positive uphill.

        Raises
        ------
        InvalidInputError
            If the direction has no length.

        Examples
        --------
        >>> import robustpolish as rp
        >>> float(rp.Surface(along=0.0, across=1.0).elevation(0.0, 0.01, (0.0, 2.0)).round(6))
        0.309703
        """
        along, across = (np.asarray(part, dtype=float) for part in direction)
        length = np.hypot(along, across)
        if not np.all(length > 0.0):
            raise invalid("direction", direction, "a vector of a length above 0", "Give n_x, n_y.")
        slope_x, slope_y = self.gradient(x, y)
        return np.arctan((along * slope_x + across * slope_y) / length)

    def principal_curvatures(self, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
        """Return the largest and the smallest curvature of the surface [1/m].

        Those of the surface itself, not of its height: the slopes count, too (M. P. do Carmo,
        *Differential Geometry of Curves and Surfaces*, section 3-3, example 5).

        Parameters
        ----------
        x, y : array_like
            Places [m], broadcast together.

        Returns
        -------
        largest, smallest : ndarray
            Positive where the surface is hollow, as seen from above.

        Examples
        --------
        >>> import robustpolish as rp
        >>> hollow, ridge = rp.Surface(along=0.0).principal_curvatures(0.0, 0.0)
        >>> float(hollow), float(ridge)
        (80.0, 0.0)
        """
        p, q = self.gradient(x, y)
        r, s, t = self.bends(x, y)
        stretch = 1.0 + p**2 + q**2
        mean = ((1 + q**2) * r - 2 * p * q * s + (1 + p**2) * t) / (2 * stretch**1.5)
        gauss = (r * t - s**2) / stretch**2
        half = np.sqrt(np.maximum(mean**2 - gauss, 0.0))
        return mean + half, mean - half
