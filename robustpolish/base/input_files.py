"""Files that nobody vouches for: how they are opened, how large they may be, what text may hold.

And what is said when a disk refuses to take a result.
"""

from __future__ import annotations

import errno
import os
import stat
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

from robustpolish.base.checks import Key, instance_of, misfit, positive
from robustpolish.errors import InvalidInputError, StorageError

# What is said when the disk does not take a result: one line, as for any other error.

_REMEDIES = {
    **dict.fromkeys(
        (errno.ENOSPC, errno.EDQUOT, errno.EFBIG), "Free some space, or write elsewhere."
    ),
    **dict.fromkeys(
        (errno.EACCES, errno.EPERM, errno.EROFS), "Choose a folder that you may write to."
    ),
    **dict.fromkeys((errno.ENAMETOOLONG, errno.ELOOP), "Choose another name."),
    **dict.fromkeys((errno.ENOTDIR, errno.EISDIR), "Choose another place."),
    errno.EIO: "The disk may be broken: write elsewhere.",
    errno.EMFILE: "Close other files first.",
}
"""What to do about what disks refuse; other errors of the system are left as they are."""


@contextmanager
def write_errors_as_storage_errors(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn the system's refusal to write into an error of the package.

    Parameters
    ----------
    path : path
        What is written, for the message.

    Raises
    ------
    StorageError
        If the disk is full or broken, or the place may not be written to.
    InvalidInputError
        If the name cannot be one of a file.

    Examples
    --------
    >>> import errno
    >>> with write_errors_as_storage_errors("results"):
    ...     raise OSError(errno.ENOSPC, "No space left on device")
    Traceback (most recent call last):
    ...
    robustpolish.errors.StorageError: results: not written (No space left on device). Free some...
    """
    if "\0" in os.fspath(path):
        raise misfit("out", "a name with a NUL", "a name", "Choose another name.")
    try:
        yield
    except OSError as error:
        if isinstance(error, StorageError) or error.errno not in _REMEDIES:
            raise
        raise storage_error(path, error) from None


def storage_error(path: object, error: OSError) -> StorageError:
    """Return the error for what the system did not write.

    Parameters
    ----------
    path : object
        What was written, for the message.
    error : OSError
        Of the system.

    Returns
    -------
    StorageError
    """
    remedy = _REMEDIES.get(error.errno or 0, "Write elsewhere.")
    shown = str(path)
    shown = shown if len(shown) <= 120 else f"{shown[:117]}..."
    made = StorageError(f"{shown}: not written ({error.strerror or error}). {remedy}")
    made.errno = error.errno
    return made


def is_write_error(error: OSError) -> bool:
    """Return whether it is the disk that refuses, rather than a defect of the program.

    Parameters
    ----------
    error : OSError

    Returns
    -------
    bool
    """
    return error.errno in _REMEDIES


# One way to open a file that somebody gave: regular, of bounded size, or refused at once.

_OTHERS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}
# A pipe without a writer blocks whoever opens it, a terminal may take over the process.
_FLAGS = os.O_RDONLY | sum(
    getattr(os, name, 0) for name in ("O_NONBLOCK", "O_NOCTTY", "O_CLOEXEC", "O_BINARY")
)

_SHOWN = 80
"""Characters of a long name that messages show."""


@dataclass(frozen=True)
class FileSpec:
    """What a file shall be, for the checks and their messages.

    Attributes
    ----------
    argument : str
        Name of the argument that the file was given as.
    expected, remedy : str
        What is expected there, and what to do if it is something else.
    largest : int
        In bytes, of the file and of what it unpacks to.
    """

    argument: str
    expected: str
    remedy: str
    largest: int

    def limited(self, max_bytes: float | None) -> FileSpec:
        """Return the same with another limit, if one is given.

        Parameters
        ----------
        max_bytes : float or None

        Returns
        -------
        FileSpec

        Raises
        ------
        InvalidInputError
            If the limit is not a number above zero.
        """
        if max_bytes is None:
            return self
        return replace(self, largest=int(positive("max_bytes", max_bytes)))

    def too_large(self, path: Any, size: int, packed: bool = False) -> InvalidInputError:
        """Build the error for a file of more bytes than the limit.

        Parameters
        ----------
        path : path
        size : int
            In bytes.
        packed : bool, optional
            Whether that is what the file unpacks to.

        Returns
        -------
        InvalidInputError
        """
        found = f"{Path(path).name}{', unpacked,' if packed else ''} of {size:,} bytes"
        want = f"at most {self.largest:,} bytes"
        return misfit(self.argument, found, want, "If you trust the file, raise max_bytes.")

    def refused(self, path: Any, reason: object) -> InvalidInputError:
        """Build the error for a file that is not as it should be.

        Parameters
        ----------
        path : path
        reason : object
            What is wrong with it.

        Returns
        -------
        InvalidInputError
        """
        name = str(path)
        if len(name) > _SHOWN:  # or the reason would be cut off
            name = f"{name[: _SHOWN // 2]}...{name[-_SHOWN // 2 :]}"
        return misfit(self.argument, f"{name} ({reason})", self.expected, self.remedy)


def file_size(path: Any, wanted: FileSpec) -> int:
    """Return the size of a regular file, without opening it.

    Parameters
    ----------
    path : path
    wanted : FileSpec

    Returns
    -------
    int
        In bytes.

    Raises
    ------
    InvalidInputError
        If there is none of this name, or it is a folder, pipe, device or socket.
    """
    remedy = "Pass a str or a pathlib.Path."
    instance_of(wanted.argument, path, (str, os.PathLike), "a path", remedy)
    try:
        status = os.stat(path)
    except (OSError, ValueError) as error:  # ValueError for a NUL in the name
        raise wanted.refused(path, getattr(error, "strerror", None) or error) from None
    _check_regular(path, status, wanted)
    return status.st_size


@contextmanager
def open_checked(path: Any, wanted: FileSpec) -> Iterator[BinaryIO]:
    """Open a regular file of bounded size for reading.

    Parameters
    ----------
    path : path
    wanted : FileSpec

    Yields
    ------
    binary file
        Not larger than the limit when it was opened; whoever reads asks for no more.

    Raises
    ------
    InvalidInputError
        If it cannot be opened, is no regular file or is too large.

    Examples
    --------
    >>> import os
    >>> wanted = FileSpec("path", "a file", "Check the path.", 1000)
    >>> with open_checked(os.devnull, wanted):
    ...     pass
    Traceback (most recent call last):
    ...
    robustpolish.errors.InvalidInputError: path: got /dev/null (a device), expected a file...
    """
    file_size(path, wanted)  # asked first: opening a device may move it
    try:
        descriptor = os.open(path, _FLAGS)
    except OSError as error:
        raise wanted.refused(path, error.strerror) from None
    with os.fdopen(descriptor, "rb") as file:
        status = os.fstat(descriptor)  # and asked again: it may have been exchanged since
        _check_regular(path, status, wanted)
        if status.st_size > wanted.largest:
            raise wanted.too_large(path, status.st_size)
        yield file


def content(path: Any, wanted: FileSpec) -> bytes:
    """Return the bytes of a file; see :func:`open_checked`.

    Parameters
    ----------
    path : path
    wanted : FileSpec

    Returns
    -------
    bytes

    Raises
    ------
    InvalidInputError
        As `open_checked`, and if the file grows beyond the limit while it is read.
    """
    with open_checked(path, wanted) as file:
        try:
            found = file.read(wanted.largest + 1)
        except OSError as error:
            raise wanted.refused(path, error.strerror) from None
    if len(found) > wanted.largest:
        raise wanted.too_large(path, len(found))
    return found


def text(path: Any, wanted: FileSpec, encoding: str = "utf-8") -> str:
    """Return the text of a file; see :func:`content`.

    Parameters
    ----------
    path : path
    wanted : FileSpec
    encoding : str, optional

    Returns
    -------
    str

    Raises
    ------
    InvalidInputError
        As `content`, and if it is no text in this encoding.
    """
    try:
        return content(path, wanted).decode(encoding)
    except UnicodeDecodeError:
        raise wanted.refused(path, "not text in UTF-8") from None


def _check_regular(path: Any, status: os.stat_result, wanted: FileSpec) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise wanted.refused(path, _OTHERS.get(stat.S_IFMT(status.st_mode), "no regular file"))


# What an archive says that it holds, looked at before anything is unpacked.

_MOST = 10_000
"""Members of an archive that are looked at."""


def members(file: BinaryIO, path: Any, wanted: FileSpec) -> list[zipfile.ZipInfo]:
    """Return the members of a zip archive, which together unpack to no more than is allowed.

    Python's reader stops at the size that the archive states, so that the statement binds.

    Parameters
    ----------
    file : binary file
        Opened by :func:`robustpolish.base.input_files.opened`.
    path : path
        For the message.
    wanted : FileSpec

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


# What a tree of plain values out of a file may hold.

_DEEPEST = 50
"""Tables in tables; files of the package have six."""

_LARGEST = 2**63
"""Integers from here on are written by nobody who means them, and have no place in arrays."""


def check_tree(tree: Any, where: str = "") -> None:
    r"""Refuse what later code would stumble over, wherever in the tree it stands.

    That is tables in more than 50 tables, integers that no array can hold, and text that is not
    Unicode.

    Parameters
    ----------
    tree : dict, list or plain value
        As JSON and TOML give it.
    where : str, optional
        Name of the file, for the message.

    Raises
    ------
    InvalidInputError
        With the key of the first one.

    Examples
    --------
    >>> check_tree({"dof": {"x": {"mass": 10**400}}})
    Traceback (most recent call last):
    ...
    robustpolish.errors.InvalidInputError: dof.x.mass: got an integer of 401 digits, expected...
    """
    branches: list[tuple[Key, Any]] = [((), tree)] if isinstance(tree, dict | list) else []
    while branches:
        key, node = branches.pop()
        if len(key) > _DEEPEST:
            raise _refused(where, key[:3], "tables in more than 50 tables", "fewer")
        for name, item in node.items() if isinstance(node, dict) else enumerate(node):
            if isinstance(name, str):
                _check_text(where, key, name)
            if isinstance(item, dict | list):
                branches.append(((*key, name), item))
            elif isinstance(item, str):
                _check_text(where, (*key, name), item)
            elif isinstance(item, int) and abs(item) >= _LARGEST:
                shown = f"an integer of {_digits(item)} digits"
                raise _refused(where, (*key, name), shown, "a number below 9e18")


def _digits(number: int) -> int:
    """Return how many digits an integer has; Python refuses to write those of many."""
    count = int(abs(number).bit_length() * 0.30103)
    return count + (abs(number) >= 10**count)


def _check_text(where: str, key: Key, text: str) -> None:
    try:
        if not text.isascii():
            text.encode()
    except UnicodeEncodeError:
        raise _refused(where, key, "half a character", "text in Unicode") from None


def _refused(where: str, key: Key, shown: str, expected: str) -> Exception:
    found = misfit(key or ("file",), shown, expected, "Correct it.")
    return type(found)(f"{where}: {found}", key) if where else found
