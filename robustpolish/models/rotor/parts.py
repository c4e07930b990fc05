"""What a rotor consists of: lengths of shaft, discs, bearings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from robustpolish.arrays import Matrix
from robustpolish.validation import described, instance_of, invalid, is_whole, matrix, positive

STEEL: dict[str, float] = {"young_modulus": 2.11e11, "shear_modulus": 8.12e10, "density": 7810.0}


@dataclass(frozen=True)
class ShaftSegment:
    """A length of shaft with one cross-section, solid or hollow.

    Parameters
    ----------
    length : float
        In m.
    diameter : float
        Outer diameter in m.
    bore : float, optional
        Inner diameter in m; 0 for a solid shaft.
    young_modulus, shear_modulus : float, optional
        In N/m^2; those of steel by default.
    density : float, optional
        In kg/m^3; 0 neglects the shaft's own mass.
    elements : int, optional
        Into how many beam elements it is divided. Discs and bearings within it divide it further.

    Raises
    ------
    InvalidInputError
        If a size is not positive, the bore not smaller than the diameter, the moduli not those of
        an isotropic material, or the number of elements not a whole one above 0.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rod = rp.ShaftSegment(0.02, 0.003, young_modulus=2e11)
    >>> round(3 * rod.bending_stiffness / rod.length**3)  # 3 E I / l^3 in N/m
    298206
    """

    length: float
    diameter: float
    bore: float = 0.0
    young_modulus: float = STEEL["young_modulus"]
    shear_modulus: float = STEEL["shear_modulus"]
    density: float = STEEL["density"]
    elements: int = 10

    def __post_init__(self) -> None:
        units = {"length": "m", "diameter": "m", "young_modulus": "N/m^2", "shear_modulus": "N/m^2"}
        _checked(self, units, {"bore": "m", "density": "kg/m^3"})
        if self.bore >= self.diameter:
            raise invalid("bore", self.bore, "less than the diameter", "Give the inner diameter.")
        if not 0 <= self.poisson_ratio <= 0.5:
            ratio = described(f"a Poisson's ratio of {self.poisson_ratio:.3g}")
            remedy = "Check both moduli: E = 2 (1 + nu) G."
            raise invalid("shear_modulus", ratio, "one between 0 and 0.5", remedy)
        if not is_whole(self.elements):
            raise invalid("elements", self.elements, "a whole number", "Take 10.")
        if self.elements < 1:
            raise invalid("elements", self.elements, "at least 1", "Take 10.")

    @property
    def area(self) -> float:
        """Cross-section in m^2."""
        return math.pi / 4 * (self.diameter**2 - self.bore**2)

    @property
    def area_moment(self) -> float:
        """Second moment of area about a diameter in m^4, (8.2) of the thesis."""
        return math.pi / 64 * (self.diameter**4 - self.bore**4)

    @property
    def bending_stiffness(self) -> float:
        """E I in N m^2."""
        return self.young_modulus * self.area_moment

    @property
    def poisson_ratio(self) -> float:
        """From the two moduli, E = 2 (1 + nu) G."""
        return self.young_modulus / (2 * self.shear_modulus) - 1

    @property
    def shear_coefficient(self) -> float:
        """Share of the section that carries shear, Cowper (1966), J. Appl. Mech. 33, 335-340."""
        nu, squared = self.poisson_ratio, (self.bore / self.diameter) ** 2
        full = (1 + squared) ** 2
        return 6 * (1 + nu) * full / ((7 + 6 * nu) * full + (20 + 12 * nu) * squared)

    def shear_parameter(self, length: float) -> float:
        """Return phi = 12 E I / (kappa G A l^2) of an element.

        Parameters
        ----------
        length : float
            Of the element, in m.

        Returns
        -------
        float

        Examples
        --------
        >>> import robustpolish as rp
        >>> round(rp.ShaftSegment(0.02, 0.003).shear_parameter(0.02), 4)
        0.0495
        """
        shear = self.shear_coefficient * self.shear_modulus * self.area
        return 12 * self.bending_stiffness / (shear * length**2)


@dataclass(frozen=True)
class RotorDisc:
    """A rigid body on the shaft, round about its axis.

    Parameters
    ----------
    position : float
        Where its centre of mass is along the shaft, in m from the first end. Before or behind
        the shaft's ends it sits on a rigid arm.
    mass : float
        In kg.
    diametral_inertia, polar_inertia : float, optional
        Moments of inertia about a diameter and about the shaft, in kg m^2; 0 for a point mass.

    Raises
    ------
    InvalidInputError
        If a value is negative, or the polar inertia more than twice the diametral one, which no
        body has.

    Examples
    --------
    >>> import robustpolish as rp
    >>> disc = rp.RotorDisc.cylinder(0.5, diameter=0.28, width=0.07, bore=0.05)
    >>> round(disc.mass, 2), round(disc.polar_inertia, 4)
    (32.59, 0.3296)
    """

    position: float
    mass: float
    diametral_inertia: float = 0.0
    polar_inertia: float = 0.0

    def __post_init__(self) -> None:
        _place(self)
        _checked(self, {"mass": "kg"}, {"diametral_inertia": "kg m^2", "polar_inertia": "kg m^2"})
        if self.polar_inertia > 2 * self.diametral_inertia * (1 + 1e-12):
            want = f"at most twice the diametral inertia, {2 * self.diametral_inertia:.4g} kg m^2"
            raise invalid("polar_inertia", self.polar_inertia, want, "Check which is which.")

    @classmethod
    def cylinder(
        cls,
        position: float,
        *,
        diameter: float,
        width: float,
        bore: float = 0.0,
        mass: float | None = None,
        density: float = STEEL["density"],
    ) -> RotorDisc:
        """Return a cylinder with or without a bore.

        Parameters
        ----------
        position : float
            Of its middle, in m.
        diameter, width, bore : float
            In m.
        mass : float, optional
            In kg; by default from the density.
        density : float, optional
            In kg/m^3; that of steel by default.

        Returns
        -------
        RotorDisc
        """
        d = positive("diameter", diameter, "m")
        b, h = positive("width", width, "m"), positive("bore", bore, "m", zero=True)
        if h >= d:
            raise invalid("bore", bore, "less than the diameter", "Give the inner diameter.")
        volume = math.pi / 4 * (d**2 - h**2) * b
        m = volume * positive("density", density, "kg/m^3") if mass is None else mass
        m = positive("mass", m, "kg")
        about_axis = m / 8 * (d**2 + h**2)
        return cls(position, m, about_axis / 2 + m / 12 * b**2, about_axis)


@dataclass(frozen=True)
class RotorBearing:
    """A spring and a damper between shaft and ground, in both directions.

    Parameters
    ----------
    position : float
        In m from the shaft's first end. Before or behind its ends the bearing holds a rigid arm.
    stiffness : float, pair of float or array_like of shape (2, 2), optional
        In N/m: one for x and y, one each, or with cross-coupling (forces by displacements).
        ``inf`` holds the point in x and y.
    damping : float, pair of float or array_like of shape (2, 2), optional
        In N s/m.
    tilting_stiffness : float, optional
        Against tilting about x and y, in N m/rad; ``inf`` holds the slope.
    tilting_damping : float, optional
        In N m s/rad.

    Raises
    ------
    InvalidInputError
        If a value is of another shape, or negative on the diagonal.

    Examples
    --------
    >>> import math
    >>> import robustpolish as rp
    >>> clamp = rp.RotorBearing(0.0, math.inf, tilting_stiffness=math.inf)
    >>> rp.RotorBearing(0.0, (1e6, 8e5)).stiffness_matrix.tolist()
    [[1000000.0, 0.0], [0.0, 800000.0]]
    """

    position: float
    stiffness: float | Sequence[Any] = 0.0
    damping: float | Sequence[Any] = 0.0
    tilting_stiffness: float = 0.0
    tilting_damping: float = 0.0

    def __post_init__(self) -> None:
        _place(self)
        for name in ("stiffness", "damping"):
            if not (name == "stiffness" and self.pinned):
                _in_the_plane(name, getattr(self, name))
        zero = {"tilting_damping": "N m s/rad"}
        if not self.upright:
            zero["tilting_stiffness"] = "N m/rad"
        _checked(self, {}, zero)

    @property
    def pinned(self) -> bool:
        """Whether it holds x and y."""
        given = self.stiffness
        return isinstance(given, float | int) and math.isinf(given) and given > 0

    @property
    def upright(self) -> bool:
        """Whether it holds the slopes."""
        given = self.tilting_stiffness
        return isinstance(given, float) and math.isinf(given) and given > 0

    @property
    def stiffness_matrix(self) -> Matrix:
        """Forces by displacements in N/m, shape (2, 2); zero where the point is held."""
        return np.zeros((2, 2)) if self.pinned else _in_the_plane("stiffness", self.stiffness)

    @property
    def damping_matrix(self) -> Matrix:
        """Forces by velocities in N s/m, shape (2, 2)."""
        return _in_the_plane("damping", self.damping)


def _in_the_plane(name: str, value: Any) -> Matrix:
    """Return a number, a pair or a matrix as a matrix of x and y."""
    try:
        given = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        given = np.full(0, np.nan)
    if given.shape in ((), (2,)):
        found = np.diag(np.broadcast_to(given, 2))
    else:
        found = matrix(name, value, (2, 2))
    if not np.isfinite(found).all() or (np.diag(found) < 0).any():
        raise invalid(name, value, "finite numbers, none negative for x or y", "Check its sign.")
    return found


def _place(part: RotorDisc | RotorBearing) -> None:
    instance_of("position", part.position, (float, int, np.floating), "a number in m", "Write 0.5.")
    if not math.isfinite(part.position):
        raise invalid("position", part.position, "a finite number in m", "Check it.")
    object.__setattr__(part, "position", float(part.position))


def _checked(part: Any, above: dict[str, str], at_least: dict[str, str]) -> None:
    """Set fields to finite floats above zero, or at least zero."""
    for names, zero in ((above, False), (at_least, True)):
        for name, unit in names.items():
            number = positive(name, getattr(part, name), unit, zero=zero)
            object.__setattr__(part, name, number)
