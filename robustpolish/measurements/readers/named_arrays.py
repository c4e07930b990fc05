"""Arrays by name, as binary files hold them, sorted into a table."""

from __future__ import annotations

from typing import Any

import numpy as np

from robustpolish.measurements.headers import split_header
from robustpolish.measurements.raw import RawTable
from robustpolish.validation import described, invalid

_SHOWN = 20
"""Names that a message lists."""


def real_vector(values: Any) -> np.ndarray | None:
    """Return an array of one dimension and real numbers, or None if it is not of that kind."""
    array = np.asarray(values)
    if array.dtype.kind not in "fiub" or array.size < 2 or max(array.shape) != array.size:
        return None
    return array.reshape(-1)


def table_of(arrays: dict[str, Any], chosen: str | None, source: str) -> RawTable:
    """Sort the named arrays of a file into columns, a sampling rate, and what is left out.

    A matrix is a table of columns, a group what stands before the stroke in ``group/name``;
    `chosen` picks one of several. A text array as long as the matrix is wide names its columns.

    Parameters
    ----------
    arrays : dict of str to array
    chosen : str or None
        Name of a matrix or a group.
    source : str
        For the messages.

    Returns
    -------
    RawTable

    Raises
    ------
    InvalidInputError
        If there is no such matrix or group, or one has to be chosen; with what the file holds.
    """
    matrices = {}
    for name, values in arrays.items():
        array = np.asarray(values)
        if array.dtype.kind in "fiub" and array.ndim == 2 and min(array.shape) > 1:
            matrices[name] = array
    if chosen is not None and chosen not in matrices:
        group = chosen.rstrip("/") + "/"
        inside = {name[len(group) :]: a for name, a in arrays.items() if name.startswith(group)}
        if inside:
            rates = {name: a for name, a in arrays.items() if "/" not in name and np.size(a) == 1}
            inside = {**rates, **inside}
            return table_of(inside, None, f"{source}, {chosen}")
        expected = f"a matrix or a group of the file, which holds {_contents(arrays)}"
        raise invalid("table", chosen, expected, "Check its name.")
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
            f"one table to be chosen; the file holds {_contents(arrays)}",
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


def _contents(arrays: dict[str, Any]) -> str:
    """List what a file holds, with the shapes."""
    shown = [
        f"{name} ({' x '.join(map(str, np.shape(values))) or 'one number'})"
        for name, values in list(arrays.items())[:_SHOWN]
    ]
    more = f" and {len(arrays) - _SHOWN} more" if len(arrays) > _SHOWN else ""
    return (", ".join(shown) or "nothing") + more


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
