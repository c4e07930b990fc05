"""Laws of the force with which a surface stops a mass."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import expm1, log1p
from typing import Any

from scipy import optimize

from robustpolish.brush.contact.impact import quarter_period
from robustpolish.validation import invalid, positive

# Untyped on purpose: checkers would read all of scipy's solvers for what it returns.
_brentq: Any = optimize.brentq


@dataclass(frozen=True)
class LinearSpring:
    """A spring that pushes only: force k_p times depth, nothing lost.

    Parameters
    ----------
    stiffness : float
        k_p in N/m.

    Examples
    --------
    >>> from robustpolish.brush import LinearSpring
    >>> LinearSpring(1e4).force(0.001, 0.0), LinearSpring(1e4).restitution(3.0)
    (10.0, 1.0)
    """

    stiffness: float

    def __post_init__(self) -> None:
        _check(self)

    def force(self, depth: float, rate: float) -> float:
        """Return the push; the rate does not matter.

        Parameters
        ----------
        depth : float
            Below the surface [m].
        rate : float
            Of the depth [m/s].

        Returns
        -------
        float
            In N.
        """
        return max(0.0, self.stiffness * depth)

    def restitution(self, speed: float) -> float:
        """Speed after over speed before a blow: 1.

        Parameters
        ----------
        speed : float
            Of the blow [m/s].

        Returns
        -------
        float
        """
        return 1.0


@dataclass(frozen=True)
class HuntCrossley:
    """A spring whose damping grows with depth: k_p depth (1 + chi rate), never below zero.

    Unlike a damper beside the spring it neither begins with a jump nor ends by pulling.

    Parameters
    ----------
    stiffness : float
        k_p in N/m.
    damping : float
        chi in s/m.

    References
    ----------
    K. H. Hunt and F. R. E. Crossley, Coefficient of restitution interpreted as damping in
    vibroimpact, Journal of Applied Mechanics 42 (1975).

    Examples
    --------
    >>> from robustpolish.brush import HuntCrossley
    >>> law = HuntCrossley.of_restitution(1e6, 0.5, speed=0.1)
    >>> round(law.restitution(0.1), 12), round(law.damping, 2)
    (0.5, 14.33)
    """

    stiffness: float
    damping: float

    def __post_init__(self) -> None:
        _check(self)

    @classmethod
    def of_restitution(cls, stiffness: float, restitution: float, speed: float) -> HuntCrossley:
        """Find the damping that leaves a share of the speed of a blow.

        Parameters
        ----------
        stiffness : float
            In N/m.
        restitution : float
            Between 0 and 1, both excluded.
        speed : float
            Of the blow [m/s].

        Returns
        -------
        HuntCrossley
        """
        if not 0.0 < restitution < 1.0:
            expected = "a share between 0 and 1, both excluded"
            raise invalid("restitution", restitution, expected, "Take LinearSpring for 1.")
        rate = positive("speed", speed, "m/s")
        # e falls as chi v grows, from 1 at 0; e chi v stays below 1.
        strength = _brentq(
            lambda s: _left_over(s) - restitution, 1e-9, 2.0 / restitution, xtol=1e-14
        )
        return cls(stiffness, float(strength) / rate)

    def force(self, depth: float, rate: float) -> float:
        """Return the push.

        Parameters
        ----------
        depth : float
            Below the surface [m].
        rate : float
            Of the depth [m/s].

        Returns
        -------
        float
            In N.
        """
        return max(0.0, self.stiffness * depth) * max(0.0, 1.0 + self.damping * rate)

    def restitution(self, speed: float) -> float:
        """Speed after over speed before a blow, from the energy that it loses.

        e with chi v - ln(1 + chi v) = -chi e v - ln(1 - chi e v). It depends on neither mass nor
        stiffness, and is near 1 - 2 chi v / 3 for slow blows.

        Parameters
        ----------
        speed : float
            Of the blow [m/s].

        Returns
        -------
        float
        """
        return _left_over(self.damping * positive("speed", speed, "m/s", zero=True))


@dataclass(frozen=True)
class EventImpulse:
    """Impulse and duration, (7.37) to (7.40), as one event per blow.

    When the mass arrives with speed v its velocity is reversed to e v, once; the impulse
    (1 + e) m v is shown as a force over t_m. The thesis has e = 0.

    Parameters
    ----------
    stiffness : float
        k_p in N/m, which makes t_m.
    returned : float
        Restitution e, 0 to below 1.

    Examples
    --------
    >>> from robustpolish.brush import EventImpulse
    >>> EventImpulse(1e4).restitution(1.0)
    0.0
    """

    stiffness: float
    returned: float = 0.0

    def __post_init__(self) -> None:
        _check(self)
        if self.returned >= 1.0:
            expected = "a share below 1, or bounces never end"
            raise invalid("EventImpulse.returned", self.returned, expected, "Lower it.")

    def restitution(self, speed: float) -> float:
        """Speed after over speed before a blow.

        Parameters
        ----------
        speed : float
            Of the blow [m/s].

        Returns
        -------
        float
        """
        return self.returned


@dataclass(frozen=True)
class ListingImpulse:
    """The same impulse as listing D.1 has it: force m v / t_m for as long as contact lasts.

    That is a damper of m / t_m: it never lets go, and its force is as large as the speed that
    other forces keep up, however long.

    Parameters
    ----------
    stiffness : float
        k_p in N/m, which makes t_m.
    mass : float
        That counts as hitting [kg].

    Examples
    --------
    >>> from robustpolish.brush import ListingImpulse
    >>> round(ListingImpulse(1e4, 0.2).force(0.001, 1.0), 2)
    28.47
    """

    stiffness: float
    mass: float

    def __post_init__(self) -> None:
        _check(self)

    def force(self, depth: float, rate: float) -> float:
        """Return the push; a mass that leaves is held back.

        Parameters
        ----------
        depth : float
            Below the surface [m].
        rate : float
            Of the depth [m/s].

        Returns
        -------
        float
            In N.
        """
        return self.mass * rate / quarter_period(self.mass, self.stiffness) if depth > 0.0 else 0.0

    def restitution(self, speed: float) -> float:
        """Speed after over speed before a blow: 0, the mass stays.

        Parameters
        ----------
        speed : float
            Of the blow [m/s].

        Returns
        -------
        float
        """
        return 0.0


ContactLaw = LinearSpring | HuntCrossley | EventImpulse | ListingImpulse


def _left_over(strength: float) -> float:
    """Solve s - ln(1 + s) = -s e - ln(1 - s e) for e, with s = chi v: energy lost in a blow."""
    if strength < 1e-4:  # the logarithms cancel there; the rest of the series is below 1e-12
        return 1.0 - 2.0 * strength / 3.0 + 4.0 * strength**2 / 9.0
    spent = strength - log1p(strength)
    # With b = -ln(1 - s e) > 0, s e = 1 - exp(-b): no root is lost next to s e = 1.
    found = _brentq(lambda b: b + expm1(-b) - spent, 0.0, strength + 2.0, xtol=1e-15)
    return -expm1(-float(found)) / strength


def _check(law: ContactLaw) -> None:
    """Check every number of a law: stiffness and mass above zero, the rest not below."""
    for item in fields(law):
        name, value = f"{type(law).__name__}.{item.name}", getattr(law, item.name)
        zero = item.name not in ("stiffness", "mass")
        object.__setattr__(law, item.name, positive(name, value, zero=zero))
