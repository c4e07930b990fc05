"""What the head of a column says: its name and its unit."""

from __future__ import annotations

import re

_TIME_UNITS = r"(?:[nuµμm]?s|[mu]?secs?|seconds?|sekunden|milliseconds?|min|minutes?|h|hours?)"
_PREFIXED = r"[fpnuµμmcdkMG]?(?:m|g|s|N|Nm|Nmm|Ns|V|A|W|Pa|Hz|rad|J|bar|strain|eps)"
_ALONE = r"(?:sec|deg|degrees?|°|rpm|%|°C|degC|K|[uµμ]e|[uµμ]ε|microstrain|lbf|ft|kgf|rev)"
_ATOM = rf"(?:{_PREFIXED}|{_ALONE})(?:(?:\^|\*\*)?-?[1-4]|²|³)?"
_UNIT = re.compile(rf"{_ATOM}(?:\s*[*·⋅./ ]\s*\(?{_ATOM}\)?)*")
_TIME_UNIT = re.compile(_TIME_UNITS, re.IGNORECASE)

_BRACKETS = re.compile(r"^(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]\s*$")
_PARENTHESES = re.compile(r"^(?P<name>.*?\S)\s*\((?P<unit>[^\[\]]*)\)\s*$")
_FRACTION = re.compile(r"^(?P<name>[^/\[\]]*?\w)\s*/\s*(?P<unit>[^\[\]]+?)\s*$")
_LINE = re.compile(r"^\s*[(\[](?P<unit>.*)[)\]]\s*$")

# Time in the languages and programs that label it otherwise; the likeliest first.
TIME_NAMES = (
    "time", "t", "zeit", "temps", "tiempo", "tempo", "tijd", "timestamp", "time stamp",
    "zeitstempel", "datetime", "date time", "date/time", "datum/zeit", "datum zeit", "elapsed time",
    "time elapsed", "rel time", "abs time", "messzeit", "x value", "uhrzeit", "clock", "elapsed",
)  # fmt: skip
_COUNTS = (
    "", "index", "idx", "nr", "no", "n", "num", "number", "#", "sample", "samples", "sample no",
    "row", "count", "point", "record", "scan", "unnamed: 0", "lfd nr", "i",
)  # fmt: skip


def split_header(header: str, fraction: bool = False) -> tuple[str, str]:
    """Split a header into name and unit; the unit is empty if there is none.

    Parameters
    ----------
    header : str
        Brackets at the end hold a unit, whatever it is; parentheses only what is known as one,
        so that ``"x (left)"`` stays a name.
    fraction : bool, optional
        Whether the unit may follow a stroke, as in ``"t/ms"``; in files where it separates a
        group from what it holds it may not.

    Returns
    -------
    (str, str)

    Examples
    --------
    >>> split_header("x_m [um]"), split_header("force"), split_header("Time (s)")
    (('x_m', 'um'), ('force', ''), ('Time', 's'))
    >>> split_header("a/(m/s^2)", fraction=True), split_header("run/a")
    (('a', 'm/s^2'), ('run/a', ''))
    """
    text = str(header).strip().strip("#").strip()
    found = _BRACKETS.match(text)
    if found and found["name"]:
        return found["name"].strip(), found["unit"].strip()
    for pattern in (_FRACTION, _PARENTHESES) if fraction else (_PARENTHESES,):
        found = pattern.match(text)
        if found:
            name, unit = found["name"].strip(), _bare(found["unit"])
            if _UNIT.fullmatch(unit) or (is_time(name) and _TIME_UNIT.fullmatch(unit)):
                return name, unit
    found = re.fullmatch(rf"(?P<name>.*?)[ _](?P<unit>{_TIME_UNITS})", text)
    if found and is_time(found["name"]):
        return text, found["unit"]
    return text, ""


def line_of_units(cells: list[str]) -> list[str] | None:
    """Return the units that a line below the header gives, or None if it is no such line.

    Examples
    --------
    >>> line_of_units(["(ms)", "[kN]", "mm"]), line_of_units(["left", "mm", "kN"])
    (['ms', 'kN', 'mm'], None)
    """
    units, named = [], 0
    for cell in cells:
        found = _LINE.match(cell)
        unit = (found["unit"] if found else cell).strip()
        # An empty cell, or a stroke, stands for a column without a unit.
        if unit and not _UNIT.fullmatch(unit) and not _TIME_UNIT.fullmatch(unit) and unit != "-":
            return None
        units.append("" if unit == "-" else unit)
        named += bool(units[-1])
    return units if named else None


def is_time(name: str) -> bool:
    """Return whether a column of this name is the time.

    Examples
    --------
    >>> is_time("Zeit"), is_time("run/time"), is_time("time_ms"), is_time("x")
    (True, True, True, False)
    """
    return rank_as_time(name) is not None


def rank_as_time(name: str) -> int | None:
    """Return how far behind the likeliest name of the time this one is; None if it is none."""
    words = re.sub(r"[\s_\-]+", " ", name.strip().casefold())
    for text in (words, re.sub(rf" {_TIME_UNITS}$", "", words), words.rpartition("/")[2]):
        if text in TIME_NAMES:
            return TIME_NAMES.index(text)
    return None


def is_count(name: str) -> bool:
    """Return whether a column of this name may number the rows.

    Examples
    --------
    >>> is_count("Index"), is_count("Nr."), is_count("x")
    (True, True, False)
    """
    return re.sub(r"[\s_\-.]+", " ", name.casefold()).strip() in _COUNTS


def _bare(unit: str) -> str:
    """Return a unit without the parentheses around all of it."""
    unit = unit.strip()
    if unit.startswith("(") and unit.endswith(")") and ")" not in unit[1:-1]:
        return unit[1:-1].strip()
    return unit
