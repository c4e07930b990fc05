"""NumPy archives."""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import BinaryIO

import numpy as np

from robustpolish.errors import InvalidInputError
from robustpolish.files import Wanted, members, opened
from robustpolish.measurements.raw import RECORD, RawTable, unreadable
from robustpolish.measurements.readers.named_arrays import table_of


def read_npz(path: Path, table: str | None = None, wanted: Wanted = RECORD) -> RawTable:
    """Read the vectors of an ``.npz`` archive, or one matrix of it with named columns."""
    with opened(path, wanted) as file:
        try:
            for member in members(file, path, wanted):
                _check_head(file, member)
            file.seek(0)
            with np.load(file, allow_pickle=False) as archive:
                arrays = {name: archive[name] for name in archive.files}
        except InvalidInputError:
            raise
        except Exception as error:  # zipfile, zlib, NumPy, and what is no archive
            raise unreadable(path, "NPZ", error) from None
    return table_of(arrays, table, str(path))


def _check_head(file: BinaryIO, member: zipfile.ZipInfo) -> None:
    """Refuse an array that says it is larger than its part of the archive: it would be reserved."""
    with zipfile.ZipFile(file) as archive, archive.open(member) as part:
        if part.read(6) != np.lib.format.MAGIC_PREFIX:
            return  # NumPy gives it as bytes
        version = tuple(part.read(2))
        read = (
            np.lib.format.read_array_header_1_0
            if version == (1, 0)
            else np.lib.format.read_array_header_2_0
        )
        shape, _, dtype = read(part)
    if math.prod(shape) * dtype.itemsize > member.file_size or min(shape, default=0) < 0:
        raise ValueError(f"{member.filename} is shorter than it says")
