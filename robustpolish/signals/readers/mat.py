"""MATLAB and HDF5 files: versions 4 to 7 through SciPy, 7.3 (which is HDF5) through h5py."""

from __future__ import annotations

import contextlib
import inspect
import io
import math
import mmap
import struct
import zlib
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np
import scipy.io
import scipy.sparse

from robustpolish.base.input_files import FileSpec, content, open_checked
from robustpolish.signals.raw import RECORD, RawTable, library_errors, split_header
from robustpolish.signals.readers.arrays import RATES, STEPS, one_rate, table_of

# HDF5 files, MATLAB 7.3 included.

# Check of the places where an HDF5 file keeps text, before its library reads them.
#
# The library follows the sizes that stand there and, at one of zero, goes round for ever. The
# layout is that of the HDF5 File Format Specification, version 3.0, section III.E (global heaps).

_SIGNATURE = b"GCOL\x01\0\0\0"
_HDF5_HEADER = 16  # of a heap, and of each of its objects, with lengths of eight bytes


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
    place = end = start + _HDF5_HEADER
    if place <= len(whole):
        end = start + struct.unpack_from("<Q", whole, start + 8)[0]
    if end > len(whole):
        raise ValueError("a heap beyond the end of the file")
    while place + _HDF5_HEADER <= end:
        index, length = struct.unpack_from("<H6xQ", whole, place)
        # Index 0 is the room that is left, its header included.
        place += _HDF5_HEADER + length + (-length % 8) if index else length
        if place > end or (length < _HDF5_HEADER and not index):
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
    own = {n: rate for n, rate in found.rates.items() if n.startswith(table or "")}
    result.sampling_rate = one_rate(path, own) or result.sampling_rate
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
        self.rates: dict[str, float] = {}
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
        for key in (*RATES, *STEPS):
            number = np.asarray(item.attrs.get(key, 0))
            if number.dtype.kind in "fiu" and number.size == 1 and number > 0:
                self.rates[name] = float(number if key in RATES else 1 / number)
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
        if "scale_factor" in item.attrs or "add_offset" in item.attrs:  # CF conventions, 8.1
            empty = values == item.attrs.get("_FillValue", np.nan)
            values = values * item.attrs.get("scale_factor", 1) + item.attrs.get("add_offset", 0)
            return np.where(empty, np.nan, values)
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


# Check of a MATLAB file's structure, before SciPy reads it.
#
# SciPy's reader is compiled and trusts the types and sizes in the file: a damaged one can take the
# whole process down. The layout is that of MathWorks, MAT-File Format (versions 5 to 7).

_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
_INT8, _INT32, _UINT32, _UTF8 = 1, 5, 6, 16
_ITEM_SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}
_TEXT_TYPES = {*_ITEM_SIZES, 16, 17, 18}
_CELL, _STRUCT, _OBJECT, _CHAR = 1, 2, 3, 4
_NUMERIC = range(6, 16)
_COMPLEX = 0x0800
_DEEPEST = 20
_LARGEST = 1 << 32  # entries of a variable


class DamagedFileError(ValueError):
    """The structure of the file contradicts itself."""


class DecompressedSizeError(Exception):
    """The compressed variables are larger than allowed; `size` bytes are known of."""

    def __init__(self, size: int) -> None:
        super().__init__(size)
        self.size = size


class _NoSignalsError(Exception):
    """A variable of a kind that is no array, struct or text."""


def readable_variables(content: bytes, largest: int = _LARGEST) -> list[str] | None:
    """Check that the parts of a MATLAB file fit together, and name the variables to read.

    Parameters
    ----------
    content : bytes
        The whole file.
    largest : int, optional
        Bytes that the compressed variables may have together.

    Returns
    -------
    list of str or None
        Variables that may hold signals: no function handles, tables or sparse matrices. None for
        version 4, which has another structure.

    Raises
    ------
    DamagedFileError
        If a part is larger than what holds it, or of an impossible kind.
    DecompressedSizeError
        If the variables are larger than `largest`.
    """
    if len(content) < _HEADER or 0 in content[:4]:
        return None
    if content[126:128] not in (b"IM", b"MI"):
        raise DamagedFileError("no byte order in the header")
    order = "<" if content[126:128] == b"IM" else ">"
    names = []
    place, unpacked = _HEADER, 0
    while place < len(content):
        kind, part, place = _element(content, place, order, padded=False)
        if kind == _COMPRESSED:
            part = _decompressed(part, largest - unpacked)
            unpacked += len(part)
            kind, part, _ = _element(part, 0, order)
        if kind != _MATRIX:
            raise DamagedFileError(f"an element of type {kind} among the variables")
        with contextlib.suppress(_NoSignalsError):
            names.append(_check_matrix(part, order, 0))
    return names


def _element(
    content: bytes | memoryview, place: int, order: str, padded: bool = True
) -> tuple[int, memoryview, int]:
    """Return type and content of the element at `place`, and where the next one begins."""
    whole = memoryview(content)
    if place + 8 > len(whole):
        raise DamagedFileError("it ends in the middle of an element")
    kind, size = struct.unpack_from(f"{order}II", whole, place)
    if kind >> 16:  # the short form, with up to four bytes in the tag itself
        kind, size = kind & 0xFFFF, kind >> 16
        if size > 4:
            raise DamagedFileError("a short element of more than four bytes")
        return kind, whole[place + 4 : place + 4 + size], place + 8
    end = place + 8 + size
    if end > len(whole):
        raise DamagedFileError("an element that is larger than the file")
    return kind, whole[place + 8 : end], end + (-size % 8 if padded else 0)


