"""Tables in text: whatever stands above them, a header with names and units, then numbers."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from robustpolish.files import Wanted, content, opened
from robustpolish.measurements.raw import RECORD, RawTable
from robustpolish.measurements.readers.text_layout import (
    Layout,
    Line,
    as_number,
    find_layout,
    is_empty,
    split,
)
from robustpolish.measurements.stamps import is_clock_text
from robustpolish.validation import described, invalid

# Bytes that the head of a table is looked for in; data loggers write some thousand above it.
_BEGIN = 1 << 16


def read_csv(path: Path, wanted: Wanted = RECORD) -> RawTable:
    """Read a text table.

    Columns are separated by comma, semicolon, tab or blanks (the rows decide); unless it is a
    comma, numbers may have a decimal comma. The header is the last line above the numbers that
    names all columns, with their units in it or in a line of their own below it; what stands above
    it is skipped, remarks and the heads of data loggers. Empty cells become NaN.
    """
    lines = _lines(content(path, wanted))
    if not lines:
        raise invalid("measurement", described(f"{path}, empty"), "a table", "Export it again.")
    layout = find_layout(path, lines)
    rows = _without_blank_end(lines[layout.begin :], layout.delimiter)
    table = RawTable(sampling_rate=layout.sampling_rate)
    table.lines = np.array([number for number, _ in rows])
    columns = _numbers(rows, layout) or _columns(path, rows, layout)
    for i, (header, values) in enumerate(zip(layout.headers, columns, strict=True)):
        if header and _is_empty(values):
            table.notes.append(f"left out: {header}, which is empty")
        elif header:
            table.add(header, values, layout.units[i] or None, fraction=True)
        elif not _is_superfluous(values, first=i == 0):
            shown = described(f"column {i + 1} of {path} without one")
            raise invalid("name", shown, "a name for each column", "Complete the header.")
    return table


def csv_headers(path: Path) -> tuple[str, ...]:
    """Return the heads of the columns as they are written, from the beginning of a text table."""
    with opened(path, RECORD) as file:
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


def _without_blank_end(rows: list[Line], delimiter: str) -> list[Line]:
    """Leave out rows of empty cells at the end, which spreadsheets append."""
    last = len(rows)
    while last > 1 and not any(split(rows[last - 1][1], delimiter)):
        last -= 1
    return rows[:last]


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
        if values is None:
            values = _text(path, rows, header, column)
        columns.append(values)
    return columns


def _cells(path: Path, rows: list[Line], layout: Layout) -> list[list[str]]:
    """Return the cells of the rows, as many in each as there are headers."""
    lines, width = [line for _, line in rows], len(layout.headers)
    if layout.delimiter == " " or not any('"' in line for line in lines):
        # Blanks around cells may stay: numbers are read with them, and text is stripped.
        separator = None if layout.delimiter == " " else layout.delimiter
        cells = [line.split(separator) for line in lines]
    else:
        try:
            cells = [
                [cell.strip() for cell in row]
                for row in csv.reader(lines, delimiter=layout.delimiter)
            ]
        except csv.Error:
            cells = []
        if len(cells) != len(lines):  # a quotation mark that is not closed
            cells = [split(line, layout.delimiter) for line in lines]
    for i, row in enumerate(cells):
        if len(row) == width + 1 and not row[-1].strip():
            row.pop()  # a delimiter at the end
        elif len(row) != width:
            raise invalid(
                f"{path}, line {rows[i][0]}",
                described(f"{len(row)} columns"),
                f"{width}, like the header",
                "Mend the line.",
            )
    return cells


def _floats(column: Sequence[str]) -> np.ndarray | None:
    try:
        return np.array([float(cell) if cell else np.nan for cell in column])
    except ValueError:
        pass
    try:
        return np.array([np.nan if is_empty(cell.strip()) else float(cell) for cell in column])
    except ValueError:
        return None


def _text(path: Path, rows: list[Line], header: str, column: Sequence[str]) -> np.ndarray:
    """Return a column of text, or refuse text among numbers."""
    column = [cell.strip() for cell in column]
    if is_clock_text(column[0]):
        return np.array(column)
    numbers = [as_number(cell) is not None for cell in column]
    if any(numbers):
        i = next(i for i, cell in enumerate(column) if not numbers[i] and not is_empty(cell))
        raise invalid(
            f"{path}, line {rows[i][0]}, column {header!r}",
            column[i],
            "a number",
            "Remove the text, or leave the cell empty.",
        )
    return np.array(column)


def _is_superfluous(values: np.ndarray, first: bool) -> bool:
    """Return whether a column without a name is empty, or numbers the rows in front of them."""
    if values.dtype.kind != "f":
        return _is_empty(values)
    return _is_empty(values) or (first and bool(np.all(np.diff(values) == 1)))


def _is_empty(values: np.ndarray) -> bool:
    return bool(np.isnan(values).all()) if values.dtype.kind == "f" else not any(values)
