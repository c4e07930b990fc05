"""Polished surfaces: height, slopes and curvatures, and the trough (9.1) of the thesis."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robustpolish.base.checks import invalid
from robustpolish.polishing.quantities import check_quantities, quantity

# Common interface of surfaces.

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
        >>> surface = rp.polishing.Surface(along=0.0, across=1.0)
        >>> float(surface.elevation(0.0, 0.01, (0.0, 2.0)).round(6))
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
        >>> hollow, ridge = rp.polishing.Surface(along=0.0).principal_curvatures(0.0, 0.0)
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


_ALONG_FACTOR = (5.0 / 4.0) ** 2
_ACROSS_FACTOR = 4.0**2


@dataclass(frozen=True)
class Surface(PolishedSurface):
    r"""A trough :math:`f(x, y) = a (5x/4)^2 + b (4y)^2`, heights in m (thesis, eq. 9.1).

    Both coefficients have to be at least zero: only on a surface that is nowhere bulging does
    a disc touch with its rim alone, which is what the physical simulator assumes.

    Parameters
    ----------
    along : float
        Coefficient a [1/m] along the feed, x.
    across : float
        Coefficient b [1/m] across it, y. The default, 2.5, gives the bottom of the trough a radius
        of 12.5 mm, so that the brush of 10 mm fits. The thesis prints 5, which gives 6.25 mm:
        see `as_published`.

    Raises
    ------
    InvalidInputError
        If a coefficient is negative or not finite.

    Examples
    --------
    >>> import robustpolish as rp
    >>> surface = rp.polishing.Surface()
    >>> round(1e3 * surface.trough_radius, 1)
    12.5
    >>> surface.fits(0.010), rp.polishing.Surface.as_published().fits(0.010)
    (True, False)
    >>> round(1e6 * float(surface.height(0.0, 0.002))), float(surface.gradient(0.0, 0.001)[1])
    (160, 0.08)
    >>> bool(rp.polishing.Surface.flat().height(0.1, 0.1) == 0)
    True
    """

    along: float = quantity(0.1, "1/m", "eq. 9.1")
    across: float = quantity(2.5, "1/m", "chosen so that the disc fits")

    def __post_init__(self) -> None:
        check_quantities(self, "Surface.", zero=("along", "across"))

    @classmethod
    def as_published(cls) -> Surface:
        """Return the surface of eq. (9.1) to the letter; a disc of 10 mm does not fit in it."""
        return cls(along=0.1, across=5.0)

    @classmethod
    def flat(cls) -> Surface:
        """Return the plane z = 0."""
        return cls(along=0.0, across=0.0)

    @property
    def curvatures(self) -> tuple[float, float]:
        """Second derivatives of the height along and across the feed [1/m]."""
        return 2.0 * _ALONG_FACTOR * self.along, 2.0 * _ACROSS_FACTOR * self.across

    @property
    def trough_radius(self) -> float:
        """Smallest radius of curvature [m]; infinite for the plane."""
        return float("inf") if self.sharpest_bend == 0.0 else 1.0 / self.sharpest_bend

    @property
    def sharpest_bend(self) -> float:
        """Larger second derivative of the height [1/m]."""
        return max(self.curvatures)

    @property
    def packed(self) -> NDArray[np.float64]:
        """Empty: the simulators know a trough by its two bends."""
        return np.empty(0)

    def fits(self, radius: float) -> bool:
        """Whether a disc of that radius [m] goes into the bottom of the trough.

        Parameters
        ----------
        radius : float
            In m.

        Returns
        -------
        bool
        """
        return self.trough_radius > radius

    def height(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
        """Height f(x, y) [m] over the zero plane (eq. 9.1); x, y in m, broadcast together.

        Parameters
        ----------
        x, y : array_like
            In m, broadcast together.

        Returns
        -------
        ndarray
        """
        bend_x, bend_y = self.curvatures
        return np.asarray(0.5 * bend_x * np.square(x) + 0.5 * bend_y * np.square(y))

    def gradient(
        self, x: ArrayLike, y: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Slopes df/dx and df/dy [-]; x, y in m.

        Parameters
        ----------
        x, y : array_like
            In m, broadcast together.

        Returns
        -------
        tuple of ndarray
        """
        bend_x, bend_y = self.curvatures
        return bend_x * np.asarray(x, dtype=float), bend_y * np.asarray(y, dtype=float)

    def bends(
        self, x: ArrayLike, y: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Second derivatives f_xx, f_xy and f_yy [1/m], the same everywhere.

        Parameters
        ----------
        x, y : array_like
            In m, broadcast together.

        Returns
        -------
        tuple of ndarray

        Examples
        --------
        >>> import robustpolish as rp
        >>> [float(bend) for bend in rp.polishing.Surface(along=0.0).bends(0.0, 0.0)]
        [0.0, 0.0, 80.0]
        """
        everywhere = np.zeros(np.broadcast_shapes(np.shape(x), np.shape(y)))
        bend_x, bend_y = self.curvatures
        return everywhere + bend_x, everywhere, everywhere + bend_y
