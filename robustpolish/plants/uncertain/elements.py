"""Uncertain elements: real numbers, complex numbers, and dynamics of bounded gain.

Each is normalised to a delta of size at most 1, and 0 where it is nominal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

from robustpolish.base.checks import described, invalid

Kind = Literal["real", "complex", "dynamic"]


@dataclass(frozen=True)
class Directions:
    """What the directions of an ellipsoid do: numbers p = p0 + L d.

    Attributes
    ----------
    names : tuple of str
        Of the directions.
    numbers : tuple of str
        Names of the physical numbers.
    centre : tuple of float
        p0.
    slopes : tuple of tuple of float
        Rows of L.
    """

    names: tuple[str, ...]
    numbers: tuple[str, ...]
    centre: tuple[float, ...]
    slopes: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class RealElement:
    """A real number between two others.

    Attributes
    ----------
    name : str
    nominal : float
        Within the range, not at its ends.
    low, high : float
    group : str
        Of the ellipsoid that it is a direction of, empty for a number of its own: real elements of
        one group have deltas whose sum of squares is at most 1, in all. Their nominal value is in
        the middle.
    directions : Directions or None
        What all directions of its group do to physical numbers, if that is known.

    Notes
    -----
    Where the nominal value is not in the middle, value and delta are related by a fraction,
    ``value = nominal + slope delta / (1 - skew delta)``, so that the ends are at -1 and 1.
    """

    name: str
    nominal: float
    low: float
    high: float
    group: str = ""
    directions: Directions | None = None

    kind = "real"
    shape = (1, 1)

    @property
    def skew(self) -> float:
        """How far the nominal value is from the middle: 0 there, below 1 in size."""
        up, down = self.high - self.nominal, self.nominal - self.low
        if abs(up - down) <= 1e-12 * (up + down):
            return 0.0  # the middle but for the rounding of a percentage
        return (up - down) / (up + down)

    @property
    def slope(self) -> float:
        """Change of the value per delta at the nominal value."""
        up, down = self.high - self.nominal, self.nominal - self.low
        return 2 * up * (down / (up + down))

    def value(self, delta: float) -> float:
        """Return the number at a delta.

        Parameters
        ----------
        delta : float

        Returns
        -------
        float
        """
        return self.nominal + self.slope * delta / (1 - self.skew * delta)

    def delta(self, value: Any) -> float:
        """Return the delta of a number, which may lie outside the range.

        Parameters
        ----------
        value : float

        Returns
        -------
        float
        """
        number = real_number(self.name, value)
        change = number - self.nominal
        below = self.slope + self.skew * change
        if below <= 0:
            raise invalid(
                self.name,
                value,
                f"a number on the same side of {self.nominal - self.slope / self.skew:.6g}",
                "The range is not symmetrical, and has no meaning so far outside.",
            )
        return change / below

    def __str__(self) -> str:
        if self.group:
            return f"direction of the ellipsoid {self.group!r}"
        return f"real number {self.nominal:.6g}, from {self.low:.6g} to {self.high:.6g}"


@dataclass(frozen=True)
class ComplexElement:
    """A complex number in a disc.

    Attributes
    ----------
    name : str
    nominal : float
        Centre of the disc; real, as the matrices of a nominal system are.
    radius : float
    """

    name: str
    nominal: float
    radius: float

    kind = "complex"
    shape = (1, 1)

    def value(self, delta: complex) -> complex:
        """Return the number at a delta.

        Parameters
        ----------
        delta : complex

        Returns
        -------
        complex
        """
        return self.nominal + self.radius * delta

    def __str__(self) -> str:
        return f"complex number {self.nominal:.6g}, within {self.radius:.6g}"


@dataclass(frozen=True)
class DynamicElement:
    """Any stable system whose largest gain is at most 1.

    Attributes
    ----------
    name : str
    shape : (int, int)
        Outputs and inputs.
    """

    name: str
    shape: tuple[int, int] = (1, 1)

    kind = "dynamic"

    def __str__(self) -> str:
        return f"dynamics {self.shape[0]} x {self.shape[1]} of gain at most 1"


Element = RealElement | ComplexElement | DynamicElement


@dataclass(frozen=True)
class UncertainBlock:
    """An element and how often it occurs: the diagonal block of so many equal deltas.

    Attributes
    ----------
    element : RealElement, ComplexElement or DynamicElement
    copies : int
    """

    element: Element
    copies: int

    @property
    def rows(self) -> int:
        """Number of signals w that come out of it."""
        return self.copies * self.element.shape[0]

    @property
    def columns(self) -> int:
        """Number of signals z that go into it."""
        return self.copies * self.element.shape[1]


def checked_name(name: Any) -> str:
    """Return the name of an element if it is one."""
    if not isinstance(name, str) or not name.strip():
        raise invalid("name", name, "a name as text", 'Name it, such as "k".')
    return name


def real_element(
    name: str,
    nominal: float,
    *,
    percent: float | tuple[float, float] | None = None,
    plus_minus: float | tuple[float, float] | None = None,
    low_high: tuple[float, float] | None = None,
) -> RealElement:
    """Return a real element from any of the ways in which a range is told."""
    name, nominal = checked_name(name), real_number("nominal", nominal)
    given = {"percent": percent, "plus_minus": plus_minus, "range": low_high}
    told = [key for key, value in given.items() if value is not None]
    if len(told) != 1:
        shown = described(" and ".join(told) if told else "none of them")
        expected = "one of percent, plus_minus and range"
        raise invalid("range", shown, expected, "Say how far it may be off, once.")
    if low_high is not None:
        low, high = _pair("range", low_high)
    else:
        size = abs(nominal) / 100 if percent is not None else 1.0
        if size == 0:
            remedy = "Give plus_minus or range instead."
            raise invalid("percent", percent, "a nominal value other than 0", remedy)
        spread: Any = percent if percent is not None else plus_minus
        down, up = _pair(told[0], spread) if _is_pair(spread) else (-spread, spread)
        down, up = real_number(told[0], down), real_number(told[0], up)
        low, high = nominal + size * down, nominal + size * up
    if not low < nominal < high:
        shown = described(f"{low:.6g} to {high:.6g}")
        expected = f"a range around the nominal value {nominal:.6g}"
        raise invalid(told[0], shown, expected, "Put the smaller end first, and both apart of it.")
    return RealElement(name, nominal, low, high)


def _is_pair(value: Any) -> bool:
    return not isinstance(value, str) and hasattr(value, "__len__")


def _pair(argument: str, value: Any) -> tuple[float, float]:
    if not _is_pair(value) or len(value) != 2:
        raise invalid(argument, value, "two numbers, the smaller first", "Write (low, high).")
    return real_number(argument, value[0]), real_number(argument, value[1])


def real_number(argument: str, value: Any) -> float:
    """Return a finite real number."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise invalid(argument, value, "a real number", "Pass a number.") from None
    if isinstance(value, str | bool) or not math.isfinite(number):
        raise invalid(argument, value, "a finite real number", "Pass a number.")
    return number
