"""Tables in text: whatever stands above them, a header with names and units, then numbers."""

from __future__ import annotations

import contextlib
import csv
import operator
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from robustpolish.base.checks import invalid, misfit
from robustpolish.base.input_files import FileSpec, content, open_checked
from robustpolish.signals.raw import RECORD, RawTable, line_of_units, split_header
from robustpolish.signals.time_axis import is_clock_text

# Where the table of a text file begins, how its cells are separated, and what its columns are.

Line = tuple[int, str]
"""A line that is not blank, behind its number in the file."""

_LOOKED_AT = 3  # rows of numbers in a row make a table; a remark may hold one
_EMPTY = ("", "-", "--", "---", "na", "n/a", "#n/a", "nan", "null", "none")
_REMARK = ("#", "%", "//", "!")
_REMARKS = ("", "comment", "comments", "remark", "remarks")
_RATE = re.compile(
    r"(?:sampl\w*[ _-]?(?:rate|freq\w*)|scan[ _-]?rate|abtastrate|abtastfrequenz)\W+"
    r"(?P<number>\d[\d.,]*(?:[eE][+-]?\d+)?)[\s;,]*(?P<unit>[kM]?Hz|1/s|S/s|sps|$)",
    re.IGNORECASE,
)
_STEP = re.compile(
    r"^(?:delta_x|(?:sampl\w*|scan)[ _-]?(?:interval|time|period)|abtastzeit)\W+"
    r"(?P<number>\d[\d.,]*(?:[eE][+-]?\d+)?)[ ;,]*(?P<unit>[mu]?s|$|\t)",
    re.IGNORECASE,
)


_COUNT = re.compile(
    r"^(?:(?:number|no\.?|#) of )?(?:samples|points|data points|scans)\W+(?P<counts>\d[\d\t,; ]*)$",
    re.IGNORECASE,
)
_LABVIEW = ("y_unit_label", "x0", "delta_x")


@dataclass(frozen=True)
class Layout:
    """How a text file holds its table.

    Attributes
    ----------
    delimiter : str
        Between cells; a blank stands for any number of them.
    headers : tuple of str
        As written, one for each column; "" for one without a name.
    units : tuple of str
        From a line of their own below the headers; "" where there is none.
    begin : int
        Number of the first row among the lines that are not blank.
    sampling_rate : float or None
        In Hz, where the lines above the table name it.
    count : int or None
        Number of rows that the lines above the table name.
    channels : dict of str to list of str
        What the head of a LabVIEW file says of each channel.
    """

    delimiter: str
    headers: tuple[str, ...]
    units: tuple[str, ...]
    begin: int
    sampling_rate: float | None = None
    count: int | None = None
    channels: Mapping[str, list[str]] = field(default_factory=dict)


def find_layout(path: Path, lines: Sequence[Line]) -> Layout:
    """Find the table in a text file.

    Parameters
    ----------
    path : Path
        For the messages.
    lines : sequence of (int, str)
        Those that are not blank, with their numbers.

    Returns
    -------
    Layout

    Raises
    ------
    InvalidInputError
        If there are no rows of numbers, or no names above them.
    """
    row, delimiter = _first_row(path, lines)
    first = split(lines[row][1], delimiter)
    for top in range(row - 1, -1, -1):
        names = header_cells(lines[top][1], delimiter, first, next_to_it=top == row - 1)
        if names is None:
            continue
        units = line_of_units(names) if top else None
        above = None if units is None else header_cells(lines[top - 1][1], delimiter, first)
        if units is None or above is None:
            units, above = [""] * len(names), names
        # Rows with a mistake in them are rows all the same: the header says where they begin.
        below = (i for i in range(top + 1, row) if _starts_as_row(lines[i][1], delimiter))
        begin = next(below, row)
        head = lines[:top]
        counts = [m for _, line in head if (m := _COUNT.match(line.strip("# \t;,")))]
        count = int(re.findall(r"\d+", counts[-1]["counts"])[0]) if counts else None
        cells = [split(line, delimiter) for _, line in head if "_" in line or line[:2] == "X0"]
        channels = {row[0].casefold(): row[1:] for row in cells if row[0].casefold() in _LABVIEW}
        rate = _rate_above(head)
        return Layout(delimiter, tuple(above), tuple(units), begin, rate, count, channels)
    number, line = lines[row]
    shown = f"{path}, line {number}, with numbers only: {line[:30]}"
    want = f"a header above it with {len(first)} names, such as 'time [s],x [mm]'"
    remedy = "Add a line with the names and units of the columns."
    raise misfit("measurement", shown, want, remedy)


