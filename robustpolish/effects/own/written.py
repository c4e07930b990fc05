"""What somebody wrote of an effect: the formula, units, and what else was said."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from robustpolish.effects.own.formula import Formula
from robustpolish.effects.own.reading import read_formula
from robustpolish.validation import Key, described, invalid, one_of

OWN_KEYS = ("formula", "units", "name", "title", "domain", "bounds", "scan", "known", "channels")
DOMAINS = ("pair", "dof")
_LONGEST = 60  # characters of a name: it stands in tables
_MOST = 10  # parameters


@dataclass(frozen=True)
class Written:
    """An effect as it was written; all else follows from it.

    Parameters
    ----------
    formula : str
    units : tuple of (str, str)
        Parameters and their units, in the order of the law.
    name, title : str, optional
        The formula by default.
    domain : {"pair", "dof"}, optional
    bounds : tuple of (str, float, float), optional
        Parameters with their least and largest value.
    scan : tuple of (str, tuple of float), optional
        Parameters with the values that a screening tries.
    known : tuple of (str, float), optional
        Parameters whose value is known and not fitted.
    channels : tuple of (str, str), optional
        Data columns that the formula names, and their units.
    """

    formula: str
    units: tuple[tuple[str, str], ...] = ()
    name: str = ""
    title: str = ""
    domain: str = "pair"
    bounds: tuple[tuple[str, float, float], ...] = ()
    scan: tuple[tuple[str, tuple[float, ...]], ...] = ()
    known: tuple[tuple[str, float], ...] = ()
    channels: tuple[tuple[str, str], ...] = ()

    def read(self) -> Formula:
        """Return the formula, read.

        Returns
        -------
        Formula
        """
        return read_formula(self.formula, (*dict(self.units), *dict(self.channels)))

    def table(self) -> dict[str, Any]:
        """Return what stands in a file.

        Returns
        -------
        dict
        """
        whole: dict[str, Any] = {
            "formula": self.formula,
            "units": dict(self.units),
            "name": self.name,
            "title": self.title,
            "domain": self.domain,
            "bounds": {name: [lower, upper] for name, lower, upper in self.bounds},
            "scan": {name: list(values) for name, values in self.scan},
            "known": dict(self.known),
            "channels": dict(self.channels),
        }
        default = Written("").domain
        return {k: v for k, v in whole.items() if v and (k, v) != ("domain", default)}


def written_from(table: Mapping[str, Any]) -> Written:
    """Check a table of a file or the arguments of a call.

    Parameters
    ----------
    table : mapping
        Some of `OWN_KEYS`, "formula" at least.

    Returns
    -------
    Written

    Raises
    ------
    InvalidInputError
        If something is of the wrong sort; the key says what.

    Examples
    --------
    >>> written = written_from({"formula": "f = -k*q**5", "units": {"k": "N/m^5"}})
    >>> written.table()
    {'formula': 'f = -k*q**5', 'units': {'k': 'N/m^5'}}
    """
    units = _table("units", table.get("units"))
    channels = _table("channels", table.get("channels"))
    formula = read_formula(table.get("formula"), (*units, *channels))  # type: ignore[arg-type]
    if len(units) > _MOST:
        shown = described(f"{len(units)} parameters")
        raise invalid(("units",), shown, f"at most {_MOST}", "No record determines so many.")
    for name in channels:
        if name in units:
            raise invalid(("channels", name), name, "a name that no parameter has", "Rename one.")
    bounds = {n: _bounds(n, v) for n, v in _of_parameters("bounds", table, units).items()}
    scan = {n: _values(n, v) for n, v in _of_parameters("scan", table, units).items()}
    known = {n: _number(("known", n), v) for n, v in _of_parameters("known", table, units).items()}
    for name in known:
        if name in scan:
            raise invalid(("known", name), name, "no values to scan", "It is known or scanned.")
    return Written(
        formula.text,
        tuple(units.items()),
        _text("name", table.get("name")),
        _text("title", table.get("title")),
        one_of(("domain",), table.get("domain") or "pair", DOMAINS),
        tuple((name, lower, upper) for name, (lower, upper) in bounds.items()),
        tuple(scan.items()),
        tuple(known.items()),
        tuple(channels.items()),
    )


def _table(key: str, value: Any) -> dict[str, Any]:
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise invalid((key,), value, "a table by name", "Write one, such as {'k': 'N/m'}.")
    return dict(value)


def _of_parameters(key: str, table: Mapping[str, Any], units: Mapping[str, Any]) -> dict[str, Any]:
    """Return a table whose names have to be parameters."""
    found = _table(key, table.get(key))
    for name in found:
        if name not in units:
            listed = ", ".join(units) or "the parameters, of which there are none"
            raise invalid((key, str(name)), name, f"one of {listed}", "Check the spelling.")
    return found


def _text(key: str, value: Any) -> str:
    if value is None:
        return ""
    if not isinstance(value, str) or not value.strip() or len(value) > _LONGEST:
        raise invalid((key,), value, f"text of at most {_LONGEST} characters", "Shorten it.")
    return " ".join(value.split())


def _bounds(name: str, value: Any) -> tuple[float, float]:
    key: Key = ("bounds", name)
    pair = list(value) if isinstance(value, list | tuple) else []
    ends = [
        _number(key, end if end is not None else limit, infinite=True)
        for end, limit in zip(pair, (-math.inf, math.inf), strict=False)
    ]
    if len(pair) != 2 or not ends[0] < ends[1]:
        remedy = "Write None, or inf in a file, where there is no limit."
        raise invalid(key, value, "the least and the largest value", remedy)
    return ends[0], ends[1]


def _values(name: str, value: Any) -> tuple[float, ...]:
    key: Key = ("scan", name)
    if not isinstance(value, list | tuple) or not 1 <= len(value) <= 50:
        raise invalid(key, value, "one to 50 values", "Write a list in SI units.")
    return tuple(_number(key, item) for item in value)


def _number(key: Key, value: Any, infinite: bool = False) -> float:
    if infinite and value in ("inf", "-inf"):  # as JSON has them
        value = float(value)
    real = isinstance(value, int | float) and not isinstance(value, bool)
    try:
        number = float(value) if real else math.nan
    except OverflowError:
        number = math.nan
    if math.isnan(number) or (math.isinf(number) and not infinite):
        raise invalid(key, value, "a finite number", "Check the value.")
    return number
