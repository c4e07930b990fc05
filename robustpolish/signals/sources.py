"""Which reader takes which file or object."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from robustpolish.base.checks import instance_of, invalid, misfit
from robustpolish.base.input_files import file_size
from robustpolish.signals.raw import RECORD, RawTable
from robustpolish.signals.readers.arrays import read_npz, read_wav
from robustpolish.signals.readers.csv import read_csv
from robustpolish.signals.readers.hdf5 import read_hdf5
from robustpolish.signals.readers.instruments import read_tdms, read_uff
from robustpolish.signals.readers.mat import read_mat
from robustpolish.signals.readers.objects import read_object

# These two kinds of files may hold frequency responses too.
TEXT = (".csv", ".txt", ".tsv", ".dat", ".asc", ".lvm")
UNIVERSAL = (".uff", ".unv", ".uf", ".58")

_READERS: dict[str, Callable[..., RawTable]] = {
    **dict.fromkeys(TEXT, read_csv),
    ".wav": read_wav,
    **dict.fromkeys(UNIVERSAL, read_uff),
    ".mat": read_mat,
    **dict.fromkeys((".h5", ".hdf5", ".hdf"), read_hdf5),
    ".npz": read_npz,
    ".tdms": read_tdms,
}
_ONE_TABLE = (*TEXT, ".wav", *UNIVERSAL)


def raw_table(source: Any, table: str | None = None, max_bytes: float | None = None) -> RawTable:
    """Read a file or take an object apart, without any check of what is in it.

    Parameters
    ----------
    source : path, pandas or xarray object
    table : str, optional
        Matrix or group to read, in files that hold several.
    max_bytes : float, optional
        Largest size of a file and of what it unpacks to.

    Returns
    -------
    RawTable

    Raises
    ------
    InvalidInputError
        If the file is missing, damaged, empty or of an unknown kind.
    """
    found = read_object(source)
    if found is not None:
        return found
    expected, remedy = "a path, or a pandas or xarray object", "Convert it to a pandas.DataFrame."
    path = Path(instance_of("measurement", source, (str, Path), expected, remedy))
    wanted, suffix = RECORD.limited(max_bytes), path.suffix.casefold()
    if file_size(path, wanted) == 0:
        raise misfit("measurement", f"{path}, empty", "data", "Export it again.")
    if suffix not in _READERS:
        known = ", ".join(_READERS)
        want = f"one of the suffixes {known}"
        raise invalid("measurement", path.name, want, "Convert the file.")
    try:
        if suffix not in _ONE_TABLE:
            return _READERS[suffix](path, table, wanted)
        if table is None:
            return _READERS[suffix](path, wanted)
    except OSError as error:
        shown = f"{path} ({error.strerror or error})"
        raise misfit("measurement", shown, "a file that can be read", "Check it.") from None
    shown = f"{table!r} for a {suffix} file"
    raise misfit("table", shown, "no table: the file has but one", "Leave it out.")
