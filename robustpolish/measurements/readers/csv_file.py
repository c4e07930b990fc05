"""Tables in text: a header line with names and units, then numbers."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from robustpolish.measurements.raw import RawTable
from robustpolish.validation import described, invalid


def read_csv(path: Path) -> RawTable:
    """Read a text table.

    Columns are separated by comma, semicolon or tab (the header decides); with semicolons or
    tabs, numbers may have a decimal comma. Lines before the header that begin with ``#`` and
    blank lines are skipped.
    """
    # newline=None: all kinds of line ends count.
    text = io.StringIO(_decode(path.read_bytes()), newline=None)
    lines = [(number, line.rstrip("\n")) for number, line in enumerate(text, 1) if line.strip()]
    while len(lines) > 1 and lines[0][1].lstrip().startswith("#") and _is_comment(lines):
        lines.pop(0)
    if not lines:
        raise invalid("measurement", described(f"{path}, empty"), "a table", "Export it again.")
    header_line, header = lines[0]
    delimiter = _delimiter(header)
    names = [name.strip() for name in _cells(header.strip(), delimiter)]
    if all(_number(name) is not None for name in names if name):
        raise invalid(
            "measurement",
            described(f"{path}, line {header_line}, with numbers only"),
            "a header such as 'time [s],x [mm]'",
            "Add a first line with the names and units of the columns.",
        )
    rows = lines[1:]
    if not rows:
        shown = described(f"{path} with a header and no numbers")
        raise invalid("measurement", shown, "numbers below the header", "Export it again.")
    values = _numbers(path, rows, names, delimiter)
    table = RawTable()
    for i, name in enumerate(names):
        if not name:
            shown = described(f"column {i + 1} of {path} without one")
            raise invalid("name", shown, "a name for each column", "Complete the header.")
        table.add(name, values[:, i])
    return table


def _decode(content: bytes) -> str:
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")  # older instruments, for the micro sign


def _is_comment(lines: list[tuple[int, str]]) -> bool:
    """Return whether the first line is a remark and not a header that begins with #."""
    first, second = (line for _, line in lines[:2])
    delimiter = _delimiter(second)
    return first.count(delimiter) != second.count(delimiter) or second.lstrip().startswith("#")


def _cells(line: str, delimiter: str) -> list[str]:
    try:
        return next(csv.reader([line], delimiter=delimiter), [])
    except csv.Error:  # such as a cell of more than 100 000 characters
        return line.split(delimiter)


def _delimiter(line: str) -> str:
    return max("\t;,", key=line.count) if ";" not in line else ";"


def _numbers(
    path: Path, rows: list[tuple[int, str]], names: list[str], delimiter: str
) -> np.ndarray:
    text = [line for _, line in rows]
    decimal_comma = delimiter != "," and any("," in line for line in text)
    if decimal_comma:
        text = [line.replace(",", ".") for line in text]
    try:
        values = np.loadtxt(text, delimiter=delimiter, ndmin=2, comments=None, quotechar='"')
    except ValueError:
        values = None
    if values is None or values.shape[1] != len(names):
        raise _bad_cell(path, rows, names, delimiter, decimal_comma)
    return values


def _bad_cell(
    path: Path,
    rows: list[tuple[int, str]],
    names: list[str],
    delimiter: str,
    decimal_comma: bool,
) -> Exception:
    """Find the first cell that is no number, and build the message that names it."""
    for number, line in rows:
        cells = _cells(line, delimiter)
        if len(cells) != len(names):
            return invalid(
                f"{path}, line {number}",
                described(f"{len(cells)} columns"),
                f"{len(names)}, like the header",
                "Mend the line.",
            )
        for name, cell in zip(names, cells, strict=True):
            if _number(cell.replace(",", ".") if decimal_comma else cell) is None:
                blank = not cell.strip()
                return invalid(
                    f"{path}, line {number}, column {name!r}",
                    described("nothing") if blank else cell.strip(),
                    "a number",
                    "Fill the gap or cut the record there." if blank else "Remove the text.",
                )
    return invalid("measurement", str(path), "a table of numbers", "Export it again.")


def _number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None
