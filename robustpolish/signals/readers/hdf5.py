"""HDF5 files, MATLAB 7.3 included."""

from __future__ import annotations

import mmap
import struct
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np

from robustpolish.base.input_files import FileSpec, open_checked
from robustpolish.signals.headers import split_header
from robustpolish.signals.raw import RECORD, RawTable, library_errors
from robustpolish.signals.readers.arrays import table_of

# Check of the places where an HDF5 file keeps text, before its library reads them.
#
# The library follows the sizes that stand there and, at one of zero, goes round for ever. The
# layout is that of the HDF5 File Format Specification, version 3.0, section III.E (global heaps).

_SIGNATURE = b"GCOL\x01\0\0\0"
_HEADER = 16  # of a heap, and of each of its objects, with lengths of eight bytes


def check_heaps(file: BinaryIO) -> None:
    """Check that the objects of every heap fit into it, one behind the other.

    Parameters
    ----------
    file : binary file
        An HDF5 file, not empty.

    Raises
    ------
    ValueError
        If one is larger than what is left, or takes no room at all.
    """
    with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as whole:
        start = whole.find(_SIGNATURE)
        while start >= 0:
            _check_heap(whole, start)
            start = whole.find(_SIGNATURE, start + 1)


def _check_heap(whole: mmap.mmap, start: int) -> None:
    place = end = start + _HEADER
    if place <= len(whole):
        end = start + struct.unpack_from("<Q", whole, start + 8)[0]
    if end > len(whole):
        raise ValueError("a heap beyond the end of the file")
    while place + _HEADER <= end:
        index, length = struct.unpack_from("<H6xQ", whole, place)
        # Index 0 is the room that is left, its header included.
        place += _HEADER + length + (-length % 8) if index else length
        if place > end or (length < _HEADER and not index):
            raise ValueError("a heap with an object of an impossible size")


SIGNATURE = b"\x89HDF\r\n\x1a\n"


def read_hdf5(path: Path, table: str | None = None, wanted: FileSpec = RECORD) -> RawTable:
    """Read the vectors of an HDF5 file; the attribute ``units`` or ``unit`` gives their unit.

    Datasets in groups are named ``group/name``.
    """
    found = _Hdf5Content(path, wanted)
    # h5py raises OSError, RuntimeError and KeyError on damage
    with open_checked(path, wanted) as stream, library_errors(path, "HDF5"):
        check_heaps(stream)
        with h5py.File(stream, "r") as file:
            found.collect(file)
    result = table_of(found.arrays, table, str(path))
    for name, unit in found.units.items():
        column = split_header(name.removeprefix(f"{table}/"))[0]
        if column in result.columns:
            result.units[column] = unit
    return result


class _Hdf5Content:
    """What a file holds, read until the limit is reached."""

    def __init__(self, path: Path, wanted: FileSpec) -> None:
        self.arrays: dict[str, Any] = {}
        self.units: dict[str, str] = {}
        self._path, self._wanted = path, wanted
        self._size = self._room = wanted.largest

    def collect(self, file: h5py.File) -> None:
        """Read all datasets, and a sampling rate among the attributes of the file."""
        self._size = file.id.get_filesize()
        file.visititems(lambda name, item: self._collect(file, name, item))
        for key in ("fs", "sampling_rate", "sample_rate", "dt"):
            if key in file.attrs and key not in self.arrays:
                self.arrays[key] = file.attrs[key]

    def _collect(self, file: h5py.File, name: str, item: Any) -> None:
        # MATLAB keeps what is in its cells under #refs#; they are reached from the cells.
        if not isinstance(item, h5py.Dataset) or name.startswith("#"):
            return
        kind = item.dtype.kind
        if h5py.check_ref_dtype(item.dtype) is h5py.Reference:
            self._cell(file, name, item)
        elif kind == "O":
            text = h5py.check_string_dtype(item.dtype) is not None
            self.arrays[name] = self._texts(item) if text else np.zeros(0)
        elif kind in "fiubS" and "MATLAB_empty" not in item.attrs:
            self.arrays[name] = self._values(item)
        for unit in (item.attrs[key] for key in ("unit", "units") if key in item.attrs):
            self.units[name] = (
                unit.decode("utf-8", "replace") if isinstance(unit, bytes) else str(unit)
            )

    def _values(self, item: Any) -> np.ndarray:
        """Return numbers or text; MATLAB writes text as numbers of characters."""
        self._take(item, item.size * item.dtype.itemsize)
        values = np.asarray(item[()])
        if values.dtype.kind == "S":
            return values.astype(str)
        if item.attrs.get("MATLAB_class") == b"char" and values.dtype.kind in "iu":
            return np.array(["".join(map(chr, values.reshape(-1)))])
        return values

    def _texts(self, item: Any) -> np.ndarray:
        """Return texts of any length, which may all be the same long one in the file."""
        self._take(item, item.size * item.dtype.itemsize)
        if item.size > self._size:
            raise self._wanted.refused(self._path, f"more texts in {item.name} than bytes")
        if item.size * self._size <= self._room:
            return np.atleast_1d(item.asstr()[()]).astype(str)
        texts, longest = [], 0
        for place in np.ndindex(item.shape):
            texts.append(item.asstr()[place])
            longest = max(longest, len(texts[-1]))
            if 4 * item.size * longest > self._room:  # NumPy gives each the room of the longest
                raise self._wanted.too_large(self._path, 4 * item.size * longest, packed=True)
        return np.array(texts)

    def _cell(self, file: h5py.File, name: str, item: Any) -> None:
        """Collect the parts of a MATLAB cell as ``name{1}`` and so on; texts alone as one array."""
        self._take(item, item.size * item.dtype.itemsize)
        parts = [file[reference] for reference in np.asarray(item[()]).reshape(-1) if reference]
        values = [self._values(part) for part in parts if isinstance(part, h5py.Dataset)]
        if values and all(part.dtype.kind == "U" for part in values):
            self.arrays[name] = np.concatenate(values)
        else:
            self.arrays |= {f"{name}{{{i}}}": part for i, part in enumerate(values, 1)}

    def _take(self, item: Any, size: int) -> None:
        """Count what is about to be read, and refuse data that lie in other files."""
        if item.external or item.is_virtual:
            raise self._wanted.refused(self._path, f"{item.name} lies in another file")
        self._room -= size
        if self._room < 0:
            raise self._wanted.too_large(self._path, self._wanted.largest - self._room, packed=True)
