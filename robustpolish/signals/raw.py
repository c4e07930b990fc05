"""What a reader gets out of a file, before any check, and what the heads of columns say."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from robustpolish.base.arrays import Array, Vector
from robustpolish.base.checks import invalid, misfit
from robustpolish.base.input_files import FileSpec
from robustpolish.base.results import tables
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


# Quality of a record: missing values, clipping and the sampling rate.


# Missing values: short gaps filled, with a note, and long ones refused.

LONGEST_GAP = 5
"""Missing samples that may be filled in one after the other: a curve through the samples around
them is then a guess within the shape of the signal, and beyond that an invention."""

MISSING = 0.02
"""Share of a channel that may be filled in."""


def marked_runs(marked: np.ndarray) -> list[tuple[int, int]]:
    """Return first and last number of each run of marked samples.

    Examples
    --------
    >>> marked_runs(np.array([True, False, True, True]))
    [(0, 0), (2, 3)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marked, [False]]).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def ends_without_values(channels: Sequence[Vector]) -> tuple[int, int]:
    """Return how many samples at the beginning and the end lack a value in any channel.

    Only a few at either end are counted; what is longer is a gap like any other.
    """
    first = last = 0
    for values in channels:
        there = np.flatnonzero(~np.isnan(values))
        if there.size:
            first = max(first, int(there[0]) if there[0] <= LONGEST_GAP else 0)
            behind = values.size - 1 - int(there[-1])
            last = max(last, behind if behind <= LONGEST_GAP else 0)
    return first, last


def fill_gaps(
    name: str, values: Vector, time: Vector, lines: np.ndarray | None = None
) -> tuple[Vector, str]:
    """Fill short gaps of a channel by cubic interpolation over time.

    Parameters
    ----------
    name : str
    values : ndarray, shape (samples,)
        NaN where a value is missing.
    time : ndarray, shape (samples,)
        In s.
    lines : ndarray of int, optional
        Line of the file by sample.

    Returns
    -------
    values : ndarray
    note : str
        What was filled in, or "".

    Raises
    ------
    InvalidInputError
        If a gap is too long, or too much is missing.

    Examples
    --------
    >>> values, note = fill_gaps("x", np.array([0, 1, np.nan, 3, 4.0]), np.arange(5.0))
    >>> note
    'x: 1 missing value filled in by cubic interpolation (at sample 2)'
    """
    missing = np.isnan(values)
    if not missing.any():
        return values, ""
    gaps, count = marked_runs(missing), int(missing.sum())
    first, last = max(gaps, key=lambda gap: gap[1] - gap[0])
    what = f"{count} missing value{'s' if count > 1 else ''}"
    if last - first >= LONGEST_GAP or count > max(MISSING * values.size, 1):
        shown = (
            f"{what}, the longest gap of {last - first + 1} at {_places([(first, last)], lines)} "
            f"({time[first]:.6g} to {time[last]:.6g} s)"
        )
        want = f"gaps of at most {LONGEST_GAP} samples, {100 * MISSING:.0f} % of the record in all"
        remedy = "Read what lies before or behind with between=(START, END), or leave "
        raise misfit(name, shown, want, f"{remedy}{name!r} out with columns=.")
    there = ~missing
    degree = min(3, int(there.sum()) - 1)
    filled = values.copy()
    filled[missing] = make_interp_spline(time[there], values[there], k=degree)(time[missing])
    return filled, f"{name}: {what} filled in by cubic interpolation (at {_places(gaps, lines)})"


def _places(gaps: Sequence[tuple[int, int]], lines: np.ndarray | None) -> str:
    """Say where gaps are, in lines of the file if they are known."""
    word = "sample" if lines is None else "line"
    number = (lambda i: i) if lines is None else (lambda i: int(lines[i]))
    shown = [f"{number(a)}" if a == b else f"{number(a)} to {number(b)}" for a, b in gaps[:3]]
    more = f" and {len(gaps) - 3} more" if len(gaps) > 3 else ""
    several = "s" if len(gaps) > 1 or gaps[0][0] != gaps[0][1] else ""
    return f"{word}{several} {', '.join(shown)}{more}"


def numeric(name: str, values: Any) -> Vector:
    """Return a channel as floats, or refuse text, complex numbers and what is no number."""
    array = np.asarray(values)
    if array.dtype.kind == "c":
        raise misfit(name, "complex numbers", "a real signal", "Take one part of it.")
    try:
        return array.astype(float)
    except (TypeError, ValueError):
        for i, item in enumerate(array.reshape(-1)):
            try:
                float(item)
            except (TypeError, ValueError):
                shown = f"{str(item)!r} at sample {i}"
                raise misfit(name, shown, "numbers", "Remove the text.") from None
        raise misfit(name, "no numbers", "numbers", "Check the column.") from None


def check_finite(name: str, values: Vector, time: Vector | None = None) -> None:
    """Refuse a channel with NaN or infinity, naming the first."""
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        i = int(bad[0])
        when = "" if time is None or not np.isfinite(time[i]) else f" ({time[i]:.6g} s)"
        more = f" and {bad.size - 1} more" if bad.size > 1 else ""
        remedy = "Cut the record there, or leave the samples out: short gaps are filled."
        raise misfit(name, f"{values[i]} at sample {i}{when}{more}", "finite numbers", remedy)


