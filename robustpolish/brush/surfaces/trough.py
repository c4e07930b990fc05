"""The thesis's surface: a trough of the form (9.1), its height, slope and curvature."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robustpolish.brush.surfaces.polished_surface import PolishedSurface
from robustpolish.validation import positive

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
    >>> surface = rp.Surface()
    >>> round(1e3 * surface.trough_radius, 1)
    12.5
    >>> surface.fits(0.010), rp.Surface.as_published().fits(0.010)
    (True, False)
    >>> round(1e6 * float(surface.height(0.0, 0.002))), float(surface.gradient(0.0, 0.001)[1])
    (160, 0.08)
    >>> bool(rp.Surface.flat().height(0.1, 0.1) == 0)
    True
    """

    along: float = field(default=0.1, metadata={"unit": "1/m", "source": "eq. 9.1"})
    across: float = field(
        default=2.5, metadata={"unit": "1/m", "source": "chosen so that the disc fits"}
    )

    def __post_init__(self) -> None:
        for name in ("along", "across"):
            object.__setattr__(
                self, name, positive(f"Surface.{name}", getattr(self, name), "1/m", zero=True)
            )

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
        >>> [float(bend) for bend in rp.Surface(along=0.0).bends(0.0, 0.0)]
        [0.0, 0.0, 80.0]
        """
        everywhere = np.zeros(np.broadcast_shapes(np.shape(x), np.shape(y)))
        bend_x, bend_y = self.curvatures
        return everywhere + bend_x, everywhere, everywhere + bend_y
