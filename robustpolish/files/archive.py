"""What an archive says that it holds, looked at before anything is unpacked."""

from __future__ import annotations

import zipfile
from typing import Any, BinaryIO

from robustpolish.files.given import Wanted

_MOST = 10_000
"""Members of an archive that are looked at."""


def members(file: BinaryIO, path: Any, wanted: Wanted) -> list[zipfile.ZipInfo]:
    """Return the members of a zip archive, which together unpack to no more than is allowed.

    Python's reader stops at the size that the archive states, so that the statement binds.

    Parameters
    ----------
    file : binary file
        Opened by :func:`robustpolish.files.opened`.
    path : path
        For the message.
    wanted : Wanted

    Returns
    -------
    list of zipfile.ZipInfo

    Raises
    ------
    InvalidInputError
        If they are too large together.
    zipfile.BadZipFile
        If it is no archive.
    """
    with zipfile.ZipFile(file) as archive:
        found = archive.infolist()
    if len(found) > _MOST:
        raise wanted.refused(path, f"{len(found)} members")
    size = sum(info.file_size for info in found)
    if size > wanted.largest:
        raise wanted.too_large(path, size, packed=True)
    return found
