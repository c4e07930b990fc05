"""MATLAB files: versions 4 to 7 through SciPy, 7.3 (which is HDF5) through h5py."""

from __future__ import annotations

import contextlib
import inspect
import io
import math
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
import scipy.sparse

from robustpolish.base.input_files import FileSpec, content
from robustpolish.signals.raw import RECORD, RawTable, library_errors
from robustpolish.signals.readers.arrays import table_of
from robustpolish.signals.readers.hdf5 import SIGNATURE, read_hdf5

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
