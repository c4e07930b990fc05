"""Units at the edge: what a file says, turned into SI."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robustpolish.validation import invalid

# The SI units that signals are kept in. Anything else keeps its base units.
_PREFERRED = (
    "m", "m/s", "m/s^2", "m/s^3", "rad", "rad/s", "rad/s^2", "s", "Hz", "N", "N m", "kg", "kg m^2",
    "N/m", "N s/m", "Pa", "V", "A", "W", "K", "N/V", "m/V", "m/N", "m/s/N", "m/s^2/N",
    "rad/(N m)", "rad/s/(N m)", "rad/s^2/(N m)",
)  # fmt: skip

# What engineers write and pint reads otherwise: Nm as nanometre's cousin, g as a gram.
_SPELLINGS = (
    (r"²", "^2"),
    (r"³", "^3"),
    (r"[·⋅×]", "*"),
    (r"(?<![A-Za-z])([kmMG]?)Nm(?![A-Za-z])", r"\1N*m"),
    (r"(?<![A-Za-z])([kmMG]?)Nmm(?![A-Za-z])", r"\1N*mm"),
    (r"(?<![A-Za-z])([kmMG]?)Ns(?![A-Za-z])", r"\1N*s"),
    (r"(?<![A-Za-z_])g(?![A-Za-z_])", "standard_gravity"),
    (r"(?<![A-Za-z_])(?:mg|milli-g)(?![A-Za-z_])", "(0.001*standard_gravity)"),
    (r"(?<![A-Za-z_])(?:[uµμ]g)(?![A-Za-z_])", "(1e-6*standard_gravity)"),
    (r"(?<![A-Za-z])(?:[uµμ](?:strain|e|ε|eps))(?![A-Za-z])", "microstrain"),
    (r"([A-Za-z])(\d)", r"\1^\2"),
)


def to_si(
    values: NDArray[np.float64], unit: str, argument: str = "unit"
) -> tuple[NDArray[np.float64], str]:
    """Convert values to SI.

    Parameters
    ----------
    values : ndarray
        In `unit`.
    unit : str
        As written in the file, such as ``"mm"``, ``"kN"``, ``"deg"`` or ``"m/s^2"``; ``g`` is
        the acceleration. A factor may precede it: ``"2.5 mm"`` for a sensor that gives 2.5 mm
        for each unit of its column. An empty text means that the unit is not known.
    argument : str, optional
        What the message calls the unit.

    Returns
    -------
    values : ndarray
        In the SI unit.
    unit : str
        The SI unit; "" where it is not known, "1" for a ratio.

    Raises
    ------
    InvalidInputError
        If the unit is unknown.

    Examples
    --------
    >>> import numpy as np
    >>> to_si(np.array([1.0, 2.0]), "kN")
    (array([1000., 2000.]), 'N')
    """
    if not unit.strip():
        return values, ""
    factor, offset, name = _conversion(unit.strip(), argument)
    return values * factor + offset, name


def same_kind(first: str, second: str) -> bool:
    """Return whether two SI units measure the same kind of thing; an unknown unit fits all.

    An angle is a ratio too, but no number of turns is a strain: rad fits rad only.

    Parameters
    ----------
    first, second : str

    Returns
    -------
    bool

    Examples
    --------
    >>> same_kind("m", "rad"), same_kind("N", ""), same_kind("mm", "m")
    (False, True, True)
    """
    if not first.strip() or not second.strip():
        return True
    return _conversion(first, "unit")[2] == _conversion(second, "unit")[2]


@lru_cache(maxsize=256)
def _conversion(unit: str, argument: str) -> tuple[float, float, str]:
    """Return factor and offset to SI, and the name of the SI unit."""
    try:
        one, zero = (_quantity(unit, value) for value in (1.0, 0.0))
    except Exception:  # pint raises its own, and those of the tokenizer, for odd text
        raise invalid(
            argument,
            unit,
            "a unit that pint knows, such as mm, um, kN, g or deg",
            "Correct it in the file's header, or pass units={column: unit}.",
        ) from None
    name = _names().get(str(one.units))
    factor = one.magnitude - zero.magnitude
    if not np.isfinite(factor) or factor == 0:
        raise invalid(argument, unit, "a unit other than zero", "Correct it.")
    if name is None:
        name = "1" if one.dimensionless else f"{one.units:~C}".replace("**", "^")
    return float(factor), float(zero.magnitude), name


def _quantity(unit: str, value: float) -> Any:
    found = re.match(r"^([+-]?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?)\s*\*?\s*(.*)$", unit)
    scale, symbol = (float(found[1]), found[2] or "1") if found else (1.0, unit)
    for pattern, replacement in _SPELLINGS:
        symbol = re.sub(pattern, replacement, symbol)
    registry = _registry()
    if symbol in ("1", "-"):
        return registry.Quantity(value * scale, "dimensionless")
    one = registry.parse_expression(symbol.replace("^", "**"))
    if isinstance(one, int | float):  # such as "%" turned into a number
        return registry.Quantity(value * scale * one, "dimensionless")
    if one.magnitude == 1:  # the way that temperatures with an offset need
        return registry.Quantity(value * scale, one.units).to_base_units()
    return (value * scale * one).to_base_units()


@lru_cache(maxsize=1)
def _registry() -> Any:
    import pint  # late: reading its unit file takes half a second

    registry = pint.UnitRegistry()
    registry.define("strain = [] = strain")
    return registry


@lru_cache(maxsize=1)
def _names() -> dict[str, str]:
    """Preferred name of each set of base units."""
    registry = _registry()
    names: dict[str, str] = {}
    for name in _PREFERRED:
        units = registry.parse_expression(name.replace("^", "**")).to_base_units().units
        names.setdefault(str(units), name)
    return names
