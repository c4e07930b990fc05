"""Where the table of a text file begins, how its cells are separated, and what its columns are."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from robustpolish.measurements.headers import line_of_units
from robustpolish.measurements.stamps import is_clock_text
from robustpolish.validation import described, invalid

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
    """

    delimiter: str
    headers: tuple[str, ...]
    units: tuple[str, ...]
    begin: int
    sampling_rate: float | None = None


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
        return Layout(delimiter, tuple(above), tuple(units), begin, _rate_above(lines[:top]))
    number, line = lines[row]
    raise invalid(
        "measurement",
        described(f"{path}, line {number}, with numbers only: {line[:30]}"),
        f"a header above it with {len(first)} names, such as 'time [s],x [mm]'",
        "Add a line with the names and units of the columns.",
    )


def split(line: str, delimiter: str) -> list[str]:
    """Return the cells of a line, without the blanks around them."""
    if delimiter == " ":
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]
    except csv.Error:  # such as a cell of more than 100 000 characters
        return [cell.strip() for cell in line.split(delimiter)]


def is_empty(cell: str) -> bool:
    """Return whether a cell stands for a missing value."""
    return cell.casefold() in _EMPTY


def as_number(cell: str) -> float | None:
    """Return the number in a cell, with a decimal point or comma; None if there is none."""
    try:
        return float(cell)
    except ValueError:
        pass
    try:
        return float(cell.replace(",", ".")) if cell.count(",") == 1 else None
    except ValueError:
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
    for i in range(len(lines)):
        delimiter = _row_delimiter(lines[i][1])
        if delimiter is None:
            continue
        width = len(split(lines[i][1], delimiter))
        below = lines[i + 1 : i + _LOOKED_AT]
        if all(_is_row(line, delimiter, width=width) for _, line in below):
            return i, delimiter
    raise invalid(
        "measurement",
        described(f"{path} with a header and no numbers"),
        "numbers below the header",
        "Export it again.",
    )


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
    return _is_number(cell) or is_clock_text(cell)


def _is_number(cell: str) -> bool:
    return as_number(cell) is not None


def _rate_above(preamble: Sequence[Line]) -> float | None:
    """Return the sampling rate in Hz that the lines above a table name, None if they do not."""
    for _, line in preamble:
        if len(line) > 200:
            continue
        found = _RATE.search(line.strip("# \t;,"))
        if found:
            number = as_number(found["number"].rstrip(".,")) or 0.0
            scale = {"k": 1e3, "m": 1e6}.get(found["unit"][:1].casefold(), 1.0)
            return scale * number if number > 0 else None
        found = _STEP.match(line.strip("# ;,"))
        if found:
            number = as_number(found["number"].rstrip(".,")) or 0.0
            scale = {"m": 1e-3, "u": 1e-6}.get(found["unit"][:1].casefold(), 1.0)
            return 1 / (scale * number) if number > 0 else None
    return None
