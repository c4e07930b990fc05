"""What a reader gets out of a file, before any check, and what the heads of columns say."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from robustpolish.base.checks import invalid, misfit
from robustpolish.base.input_files import FileSpec
from robustpolish.base.texts import tables
from robustpolish.errors import InvalidInputError

_TIME_UNITS = r"(?:[nuµμm]?s|[mu]?secs?|seconds?|sekunden|milliseconds?|min|minutes?|h|hours?)"
_PREFIXED = r"[fpnuµμmcdkMG]?(?:m|g|s|N|Nm|Nmm|Ns|V|A|W|Pa|Hz|rad|J|bar|strain|eps)"
_ALONE = r"(?:sec|deg|degrees?|°|rpm|%|°C|degC|K|[uµμ]e|[uµμ]ε|microstrain|lbf|ft|kgf|rev)"
_ATOM = rf"(?:{_PREFIXED}|{_ALONE})(?:(?:\^|\*\*)?-?[1-4]|²|³)?"
_UNIT = re.compile(rf"{_ATOM}(?:\s*[*·⋅./ ]\s*\(?{_ATOM}\)?)*")
TIME_UNIT = re.compile(_TIME_UNITS, re.IGNORECASE)

_BRACKETS = re.compile(r"^(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]\s*$")
_PARENTHESES = re.compile(r"^(?P<name>.*?\S)\s*\((?P<unit>[^\[\]]*)\)\s*$")
_FRACTION = re.compile(r"^(?P<name>[^/\[\]]*?\w)\s*/\s*(?P<unit>[^\[\]]+?)\s*$")
_LINE = re.compile(r"^\s*[(\[](?P<unit>.*)[)\]]\s*$")

_WORDS = tables(__file__)


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
            if _UNIT.fullmatch(unit) or (is_time(name) and TIME_UNIT.fullmatch(unit)):
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
    found = [_LINE.match(cell) for cell in cells]
    units = [(f["unit"] if f else c).strip() for f, c in zip(found, cells, strict=True)]
    # An empty cell, or a stroke, stands for a column without a unit.
    units = ["" if unit == "-" else unit for unit in units]
    known = all(not u or _UNIT.fullmatch(u) or TIME_UNIT.fullmatch(u) for u in units)
    return units if known and any(units) else None


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
        if text in _WORDS["time"]:
            return _WORDS["time"].index(text)
    return None


def is_count(name: str) -> bool:
    """Return whether a column of this name may number the rows.

    Examples
    --------
    >>> is_count("Index"), is_count("Nr."), is_count("x")
    (True, True, False)
    """
    return re.sub(r"[\s_\-.]+", " ", name.casefold()).strip() in _WORDS["counts"]


def _bare(unit: str) -> str:
    """Return a unit without the parentheses around all of it."""
    unit = unit.strip()
    if unit.startswith("(") and unit.endswith(")") and ")" not in unit[1:-1]:
        return unit[1:-1].strip()
    return unit


# Units at the edge: what a file says, turned into SI.


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
        want = "a unit that pint knows, such as mm, um, kN, g or deg"
        remedy = "Correct it in the file's header, or pass units={column: unit}."
        raise invalid(argument, unit, want, remedy) from None
    factor = one.magnitude - zero.magnitude
    if not np.isfinite(factor) or factor == 0:
        raise invalid(argument, unit, "a unit other than zero", "Correct it.")
    base = "1" if one.dimensionless else f"{one.units:~C}".replace("**", "^")
    return float(factor), float(zero.magnitude), _names().get(str(one.units), base)


def _quantity(unit: str, value: float) -> Any:
    found = re.match(r"^([+-]?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?)\s*\*?\s*(.*)$", unit)
    scale, symbol = (float(found[1]), found[2] or "1") if found else (1.0, unit)
    for pattern, replacement in _WORDS["spellings"]:
        symbol = re.sub(pattern, replacement, symbol)
    registry = _registry()
    if symbol in ("1", "-"):
        return registry.Quantity(value * scale, "dimensionless")
    symbol = symbol.replace("^", "**")
    try:
        one = registry.parse_expression(symbol)
    except Exception:  # "Newtons", "Volts"; pint raises errors of its own and of the tokenizer
        one = registry.parse_expression(symbol.lower())
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
    parsed = _registry().parse_expression
    return {
        str(parsed(name.replace("^", "**")).to_base_units().units): name
        for name in reversed(_WORDS["preferred"])
    }


RECORD = FileSpec("measurement", "a file", "Check the path.", 1_000_000_000)
"""What a file with a record is, unpacked no larger than a gigabyte."""


# What a reader gets out of a file of signals, before any check.

_SAME_SAMPLE = 0.05  # of a step, what stamps of clocks are rounded to


@dataclass
class RawTable:
    """Columns of a file with their units as written.

    Attributes
    ----------
    columns : dict of str to array
        Values by name, of any length.
    units : dict of str to str
        Unit by name where the file gives one.
    sampling_rate : float or None
        In Hz, where the file gives one.
    start : float
        Time of the first sample in s, for files without a column of times.
    notes : list of str
        What was done or left out on the way.
    lines : ndarray of int or None
        Line of the file by sample, where there are lines.
    headers : dict of str to str
        Name by header as it stands in the file.
    clock : str or None
        The column that holds the time, once it is known.
    """

    columns: dict[str, Any] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    sampling_rate: float | None = None
    start: float = 0.0
    notes: list[str] = field(default_factory=list)
    lines: np.ndarray | None = None
    headers: dict[str, str] = field(default_factory=dict)
    clock: str | None = None

    def add(
        self, header: str, values: Any, unit: str | None = None, fraction: bool = False
    ) -> None:
        """Add a column; its header may hold the unit, as in ``x [mm]`` or, if `fraction`, x/mm."""
        name, written = split_header(header, fraction)
        if name in self.columns:
            raise invalid("column", name, "a name used once", "Rename one of the columns.")
        self.columns[name] = values
        self.headers[str(header).strip()] = name
        if unit or written:
            self.units[name] = unit or written

    def start_together(self, starts: Mapping[str, float], step: float) -> None:
        """Cut columns that start at different times, in s, to what all of them cover.

        Raises
        ------
        InvalidInputError
            If they do not start a whole number of steps apart.
        """
        self.start = max(starts.values())
        for name, start in starts.items():
            late = (self.start - start) / step
            if abs(late - round(late)) > _SAME_SAMPLE or round(late) >= np.size(self.columns[name]):
                shown = f"{name}, which starts {self.start - start:.6g} s before another channel"
                want = f"one start, or starts whole steps of {step:.6g} s apart within the record"
                raise misfit("measurement", shown, want, "Resample, or pass table= or columns=.")
            self.columns[name] = self.columns[name][round(late) :]
        if spread := self.start - min(starts.values()):
            length = min(np.size(self.columns[name]) for name in starts)
            self.columns |= {name: self.columns[name][:length] for name in starts}
            self.notes.append(f"channels start up to {spread:.6g} s apart: cut to what all cover")

    def resolve(self, argument: str, name: str) -> str:
        """Return the column that is meant: by name, by header, or by the end of a path in groups.

        Raises
        ------
        InvalidInputError
            If there is none, or several groups have one.
        """
        if name in self.columns:
            return name
        if self.headers.get(name) in self.columns:
            return self.headers[name]
        ends = [column for column in self.columns if column.endswith(f"/{name}")]
        if len(ends) == 1:
            return ends[0]
        shown = f"no channel {name!r}" if not ends else f"{name!r} in several groups"
        expected = f"the channels that are there: {', '.join(ends or self.columns) or 'none'}"
        raise misfit(argument, shown, expected, "Check the header, or rename with rename=.")

    def holds(self, name: str) -> bool:
        """Return whether one column or several may be meant by a name."""
        meant = {name, self.headers.get(name)}
        return any(c in meant or c.endswith(f"/{name}") for c in self.columns)

    def rename(self, names: Mapping[str, str]) -> None:
        """Call columns otherwise.

        Raises
        ------
        InvalidInputError
            If a column is not there, or two would have one name.
        """
        found: dict[str, str] = {}
        for old, new in names.items():
            if not isinstance(new, str) or not new:
                raise invalid(f"rename[{old!r}]", new, "a name", "Quote it.")
            found[self.resolve("rename", old)] = new
            self.headers[old] = new
        renamed = [found.get(name, name) for name in self.columns]
        for name in renamed:
            if renamed.count(name) > 1:
                expected = f"a name that no other column has: {self.listed()}"
                raise invalid("rename", name, expected, "Rename that column too.")
        self.columns = dict(zip(renamed, self.columns.values(), strict=True))
        self.units = {found.get(name, name): unit for name, unit in self.units.items()}

    def listed(self) -> str:
        """Say what there is, each column with its number of samples."""
        return ", ".join(f"{name} ({np.size(values)})" for name, values in self.columns.items())

    def place(self, sample: int) -> str:
        """Say where a sample is: in which line, if there are any."""
        return f"sample {sample}" if self.lines is None else f"line {self.lines[sample]}"


@contextmanager
def library_errors(source: object, kind: str) -> Iterator[None]:
    """Turn whatever a file's library raises on damage into an error of the package."""
    try:
        yield
    except InvalidInputError:
        raise
    except Exception as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        shown, remedy = f"{source} ({reason})", "Check that the file is whole and its suffix right."
        raise misfit("measurement", shown, f"a readable {kind} file", remedy) from None


# What a reader gets out of a file of frequency responses, before any check.


@dataclass(frozen=True, eq=False)
class RawResponse:
    """One curve over frequency, as written.

    Attributes
    ----------
    output, input : str
        What was measured, and what drove the machine.
    frequency : ndarray, shape (lines,)
        In `frequency_unit`.
    values : ndarray, shape (lines,)
        Complex for a response, real for its coherence or variance.
    unit : str
        Of the response; empty if the file gives none.
    kind : {"response", "coherence", "variance"}
    frequency_unit : str
    """

    output: str
    input: str
    frequency: np.ndarray
    values: np.ndarray
    unit: str = ""
    kind: Literal["response", "coherence", "variance"] = "response"
    frequency_unit: str = "Hz"
