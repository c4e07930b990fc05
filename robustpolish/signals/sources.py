"""Which reader takes which file or object."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from robustpolish.base.checks import described, instance_of, invalid
from robustpolish.base.input_files import FileSpec, file_size
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

_WITHOUT_TABLES: dict[str, Callable[[Path, FileSpec], RawTable]] = {
    **dict.fromkeys(TEXT, read_csv),
    ".wav": read_wav,
    **dict.fromkeys(UNIVERSAL, read_uff),
}
_WITH_TABLES: dict[str, Callable[[Path, str | None, FileSpec], RawTable]] = {
    ".mat": read_mat,
    ".h5": read_hdf5,
    ".hdf5": read_hdf5,
    ".hdf": read_hdf5,
    ".npz": read_npz,
    ".tdms": read_tdms,
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
    found = read_object(source)
    if found is not None:
        return found
    expected, remedy = "a path, or a pandas or xarray object", "Convert it to a pandas.DataFrame."
    path = Path(instance_of("measurement", source, (str, Path), expected, remedy))
    wanted = RECORD.limited(max_bytes)
    if file_size(path, wanted) == 0:
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
