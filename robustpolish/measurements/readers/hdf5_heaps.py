"""Check of the places where an HDF5 file keeps text, before its library reads them.

The library follows the sizes that stand there and, at one of zero, goes round for ever. The layout
is that of the HDF5 File Format Specification, version 3.0, section III.E (global heaps).
"""

from __future__ import annotations

import mmap
import struct
from typing import BinaryIO

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
    if start + _HEADER > len(whole):
        raise ValueError("a heap beyond the end of the file")
    (size,) = struct.unpack_from("<Q", whole, start + 8)
    place, end = start + _HEADER, start + size
    if end > len(whole):
        raise ValueError("a heap beyond the end of the file")
    while place + _HEADER <= end:
        index, length = struct.unpack_from("<H6xQ", whole, place)
        # Index 0 is the room that is left, its header included.
        place += _HEADER + length + (-length % 8) if index else length
        if place > end or (length < _HEADER and not index):
            raise ValueError("a heap with an object of an impossible size")
