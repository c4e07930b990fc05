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
    table = RawTable(sampling_rate=_rate(arrays, source))
    if chosen is not None:
        matrix = matrices[chosen]
        matrix = matrix.T if matrix.shape[0] < matrix.shape[1] else matrix
        names = [f"{chosen}_{i}" for i in range(1, matrix.shape[1] + 1)]
        units = [""] * len(names)
        for key, array in arrays.items():
            if array.dtype.kind in "US" and array.size == len(names):
                texts = [str(item).strip() for item in array.reshape(-1)]
                units, names = (texts, names) if key.casefold() in _UNITS else (units, texts)
        for name, column, unit in zip(names, matrix.T, units, strict=True):
            table.add(name, column, unit)
        return table
    for name, vector in found.items():
        beside = (arrays.get(f"{name}_{word}") for word in _UNITS)
        written = [str(array.item()) for array in beside if array is not None and array.size == 1]
        table.add(name, vector, next(iter(written), None))
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


RATES = ("fs", "sampling_rate", "sample_rate", "samplerate")
STEPS = ("dt", "ts", "sampling_time")
_UNITS = ("unit", "units")


def _rate(arrays: dict[str, Any], source: str) -> float | None:
    """Find the sampling rate in lone numbers called fs or dt, as files without time often hold."""
    found: dict[str, float] = {}
    for name, array in arrays.items():
        if array.size == 1 and array.dtype.kind in "fiu" and (number := float(array.item())) > 0:
            if name.casefold() in RATES:
                found[name] = number
            if name.casefold() in STEPS:
                found[name] = 1 / number
    return one_rate(source, found)


def one_rate(source: object, found: dict[str, float]) -> float | None:
    """Return the sampling rate that all parts of a file give, None if they give none."""
    rates = list(found.values())
    if rates and max(rates) > min(rates) * (1 + 1e-6):
        shown = ", ".join(f"{name}: {rate:.6g} Hz" for name, rate in found.items())
        remedy = "Pass table=GROUP for what belongs together, or sampling_rate=."
        raise misfit("measurement", f"{source} with {shown}", "one sampling rate", remedy)
    return rates[0] if rates else None


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
    with (
        open_checked(path, wanted) as file,
        warnings.catch_warnings(record=True) as told,
        library_errors(path, "WAV"),
    ):
        warnings.simplefilter("always", scipy.io.wavfile.WavFileWarning)
        rate, samples = scipy.io.wavfile.read(file)
    table = RawTable(sampling_rate=float(rate))
    # SciPy warns too of chunks that it skips; they hold remarks, no samples.
    if any("EOF" in str(warning.message) for warning in told):
        table.notes.append(f"cut off: {len(samples)} samples are there, the head announces more")
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
