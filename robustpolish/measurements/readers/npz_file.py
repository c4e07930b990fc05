"""NumPy archives."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from robustpolish.measurements.raw import RawTable, unreadable
from robustpolish.measurements.readers.named_arrays import table_of


def read_npz(path: Path, table: str | None = None) -> RawTable:
    """Read the vectors of an ``.npz`` archive, or one matrix of it with named columns."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except Exception as error:  # zipfile, zlib, NumPy and AttributeError for a lone array
        raise unreadable(path, "NPZ", error) from None
    return table_of(arrays, table, str(path))
