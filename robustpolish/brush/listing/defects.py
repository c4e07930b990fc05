"""The mistakes of the thesis's appendix D, one switch each."""

from __future__ import annotations

from dataclasses import astuple, dataclass, fields

import numpy as np
from numpy.typing import NDArray

from robustpolish.validation import described, invalid, one_of


@dataclass(frozen=True)
class ListingDefects:
    """Which mistakes of listings D.1 to D.3 to make; all of them by default.

    Two laws are no slips but the approach of the listings, and have no switch: velocities are
    overwritten inside the right-hand side, and an impulse m v / t_m acts as long as "contact"
    lasts, that is as a damper. The mended form of those is the physical simulator.

    Parameters
    ----------
    interpolation_weight : bool
        D.2 line 60, D.3 line 35: the earlier of two stored brush states is weighted by
        (1 - t + t_i)/S instead of (S - t + t_i)/S, about 1/S too much.
    bearing_gate : bool
        D.2 line 123, D.3 line 98: F_theta waits for the bearing to move, w(2), instead of the
        brush, wD(2).
    gravity_terms : bool
        D.2 lines 137 and 138: m 9.81 times a displacement is added to forces.
    polishing_force_dropped : bool
        D.2 line 138: F_z loses F_p while the bearing is up, w(11) > 0; D.3 keeps it.
    tilt_cosine : bool
        D.1 line 58, D.2 line 71, D.3 line 46: abs(cos(w1) - theta0) for cos(w1 - theta0).
    inertia_radius : bool
        D.1 lines 38 and 39: inertias with the distance r to the rim instead of the radius r_d.
    impact_mass : bool
        D.1 lines 89 to 117: the whole mass m hits instead of the mass at the rim,
        I_0 / r^2, so that an impact returns 2.8 times the velocity it takes.
    pulling_surface : bool
        D.1 lines 123 and 124, (7.8) and (7.9): forces of C1 and C2 may be negative.
    feed_friction : bool
        D.1 lines 72 and 73: the friction angle leans against the feed, 0.04 m/s, instead of
        against the slip of the spinning rim, 3.14 m/s.

    Examples
    --------
    >>> from robustpolish.brush import ListingDefects
    >>> ListingDefects.none().bearing_gate, ListingDefects.none(but=("bearing_gate",)).bearing_gate
    (False, True)
    """

    interpolation_weight: bool = True
    bearing_gate: bool = True
    gravity_terms: bool = True
    polishing_force_dropped: bool = True
    tilt_cosine: bool = True
    inertia_radius: bool = True
    impact_mass: bool = True
    pulling_surface: bool = True
    feed_friction: bool = True

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not isinstance(value, (bool, np.bool_)):
                raise invalid(f"ListingDefects.{item.name}", value, "True or False", "Pass a bool.")

    @classmethod
    def none(cls, but: tuple[str, ...] = ()) -> ListingDefects:
        """Return the listings with every mistake mended, except those named in `but`.

        Parameters
        ----------
        but : tuple of str, optional
            Names of fields.

        Returns
        -------
        ListingDefects
        """
        names = [item.name for item in fields(cls)]
        if isinstance(but, str):
            raise invalid("but", described(repr(but)), "a tuple of names", f"Pass ({but!r},).")
        for name in but:
            one_of("but", name, names)
        return cls(**{name: name in but for name in names})

    def names(self) -> tuple[str, ...]:
        """Return the names of the mistakes that are made."""
        return tuple(item.name for item in fields(self) if getattr(self, item.name))

    def as_flags(self) -> NDArray[np.bool_]:
        """Return the switches in the order of the fields, for compiled code."""
        return np.array(astuple(self), dtype=np.bool_)
