"""Coulomb's cone of friction (section 7.1)."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan

import numpy as np
from numpy.typing import ArrayLike

from robustpolish.arrays import Vector
from robustpolish.validation import described, invalid, positive


@dataclass(frozen=True)
class FrictionCone:
    """The forces that dry contact can carry: within an angle sigma of the normal.

    Parameters
    ----------
    friction : float
        Coefficient mu [-].

    Raises
    ------
    InvalidInputError
        If it is negative or not finite.

    References
    ----------
    M.L. Postma, Polishing robot: vibrations due to impact, (7.1) to (7.3).

    Examples
    --------
    >>> from robustpolish.brush import FrictionCone
    >>> cone = FrictionCone(0.5)
    >>> round(cone.angle, 6), cone.holds([0.4, 0, 1], normal=[0, 0, 1])
    (0.463648, True)
    >>> cone.sliding(10.0, slip=[3.0, 0, 0], normal=[0, 0, 1]).tolist()
    [-5.0, 0.0, 10.0]
    """

    friction: float

    def __post_init__(self) -> None:
        value = positive("FrictionCone.friction", self.friction, "-", zero=True)
        object.__setattr__(self, "friction", value)

    @property
    def angle(self) -> float:
        """Angle of friction sigma [rad], tan(sigma) = mu (7.3)."""
        return atan(self.friction)

    def holds(self, force: ArrayLike, normal: ArrayLike) -> bool:
        """Whether contact carries a force without sliding: it pushes, and lies in the cone.

        Parameters
        ----------
        force : array_like, shape (3,)
            On the body that touches [N].
        normal : array_like, shape (3,)
            Of the surface, towards the body; of any length but zero.

        Returns
        -------
        bool
        """
        pushing, along = _parts(force, normal)
        return bool(pushing >= 0.0 and np.linalg.norm(along) <= self.friction * pushing)

    def sliding(self, normal_force: float, slip: ArrayLike, normal: ArrayLike) -> Vector:
        """Force of a contact that slides: on the edge of the cone, against the slip (7.2).

        Parameters
        ----------
        normal_force : float
            Above zero or zero [N].
        slip : array_like, shape (3,)
            Velocity of the body over the surface [m/s]; its part along the normal is left out.
        normal : array_like, shape (3,)
            Of the surface, towards the body; of any length but zero.

        Returns
        -------
        ndarray, shape (3,)
            In N.

        Raises
        ------
        InvalidInputError
            If nothing slips: then the cone says no more than a bound.
        """
        pushed = positive("normal_force", normal_force, "N", zero=True)
        _, along = _parts(slip, normal)
        speed = float(np.linalg.norm(along))
        if speed == 0.0:
            raise invalid("slip", slip, "a velocity along the surface", "Ask `holds` at rest.")
        unit = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
        return pushed * (unit - self.friction * along / speed)


def _parts(vector: ArrayLike, normal: ArrayLike) -> tuple[float, Vector]:
    """Component along the normal, and what is across it."""
    given, axis = np.asarray(vector, dtype=float), np.asarray(normal, dtype=float)
    length = np.linalg.norm(axis)
    if given.shape != (3,) or axis.shape != (3,) or not length > 0.0:
        shown = described(f"shapes {given.shape} and {axis.shape}, length {length:g}")
        raise invalid("normal", shown, "two vectors of shape (3,), a normal above 0", "Give both.")
    along = float(given @ axis / length)
    return along, given - along * axis / length
