"""Named arrays sorted into a table, NumPy archives, and sound files."""

from __future__ import annotations

import math
import warnings
import zipfile
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import scipy.io.wavfile

from robustpolish.base.checks import invalid, misfit
from robustpolish.base.input_files import FileSpec, members, open_checked
from robustpolish.signals.raw import RECORD, RawTable, library_errors, split_header

# Arrays by name, as binary files hold them, sorted into a table.

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
    arrays = {name: np.asarray(values) for name, values in arrays.items()}
    matrices = {
        name: array
        for name, array in arrays.items()
        if array.dtype.kind in "fiub" and array.ndim == 2 and min(array.shape) > 1
    }
    if chosen is not None and chosen not in matrices:
        group = chosen.rstrip("/") + "/"
        inside = {name[len(group) :]: a for name, a in arrays.items() if name.startswith(group)}
        if inside:
            rates = {name: a for name, a in arrays.items() if "/" not in name and a.size == 1}
            return table_of({**rates, **inside}, None, f"{source}, {chosen}")
        expected = f"a matrix or a group of the file, which holds {_contents(arrays)}"
        raise invalid("table", chosen, expected, "Check its name.")
    vectors = {name: real_vector(values) for name, values in arrays.items()}
    found = {name: vector for name, vector in vectors.items() if vector is not None}
    if chosen is None and len(matrices) == 1 and not found:
        (chosen,) = matrices
    table = RawTable(sampling_rate=_rate(arrays))
    if chosen is not None:
        matrix = matrices[chosen]
        matrix = matrix.T if matrix.shape[0] < matrix.shape[1] else matrix
        names = [f"{chosen}_{i}" for i in range(1, matrix.shape[1] + 1)]
        for array in arrays.values():
            if array.dtype.kind in "US" and array.size == len(names):
                names = [str(item).strip() for item in array.reshape(-1)]
        for name, column in zip(names, matrix.T, strict=True):
            table.add(name, column)
        return table
    for name, vector in found.items():
        table.add(name, vector)
    if not table.columns and matrices:
        shown = f"{source} with the tables {', '.join(matrices)}"
        want = f"one table to be chosen; the file holds {_contents(arrays)}"
        raise misfit("measurement", shown, want, "Pass table=NAME.")
    left = [n for n, a in arrays.items() if split_header(n)[0] not in table.columns and a.size > 1]
    if left:
        table.notes.append(f"left out, as they are no signals: {', '.join(sorted(left))}")
    return table


def _contents(arrays: dict[str, Any]) -> str:
    """List what a file holds, with the shapes."""
    shown = [
        f"{name} ({' x '.join(map(str, values.shape)) or 'one number'})"
        for name, values in list(arrays.items())[:_SHOWN]
    ]
    more = f" and {len(arrays) - _SHOWN} more" if len(arrays) > _SHOWN else ""
    return (", ".join(shown) or "nothing") + more


def _rate(arrays: dict[str, Any]) -> float | None:
    """Find the sampling rate in a lone number called fs or dt, as files without time often hold."""
    for name, array in arrays.items():
        if array.size == 1 and array.dtype.kind in "fiu" and (number := float(array.item())) > 0:
            if name.casefold() in ("fs", "sampling_rate", "sample_rate", "samplerate"):
                return number
            if name.casefold() in ("dt", "ts", "sampling_time"):
                return 1 / number
    return None


# NumPy archives.


def read_npz(path: Path, table: str | None = None, wanted: FileSpec = RECORD) -> RawTable:
    """Read the vectors of an ``.npz`` archive, or one matrix of it with named columns."""
    # zipfile, zlib and NumPy raise errors of their own
    with open_checked(path, wanted) as file, library_errors(path, "NPZ"):
        for member in members(file, path, wanted):
            _check_head(file, member)
        file.seek(0)
        with np.load(file, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    return table_of(arrays, table, str(path))


def _check_head(file: BinaryIO, member: zipfile.ZipInfo) -> None:
    """Refuse an array that says it is larger than its part of the archive: it would be reserved."""
    header = np.lib.format
    with zipfile.ZipFile(file) as archive, archive.open(member) as part:
        if part.read(6) != header.MAGIC_PREFIX:
            return  # NumPy gives it as bytes
        first = tuple(part.read(2)) == (1, 0)
        read = header.read_array_header_1_0 if first else header.read_array_header_2_0
        shape, _, dtype = read(part)
    if math.prod(shape) * dtype.itemsize > member.file_size or min(shape, default=0) < 0:
        raise ValueError(f"{member.filename} is shorter than it says")


def read_wav(path: Path, wanted: FileSpec = RECORD) -> RawTable:
    """Read the channels ``channel_1``, ``channel_2``, ...; integers become shares of full scale."""
    with open_checked(path, wanted) as file, warnings.catch_warnings(), library_errors(path, "WAV"):
        # SciPy warns of chunks that it skips; they hold remarks, no samples.
        warnings.simplefilter("ignore", scipy.io.wavfile.WavFileWarning)
        rate, samples = scipy.io.wavfile.read(file)
    table = RawTable(sampling_rate=float(rate))
    samples = np.atleast_2d(samples.T).T
    values = samples.astype(float)
    if samples.dtype == np.uint8:
        values = (values - 128) / 128
    elif samples.dtype.kind == "i":
        values = values / -float(np.iinfo(samples.dtype).min)
    if samples.dtype.kind in "iu":
        table.notes.append("samples are shares of the full scale; pass units= to calibrate")
    for i in range(values.shape[1]):
        table.add(f"channel_{i + 1}", values[:, i])
    return table
