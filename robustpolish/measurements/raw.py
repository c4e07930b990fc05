"""What a reader gets out of a file, before any check."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from robustpolish.errors import InvalidInputError
from robustpolish.validation import described, invalid

_HEADER = re.compile(r"^(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]\s*$")


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
    notes : list of str
        What was done or left out on the way.
    """

    columns: dict[str, Any] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    sampling_rate: float | None = None
    notes: list[str] = field(default_factory=list)

    def add(self, header: str, values: Any, unit: str | None = None) -> None:
        """Add a column; its header may hold the unit, as in ``"x [mm]"``."""
        name, written = split_header(header)
        if name in self.columns:
            raise invalid("column", name, "a name used once", "Rename one of the columns.")
        self.columns[name] = values
        if unit or written:
            self.units[name] = unit or written


def split_header(header: str) -> tuple[str, str]:
    """Split ``"x [mm]"`` into name and unit; the unit is empty if there is none.

    Examples
    --------
    >>> split_header("x_m [um]"), split_header("force")
    (('x_m', 'um'), ('force', ''))
    """
    text = str(header).strip().strip("#").strip()
    found = _HEADER.match(text)
    if found and found["name"]:
        return found["name"].strip(), found["unit"].strip()
    return text, ""


def unreadable(source: object, kind: str, error: BaseException) -> InvalidInputError:
    """Build the error for a file that its library cannot read."""
    reason = str(error).splitlines()[0] if str(error) else type(error).__name__
    return invalid(
        "measurement",
        described(f"{source} ({reason})"),
        f"a readable {kind} file",
        "Check that the file is whole and its suffix right.",
    )


def real_vector(values: Any) -> np.ndarray | None:
    """Return an array of one dimension and real numbers, or None if it is not of that kind."""
    array = np.asarray(values)
    if array.dtype.kind not in "fiub" or array.size < 2 or max(array.shape) != array.size:
        return None
    return array.reshape(-1)


def table_of(arrays: dict[str, Any], chosen: str | None, source: str) -> RawTable:
    """Sort the named arrays of a file into columns, a sampling rate, and what is left out.

    A matrix is a table of columns; `chosen` picks one of several. A text array as long as the
    matrix is wide names its columns.
    """
    matrices = {}
    for name, values in arrays.items():
        array = np.asarray(values)
        if array.dtype.kind in "fiub" and array.ndim == 2 and min(array.shape) > 1:
            matrices[name] = array
    if chosen is not None and chosen not in matrices:
        listed = ", ".join(matrices) or "none: the file has no matrix"
        raise invalid("table", chosen, f"a matrix of the file: {listed}", "Check its name.")
    if chosen is None and len(matrices) == 1 and not _vectors(arrays, matrices):
        chosen = next(iter(matrices))
    table = RawTable(sampling_rate=_rate(arrays))
    if chosen is not None:
        _add_matrix(table, chosen, matrices[chosen], arrays)
        return table
    for name, vector in _vectors(arrays, matrices).items():
        table.add(name, vector)
    if not table.columns and matrices:
        raise invalid(
            "measurement",
            described(f"{source} with the tables {', '.join(matrices)}"),
            "one table to be chosen",
            "Pass table=NAME.",
        )
    left = [
        name
        for name, values in arrays.items()
        if split_header(name)[0] not in table.columns and np.size(values) > 1
    ]
    if left:
        table.notes.append(f"left out, as they are no signals: {', '.join(sorted(left))}")
    return table


def _vectors(arrays: dict[str, Any], matrices: dict[str, Any]) -> dict[str, np.ndarray]:
    found = {name: real_vector(values) for name, values in arrays.items() if name not in matrices}
    return {name: vector for name, vector in found.items() if vector is not None}


def _rate(arrays: dict[str, Any]) -> float | None:
    """Find the sampling rate in a lone number called fs or dt, as files without time often hold."""
    for name, values in arrays.items():
        array = np.asarray(values)
        if array.size == 1 and array.dtype.kind in "fiu" and float(array.reshape(-1)[0]) > 0:
            number = float(array.reshape(-1)[0])
            if name.casefold() in ("fs", "sampling_rate", "sample_rate", "samplerate"):
                return number
            if name.casefold() in ("dt", "ts", "sampling_time"):
                return 1 / number
    return None


def _add_matrix(table: RawTable, name: str, matrix: np.ndarray, arrays: dict[str, Any]) -> None:
    if matrix.shape[0] < matrix.shape[1]:
        matrix = matrix.T
    width = matrix.shape[1]
    names = [f"{name}_{i + 1}" for i in range(width)]
    for values in arrays.values():
        array = np.asarray(values)
        if array.dtype.kind in "US" and array.size == width:
            names = [str(item).strip() for item in array.reshape(-1)]
    for i, column in enumerate(names):
        table.add(column, matrix[:, i])