def split(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line, without the blanks around them."""
    if delimiter == " ":
        return line.split()
    cells = line.split(delimiter)
    if '"' in line:
        # a cell of more than 100 000 characters, for example, is none for the reader
        with contextlib.suppress(csv.Error):
            cells = next(csv.reader([line], delimiter=delimiter), [])
    return [cell.strip() for cell in cells]


def is_empty(cell: str) -> bool:
    """Return whether a cell stands for a missing value."""
    return cell.casefold() in _EMPTY


def as_number(cell: str) -> float | None:
    """Return the number in a cell, with a decimal point or comma; None if there is none."""
    for text in (cell, cell.replace(",", ".") if cell.count(",") == 1 else ""):
        with contextlib.suppress(ValueError):
            return float(text)
    return None


def header_cells(
    line: str, delimiter: str, row: Sequence[str], next_to_it: bool = False
) -> list[str] | None:
    """Return the names in a line if it can be the header of a row; None otherwise.

    It names every cell. Right above the row it may have one name less, if the row is numbered
    or ends with a delimiter, or one more, for remarks that are not there.
    """
    text = line.strip(" ")
    if text.startswith(_REMARK) and text.strip("#%!/ "):
        text = text.lstrip("#%!/ ")
    ways = [split(text, delimiter)]
    if delimiter == " ":  # names may hold single blanks
        ways.append([cell.strip() for cell in re.split(r"\t|\s{2,}", text)])
    for cells in ways:
        named = [cell for cell in cells if cell]
        numbers = sum(_is_value(cell) for cell in named)
        if not named or numbers > len(named) / 2 or (cells[0] and _is_value(cells[0])):
            continue
        if next_to_it and len(cells) == len(row) + 1 and cells[-1].casefold() in _REMARKS:
            cells = cells[:-1]
        elif next_to_it and len(cells) == len(row) - 1 > 0 and delimiter != " ":
            cells = ["", *cells] if row[-1] else [*cells, ""]
        if len(cells) == len(row):
            return cells
    return None


def _first_row(path: Path, lines: Sequence[Line]) -> tuple[int, str]:
    """Return where the rows begin, and their delimiter."""
    for i, (_, line) in enumerate(lines):
        delimiter = _row_delimiter(line)
        if delimiter is None:
            continue
        width = len(split(line, delimiter))
        below = lines[i + 1 : i + _LOOKED_AT]
        if all(_is_row(other, delimiter, width=width) for _, other in below):
            return i, delimiter
    shown, want = f"{path} with a header and no numbers", "numbers below the header"
    raise misfit("measurement", shown, want, "Export it again.")


def _row_delimiter(line: str) -> str | None:
    """Return what separates the cells of a row of numbers; None if it is no such row."""
    start = line.lstrip(" ")[:1]
    if not start or not (start.isdigit() or start in "+-.,;\t\"'nNiI"):
        return None
    there = [delimiter for delimiter in ";\t, " if delimiter in line.strip(" ")] or [","]
    for text in (False, True):  # a column of text beside the numbers is the second choice
        for delimiter in there:
            if _is_row(line, delimiter, text):
                return delimiter
    return None


def _is_row(line: str, delimiter: str, text: bool = True, width: int | None = None) -> bool:
    """Return whether a line holds numbers, dates and empty cells, and some text if it may."""
    cells = split(line, delimiter)
    if width is not None and len(cells) != width:
        return False
    values = [cell for cell in cells if not is_empty(cell)]
    numbers = sum(_is_value(cell) for cell in values)
    return numbers > 0 and (numbers == len(values) or (text and numbers >= 0.5 * len(values) > 1))


def _starts_as_row(line: str, delimiter: str) -> bool:
    cells = [cell for cell in split(line, delimiter) if cell]
    return bool(cells) and _is_value(cells[0])


def _is_value(cell: str) -> bool:
    return as_number(cell) is not None or is_clock_text(cell)


def _rate_above(preamble: Sequence[Line]) -> float | None:
    """Return the sampling rate in Hz that the lines above a table name, None if they do not."""
    for _, line in preamble:
        if len(line) > 200:
            continue
        rate = _RATE.search(line.strip("# \t;,"))
        found = rate or _STEP.match(line.strip("# ;,"))
        if found:
            number = as_number(found["number"].rstrip(".,")) or 0.0
            prefixes = {"k": 1e3, "m": 1e6} if rate else {"m": 1e-3, "u": 1e-6}
            size = prefixes.get(found["unit"][:1].casefold(), 1.0) * number
            return None if number <= 0 else size if rate else 1 / size
    return None


# Bytes that the head of a table is looked for in; data loggers write some thousand above it.
_BEGIN = 1 << 16


def read_csv(path: Path, wanted: FileSpec = RECORD) -> RawTable:
    """Read a text table.

    Columns are separated by comma, semicolon, tab or blanks (the rows decide); unless it is a
    comma, numbers may have a decimal comma. The header is the last line above the numbers that
    names all columns, with their units in it or in a line of their own below it; what stands above
    it is skipped, remarks and the heads of data loggers. Empty cells become NaN.
    """
    lines = _lines(content(path, wanted))
    if not lines:
        raise misfit("measurement", f"{path}, empty", "a table", "Export it again.")
    layout = find_layout(path, lines)
    rows = lines[layout.begin :]
    # Spreadsheets append rows of empty cells.
    while len(rows) > 1 and not any(split(rows[-1][1], layout.delimiter)):
        rows.pop()
    table = RawTable(sampling_rate=layout.sampling_rate)
    table.lines = np.array([number for number, _ in rows])
    columns = _numbers(rows, layout) or _columns(path, rows, layout)
    if layout.count not in (None, len(rows)):
        table.notes.append(f"the head announces {layout.count} samples, {len(rows)} are there")
    if layout.channels:
        layout, columns = _labview(path, layout, columns)
        starts = {as_number(x) for x in layout.channels.get("x0", ())}
        table.start = starts.pop() or 0.0 if len(starts) == 1 else 0.0
    for i, (header, values) in enumerate(zip(layout.headers, columns, strict=True)):
        if header and _is_empty(values):
            table.notes.append(f"left out: {header}, which is empty")
        elif header:
            table.add(header, values, layout.units[i] or None, fraction=True)
        elif not _is_superfluous(values, first=i == 0):
            shown = f"column {i + 1} of {path} without one"
            raise misfit("name", shown, "a name for each column", "Complete the header.")
    return table


def _labview(path: Path, layout: Layout, columns: list[Any]) -> tuple[Layout, list[Any]]:
    """Return the table of a LabVIEW file with the units of its head, and one column of times."""
    axis = [header.casefold() == "x_value" for header in layout.headers]
    times = [values for values, own in zip(columns, axis, strict=True) if own]
    count, own = len(axis) - sum(axis), layout.channels
    differ = [key for key in ("x0", "delta_x") if len({*own.get(key, ())[:count]} - {""}) > 1]
    if differ or any(not np.array_equal(times[0], other, equal_nan=True) for other in times[1:]):
        what = " and ".join(differ) or "X_Value"
        shown, remedy = f"{path} with channels of different {what}", "Export them on one clock."
        raise misfit("measurement", shown, "one time axis", remedy)
    labels = iter(own.get("y_unit_label", ()))
    # A unit in the name of a channel was given by hand.
    units = [
        "" if x or split_header(header, fraction=True)[1] else next(labels, "")
        for header, x in zip(layout.headers, axis, strict=True)
    ]
    kept = [i for i, x in enumerate(axis) if not x or i == axis.index(True)]
    headers, units = ([part[i] for i in kept] for part in (layout.headers, units))
    return replace(layout, headers=tuple(headers), units=tuple(units)), [columns[i] for i in kept]


def csv_headers(path: Path) -> tuple[str, ...]:
    """Return the heads of the columns as they are written, from the beginning of a text table."""
    with open_checked(path, RECORD) as file:
        begin = file.read(_BEGIN)
    if len(begin) == _BEGIN:  # the last line is not whole
        begin = begin[: max(begin.rfind(b"\n"), begin.rfind(b"\r")) + 1]
    return find_layout(path, _lines(begin)).headers


def _lines(whole: bytes) -> list[Line]:
    """Return the lines that are not blank; all kinds of line ends count."""
    if whole.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = whole.decode("utf-16", errors="replace")
    else:
        try:
            text = whole.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = whole.decode("latin-1")  # older instruments, for the micro sign
    ends = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return [(number, line) for number, line in enumerate(ends, 1) if line.strip()]


def _decimal_comma(lines: Sequence[str], delimiter: str) -> bool:
    return delimiter != "," and any("," in line for line in lines)


def _numbers(rows: list[Line], layout: Layout) -> list[Any] | None:
    """Read the rows in one go; None if there is anything but numbers in them."""
    lines = [line for _, line in rows]
    if _decimal_comma(lines, layout.delimiter):
        lines = [line.replace(",", ".") for line in lines]
    delimiter = None if layout.delimiter == " " else layout.delimiter
    try:
        values = np.loadtxt(lines, delimiter=delimiter, ndmin=2, comments=None, quotechar='"')
    except ValueError:
        return None
    return list(values.T) if values.shape[1] == len(layout.headers) else None


def _columns(path: Path, rows: list[Line], layout: Layout) -> list[Any]:
    """Read the rows cell by cell: empty ones are NaN, columns of text stay text."""
    cells = _cells(path, rows, layout)
    comma = _decimal_comma([line for _, line in rows], layout.delimiter)
    columns = []
    for header, column in zip(layout.headers, zip(*cells, strict=True), strict=True):
        values = _floats([cell.replace(",", ".") for cell in column] if comma else column)
        columns.append(_text(path, rows, header, column) if values is None else values)
    return columns


def _cells(path: Path, rows: list[Line], layout: Layout) -> list[list[str]]:
    """Return the cells of the rows, as many in each as there are headers."""
    lines, width = [line for _, line in rows], len(layout.headers)
    if layout.delimiter == " " or not any('"' in line for line in lines):
        # Blanks around cells may stay: numbers are read with them, and text is stripped.
        separator = None if layout.delimiter == " " else layout.delimiter
        cells = [line.split(separator) for line in lines]
    else:
        cells = []
        with contextlib.suppress(csv.Error):
            found = csv.reader(lines, delimiter=layout.delimiter)
            cells = [[cell.strip() for cell in row] for row in found]
        if len(cells) != len(lines):  # a quotation mark that is not closed
            cells = [split(line, layout.delimiter) for line in lines]
    for (number, _), row in zip(rows, cells, strict=True):
        if len(row) == width + 1 and not row[-1].strip():
            row.pop()  # a delimiter at the end
        elif len(row) != width:
            where, shown = f"{path}, line {number}", f"{len(row)} columns"
            raise misfit(where, shown, f"{width}, like the header", "Mend the line.")
    return cells


def _floats(column: Sequence[str]) -> np.ndarray | None:
    # Most empty cells are blank; the other words for them take longer to look up.
    for empty in (operator.not_, lambda cell: is_empty(cell.strip())):
        with contextlib.suppress(ValueError):
            return np.array([np.nan if empty(cell) else float(cell) for cell in column])
    return None


def _text(path: Path, rows: list[Line], header: str, column: Sequence[str]) -> np.ndarray:
    """Return a column of text, or refuse text among numbers."""
    column = [cell.strip() for cell in column]
    if not is_clock_text(column[0]):
        numbers = [as_number(cell) is not None for cell in column]
        words = (i for i, cell in enumerate(column) if not numbers[i] and not is_empty(cell))
        if any(numbers):
            i = next(words)
            where = f"{path}, line {rows[i][0]}, column {header!r}"
            raise invalid(where, column[i], "a number", "Remove the text, or leave the cell empty.")
    return np.array(column)


def _is_superfluous(values: np.ndarray, first: bool) -> bool:
    """Return whether a column without a name is empty, or numbers the rows in front of them."""
    counts = first and values.dtype.kind == "f" and bool(np.all(np.diff(values) == 1))
    return counts or _is_empty(values)


def _is_empty(values: np.ndarray) -> bool:
    return bool(np.isnan(values).all()) if values.dtype.kind == "f" else not any(values)
