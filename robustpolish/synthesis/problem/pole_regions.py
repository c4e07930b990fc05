"""Regions of the complex plane that a linear matrix inequality can hold the poles in."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from robustpolish.base.arrays import Matrix
from robustpolish.base.checks import described, invalid, positive

# A spring or a damper: what a passive feedback consists of.

Place = tuple[str, str]


@dataclass(frozen=True)
class PassiveElement:
    """A spring or a damper between two places.

    Attributes
    ----------
    kind : {"spring", "damper"}
    between : (str, str)
        Names of two displacements, or of one and "ground".
    coefficient : float
        Stiffness in N/m or damping in N s/m (for rotations N m/rad and N m s/rad).
    unit : str
        "N/m" or "N s/m", or what follows from the units of the plant.

    Examples
    --------
    >>> import robustpolish as rp
    >>> print(rp.results.PassiveElement("spring", ("x", "ground"), 8e4, "N/m"))
    spring between x and ground: 80000 N/m
    """

    kind: str
    between: Place
    coefficient: float
    unit: str

    def __str__(self) -> str:
        places = " and ".join(self.between)
        return f"{self.kind} between {places}: {self.coefficient:.6g} {self.unit}"


@runtime_checkable
class PoleRegion(Protocol):
    """A convex region {s : L + s M + conj(s) M' < 0}, symmetric about the real axis.

    All eigenvalues of A lie in the region exactly if there is a Y > 0 with
    kron(L, Y) + kron(M, A Y) + kron(M, A Y)' < 0 (Chilali and Gahinet, "H-infinity design
    with pole placement constraints: an LMI approach", IEEE TAC 41, 1996, theorem 2.2).
    """

    @property
    def L(self) -> Matrix:
        """Constant term, symmetric."""
        ...

    @property
    def M(self) -> Matrix:
        """Coefficient of s."""
        ...

    def in_unit_of_time(self, seconds: float) -> PoleRegion:
        """Return the region for time counted in units of `seconds`."""
        ...

    def contains(self, poles: ArrayLike, tolerance: float = 0.0) -> bool:
        """Return whether all `poles` lie inside.

        Parameters
        ----------
        poles : array_like of complex
            In rad/s, or of a discrete-time state matrix.
        tolerance : float, optional
            Allowed violation relative to the size of the terms.
        """
        s = np.atleast_1d(np.asarray(poles, dtype=complex))
        size = np.linalg.norm(self.L, 2) + 2 * np.abs(s) * np.linalg.norm(self.M, 2)
        s = s[:, None, None]
        largest = np.linalg.eigvalsh(self.L + s * self.M + np.conj(s) * self.M.T)[:, -1]
        return bool((largest < tolerance * size).all())


@dataclass(frozen=True)
class HalfPlane(PoleRegion):
    """Poles with real part below `max_real`: every motion decays at least that fast.

    Parameters
    ----------
    max_real : float
        In rad/s; negative for a decay rate of ``-max_real``.

    Raises
    ------
    InvalidInputError
        If it is not a finite number.

    Examples
    --------
    >>> HalfPlane(-10.0).contains([-20.0, -11.0 + 300.0j])
    True
    """

    max_real: float

    def __post_init__(self) -> None:
        _finite("max_real", self.max_real)

    @property
    def L(self) -> Matrix:
        """Constant term, shape (1, 1)."""
        return np.array([[-2.0 * self.max_real]])

    @property
    def M(self) -> Matrix:
        """Coefficient of s, shape (1, 1)."""
        return np.eye(1)

    def in_unit_of_time(self, seconds: float) -> HalfPlane:
        """Return the region for time counted in units of `seconds`.

        Parameters
        ----------
        seconds : float
            The new unit of time in s.

        Returns
        -------
        HalfPlane

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.HalfPlane(-10.0).in_unit_of_time(1e-3)
        HalfPlane(max_real=-0.01)
        """
        return HalfPlane(self.max_real * seconds)


@dataclass(frozen=True)
class Disk(PoleRegion):
    """Poles within `radius` of `center` on the real axis; bounds rates from both sides.

    Parameters
    ----------
    center, radius : float
        In rad/s, or without unit for discrete-time plants.

    Raises
    ------
    InvalidInputError
        If the centre is not finite or the radius not positive.

    Examples
    --------
    >>> Disk(-1000.0, 900.0).contains([-150.0, -1000.0 + 800.0j])
    True
    """

    center: float
    radius: float

    def __post_init__(self) -> None:
        _finite("center", self.center)
        positive("radius", self.radius, "rad/s")

    @property
    def L(self) -> Matrix:
        """Constant term, shape (2, 2)."""
        return np.array([[-self.radius, -self.center], [-self.center, -self.radius]])

    @property
    def M(self) -> Matrix:
        """Coefficient of s, shape (2, 2)."""
        return np.array([[0.0, 1.0], [0.0, 0.0]])

    def in_unit_of_time(self, seconds: float) -> Disk:
        """Return the region for time counted in units of `seconds`.

        Parameters
        ----------
        seconds : float
            The new unit of time in s.

        Returns
        -------
        Disk

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.Disk(-10.0, 5.0).in_unit_of_time(1e-3)
        Disk(center=-0.01, radius=0.005)
        """
        return Disk(self.center * seconds, self.radius * seconds)


@dataclass(frozen=True)
class Sector(PoleRegion):
    """Poles left of `apex` with a damping ratio of at least `damping` seen from there.

    Parameters
    ----------
    damping : float
        Damping ratio zeta, above 0 and below 1; the sector's half angle is arccos(zeta).
    apex : float, optional
        Tip on the real axis in rad/s.

    Raises
    ------
    InvalidInputError
        If the damping ratio is not between 0 and 1 or the apex not finite.

    Examples
    --------
    >>> Sector(damping=0.5).contains([-1.0 + 1.7j])
    True
    >>> Sector(damping=0.5).contains([-1.0 + 1.8j])
    False
    """

    damping: float
    apex: float = 0.0

    def __post_init__(self) -> None:
        if not 0 < positive("damping", self.damping) < 1:
            raise invalid(
                "damping",
                self.damping,
                "a damping ratio above 0 and below 1",
                "Use HalfPlane for a plain decay rate.",
            )
        _finite("apex", self.apex)

    @property
    def L(self) -> Matrix:
        """Constant term, shape (2, 2)."""
        return -2.0 * self.apex * math.sqrt(1.0 - self.damping**2) * np.eye(2)

    @property
    def M(self) -> Matrix:
        """Coefficient of s, shape (2, 2)."""
        sine, cosine = math.sqrt(1.0 - self.damping**2), self.damping
        return np.array([[sine, cosine], [-cosine, sine]])

    def in_unit_of_time(self, seconds: float) -> Sector:
        """Return the region for time counted in units of `seconds`.

        Parameters
        ----------
        seconds : float
            The new unit of time in s.

        Returns
        -------
        Sector

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.Sector(0.5, -10.0).in_unit_of_time(1e-3)
        Sector(damping=0.5, apex=-0.01)
        """
        return Sector(self.damping, self.apex * seconds)


def _finite(argument: str, value: float) -> None:
    try:
        finite = math.isfinite(value)
    except TypeError:
        finite = False
    if not finite:
        raise invalid(argument, described(repr(value)), "a finite number in rad/s", "Pass a float.")
