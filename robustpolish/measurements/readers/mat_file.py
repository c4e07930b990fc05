"""MATLAB files: versions 4 to 7 through SciPy, 7.3 (which is HDF5) through h5py."""

from __future__ import annotations

import inspect
import io
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
import scipy.sparse

from robustpolish.files import Wanted, content
from robustpolish.measurements.raw import RECORD, RawTable, unreadable
from robustpolish.measurements.readers.hdf5_file import SIGNATURE, read_hdf5
from robustpolish.measurements.readers.mat_structure import UnpacksTooFarError, readable_variables
from robustpolish.measurements.readers.named_arrays import table_of

# SciPy from 1.18 on asks which kind of sparse matrix is meant; none is kept.
_OPTIONS: dict[str, Any] = (
    {"spmatrix": False} if "spmatrix" in inspect.signature(scipy.io.loadmat).parameters else {}
)


def read_mat(path: Path, table: str | None = None, wanted: Wanted = RECORD) -> RawTable:
    """Read the vectors of a MATLAB file.

    The fields of a struct are named ``struct/field``, those of several ``struct(1)/field``, and the
    parts of a cell ``cell{1}``.
    """
    whole = content(path, wanted)
    # Version 7.3 puts 512 bytes of its own before the HDF5 signature.
    if SIGNATURE in whole[:520]:
        return read_hdf5(path, table, wanted)
    try:
        names = readable_variables(whole, wanted.largest)
        found = scipy.io.loadmat(io.BytesIO(whole), variable_names=names, **_OPTIONS)
        arrays: dict[str, Any] = {}
        for name, value in found.items():
            if not name.startswith("__"):
                _flatten(name, value, arrays)
    except UnpacksTooFarError as error:
        raise wanted.too_large(path, error.size, packed=True) from None
    except Exception as error:  # SciPy raises many kinds for a damaged file
        raise unreadable(path, "MATLAB", error) from None
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
