"""Which reader takes which file or object."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from robustpolish.files import Wanted, size_of
from robustpolish.measurements import readers
from robustpolish.measurements.raw import RECORD, RawTable
from robustpolish.validation import described, instance_of, invalid

# These two kinds of files may hold frequency responses too.
TEXT = (".csv", ".txt", ".tsv", ".dat", ".asc", ".lvm")
UNIVERSAL = (".uff", ".unv", ".uf", ".58")

_WITHOUT_TABLES: dict[str, Callable[[Path, Wanted], RawTable]] = {
    **dict.fromkeys(TEXT, readers.read_csv),
    ".wav": readers.read_wav,
    **dict.fromkeys(UNIVERSAL, readers.read_uff),
}
_WITH_TABLES: dict[str, Callable[[Path, str | None, Wanted], RawTable]] = {
    ".mat": readers.read_mat,
    ".h5": readers.read_hdf5,
    ".hdf5": readers.read_hdf5,
    ".hdf": readers.read_hdf5,
    ".npz": readers.read_npz,
    ".tdms": readers.read_tdms,
}


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
    found = readers.read_object(source)
    if found is not None:
        return found
    expected, remedy = "a path, or a pandas or xarray object", "Convert it to a pandas.DataFrame."
    path = Path(instance_of("measurement", source, (str, Path), expected, remedy))
    wanted = RECORD.limited(max_bytes)
    if size_of(path, wanted) == 0:
        raise invalid("measurement", described(f"{path}, empty"), "data", "Export it again.")
    suffix = path.suffix.casefold()
    try:
        if suffix in _WITH_TABLES:
            return _WITH_TABLES[suffix](path, table, wanted)
        if suffix in _WITHOUT_TABLES:
            if table is not None:
                shown = described(f"{table!r} for a {suffix} file")
                raise invalid("table", shown, "no table: the file has but one", "Leave it out.")
            return _WITHOUT_TABLES[suffix](path, wanted)
    except OSError as error:
        shown = described(f"{path} ({error.strerror or error})")
        raise invalid("measurement", shown, "a file that can be read", "Check it.") from None
    known = ", ".join([*_WITHOUT_TABLES, *_WITH_TABLES])
    raise invalid("measurement", path.name, f"one of the suffixes {known}", "Convert the file.")