def _decompressed(part: memoryview, room: int) -> memoryview:
    try:
        engine = zlib.decompressobj()
        content = engine.decompress(part, room + 1)
    except zlib.error as error:
        raise DamagedFileError(f"a compressed element is damaged ({error})") from None
    if len(content) > room:
        raise DecompressedSizeError(len(content))
    if not engine.eof:
        raise DamagedFileError("a compressed element is not complete")
    return memoryview(content)


def _check_matrix(part: memoryview, order: str, depth: int) -> str:
    """Check a variable and return its name."""
    if not part:
        return ""
    if depth > _DEEPEST:
        raise DamagedFileError("variables nested too deeply")
    kind, flags, place = _element(part, 0, order)
    if (kind, len(flags)) != (_UINT32, 8):
        raise DamagedFileError("a variable without its flags")
    (flag,) = struct.unpack_from(f"{order}I", flags)
    if flag & 0xFF not in (_CELL, _STRUCT, _OBJECT, _CHAR, *_NUMERIC):
        raise _NoSignalsError
    kind, sizes, place = _element(part, place, order)
    if kind != _INT32 or len(sizes) < 8 or len(sizes) % 4 or len(sizes) > 4 * 32:
        raise DamagedFileError("a variable without its dimensions")
    dimensions = struct.unpack(f"{order}{len(sizes) // 4}i", sizes)
    if min(dimensions) < 0 or math.prod(dimensions) > _LARGEST:
        raise DamagedFileError("impossible dimensions")
    kind, name, place = _element(part, place, order)
    if kind not in (_INT8, _UTF8):
        raise DamagedFileError("a variable without its name")
    _check_content(part, place, order, flag, math.prod(dimensions), depth)
    return bytes(name).decode("latin-1")


def _check_content(
    part: memoryview, place: int, order: str, flags: int, count: int, depth: int
) -> None:
    what = flags & 0xFF
    if what in _NUMERIC:
        for _ in range(2 if flags & _COMPLEX else 1):
            kind, data, place = _element(part, place, order)
            if kind not in _ITEM_SIZES or len(data) != count * _ITEM_SIZES[kind]:
                raise DamagedFileError("a matrix whose data do not fill it")
    elif what == _CHAR:
        if _element(part, place, order)[0] not in _TEXT_TYPES:
            raise DamagedFileError("text of an impossible type")
    else:
        if what != _CELL:
            count, place = _fields(part, place, order, count, what == _OBJECT)
        for _ in range(count):
            kind, inner, place = _element(part, place, order)
            if kind != _MATRIX:
                raise DamagedFileError("a cell or field that is no variable")
            _check_matrix(inner, order, depth + 1)


def _fields(
    part: memoryview, place: int, order: str, count: int, is_object: bool
) -> tuple[int, int]:
    """Return the number of values in a struct, and where they begin."""
    if is_object:
        kind, _, place = _element(part, place, order)
        if kind != _INT8:
            raise DamagedFileError("an object without its class")
    kind, width, place = _element(part, place, order)
    if (kind, len(width)) != (_INT32, 4):
        raise DamagedFileError("a struct without the length of its names")
    (length,) = struct.unpack(f"{order}i", width)
    kind, names, place = _element(part, place, order)
    if kind != _INT8 or length < 1 or len(names) % length:
        raise DamagedFileError("a struct without its names")
    return count * (len(names) // length), place


# SciPy from 1.18 on asks which kind of sparse matrix is meant; none is kept.
_OPTIONS: dict[str, Any] = (
    {"spmatrix": False} if "spmatrix" in inspect.signature(scipy.io.loadmat).parameters else {}
)


def read_mat(path: Path, table: str | None = None, wanted: FileSpec = RECORD) -> RawTable:
    """Read the vectors of a MATLAB file.

    The fields of a struct are named ``struct/field``, those of several ``struct(1)/field``, and the
    parts of a cell ``cell{1}``.
    """
    whole = content(path, wanted)
    # Version 7.3 puts 512 bytes of its own before the HDF5 signature.
    if SIGNATURE in whole[:520]:
        return read_hdf5(path, table, wanted)
    arrays: dict[str, Any] = {}
    with library_errors(path, "MATLAB"):
        try:
            names = readable_variables(whole, wanted.largest)
        except DecompressedSizeError as error:
            raise wanted.too_large(path, error.size, packed=True) from None
        found = scipy.io.loadmat(io.BytesIO(whole), variable_names=names, **_OPTIONS)
        for name, value in found.items():
            if not name.startswith("__"):
                _flatten(name, value, arrays)
    return table_of(arrays, table, str(path))


def _flatten(name: str, value: Any, arrays: dict[str, Any]) -> None:
    """Collect the arrays in nested structs and cells, named as in ``s/field`` and ``c{2}``."""
    if scipy.sparse.issparse(value):
        return  # no signals; version 4 has them among its matrices
    array = np.asarray(value)
    if array.dtype == object and array.ndim == 0:
        return  # nothing of numbers or words, such as MATLAB's empty objects
    items = array.reshape(-1, order="F")
    if array.dtype.names:
        for i, item in enumerate(items, 1):
            here = name if array.size == 1 else f"{name}({i})"
            for field in array.dtype.names:
                _flatten(f"{here}/{field}", item[field], arrays)
    elif array.dtype != object:
        arrays[name] = array
    elif array.size == 1:
        _flatten(name, items[0], arrays)
    elif (words := _words(items)) is not None:
        arrays[name] = words
    else:
        for i, item in enumerate(items, 1):
            _flatten(f"{name}{{{i}}}", item, arrays)


def _words(items: np.ndarray) -> np.ndarray | None:
    """Return the texts of a cell that holds nothing else, such as the names of columns."""
    texts = [np.asarray(item) for item in items]
    if not texts or any(text.dtype.kind != "U" or text.size > 1 for text in texts):
        return None
    return np.array(["".join(text.reshape(-1)) for text in texts])