def check_not_clipped(name: str, values: Vector) -> None:
    """Refuse a channel that was cut off at the end of its range.

    A clipped signal runs into its largest or smallest value at full speed and stays there. That
    leaves alone what rests at its extremes by nature: square waves (few values), ramps with holds
    (few slopes), smooth holds (the signal slows down first), the flat tops of a coarse converter
    (likewise), and pulses that rest at zero.
    """
    if plateaus := clipped_plateaus(values):
        share = sum(plateaus) / values.size
        shown = f"{len(plateaus)} plateaus at the ends of its range, {share:.1%} of it"
        remedy = "Record again with a lower amplitude or a wider range of the sensor, or, if it is "
        remedy += f"a command, pass at_limit=[{name!r}]; inputs of a model may stay at a limit."
        raise misfit(name, shown, "a signal that is not clipped", remedy)


def clipped_plateaus(values: Vector) -> list[int]:
    """Return the lengths of the plateaus that a cut left at the ends of a channel's range.

    Empty if there is but one short plateau, which may be chance.
    """
    plateaus = [length for sign in (1, -1) for length in _plateaus(sign * values)]
    return plateaus if len(plateaus) >= 2 or sum(plateaus) >= 8 else []


def share_at_limit(values: Vector) -> float:
    """Return the share of samples at the ends of a channel's range, 0 if no end is a limit."""
    if not clipped_plateaus(values):
        return 0.0
    low, high = values.min(), values.max()
    return float(np.mean(np.minimum(values - low, high - values) <= 1e-9 * (high - low)))


def _plateaus(values: Vector) -> list[int]:
    """Lengths of the plateaus at the maximum that were run into, or left, at full speed."""
    top = values.max()
    span = top - values.min()
    distinct = np.unique(values)
    if top == 0 or distinct.size < 30:
        return []
    quantum = float(np.min(np.diff(distinct)))
    at_top = values >= top - 1e-9 * span
    found = [
        last + 1 - first
        for first, last in marked_runs(at_top)
        if last - first >= 2
        and all(
            _at_full_speed(top - beside, last + 1 - first, quantum)
            for beside in (values[:first][::-1], values[last + 1 :])
            if beside.size >= 8
        )
    ]
    return [] if not found or _has_few_slopes(values, quantum) else found


def _at_full_speed(below: Vector, length: int, quantum: float) -> bool:
    """Whether a signal near its maximum, seen from there, does not slow down towards it.

    `below` is the distance to the maximum at the samples next to a plateau, the nearest first.
    Towards a smooth hold it shrinks with the square of time, so that the last stretch is a third
    of the one before; towards a cut it is at least half of it. A signal that could not have risen
    by some converter steps during the plateau, `length` samples, says nothing.
    """
    reached = np.flatnonzero(below >= 4 * quantum)
    stretch = max(2, int(reached[0]) + 1) if reached.size else below.size
    if 2 * stretch > below.size:
        return False
    near, both = below[stretch - 1], below[2 * stretch - 1]
    risen = near / stretch * length / 2
    return bool(near > 0.42 * (both - near) > 0 and risen > 6 * quantum)


def _has_few_slopes(values: Vector, quantum: float) -> bool:
    """Whether a signal is made of straight lines of at most three slopes."""
    stretch = min(16, values.size // 4)
    rise = values[stretch:] - values[:-stretch]
    inside = (values > values.min()) & (values < values.max())
    rise = rise[inside[stretch:] & inside[:-stretch]]
    if not rise.size:
        return True
    width = max(2 * quantum, 1e-6 * float(np.ptp(values)))
    _, counts = np.unique(np.rint(rise / width), return_counts=True)
    return float(np.sort(counts)[-3:].sum()) > 0.7 * rise.size


# How a record is sampled, and whether that is fast enough for a model.


def sampling_time(data: xr.Dataset) -> float:
    """Return the sampling time in s of a dataset over a uniform ``time``.

    Parameters
    ----------
    data : xarray.Dataset

    Returns
    -------
    float

    Examples
    --------
    >>> import xarray as xr
    >>> sampling_time(xr.Dataset(coords={"time": [0.0, 0.5, 1.0]}))
    0.5
    """
    values: Array = data["time"].values
    return float((values[-1] - values[0]) / (values.size - 1))


def check_sampling(data: xr.Dataset, frequencies: Sequence[float]) -> None:
    """Refuse a record that cannot show a model's modes.

    Parameters
    ----------
    data : xarray.Dataset
        Over ``time``.
    frequencies : sequence of float
        Natural frequencies in Hz that the outputs show.

    Raises
    ------
    InvalidInputError
        If half the sampling rate, the Nyquist frequency, is below the highest of them.

    Examples
    --------
    >>> import xarray as xr
    >>> check_sampling(xr.Dataset(coords={"time": [0.0, 0.01, 0.02]}), [12.0])
    """
    rate = 1 / sampling_time(data)
    highest = float(np.max(frequencies, initial=0.0))
    if highest >= rate / 2:
        want = f"more than {2 * highest:.6g} Hz, for the model's mode at {highest:.6g} Hz"
        remedy = "Sample faster, or leave the mode out of the model."
        raise misfit("sampling rate", f"{rate:.6g} Hz", want, remedy)
