"""One way to open a file that somebody gave: regular, of bounded size, or refused at once."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from robustpolish.errors import InvalidInputError
from robustpolish.validation import described, instance_of, invalid, positive

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
class Wanted:
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

    def limited(self, max_bytes: float | None) -> Wanted:
        """Return the same with another limit, if one is given.

        Parameters
        ----------
        max_bytes : float or None

        Returns
        -------
        Wanted

        Raises
        ------
        InvalidInputError
            If the limit is not a number above zero.
        """
        if max_bytes is None:
            return self
        largest = int(positive("max_bytes", max_bytes))
        return Wanted(self.argument, self.expected, self.remedy, largest)

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
        shown = described(f"{_name(path)}{', unpacked,' if packed else ''} of {size:,} bytes")
        want = f"at most {self.largest:,} bytes"
        return invalid(self.argument, shown, want, "If you trust the file, raise max_bytes.")

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
        return invalid(self.argument, described(f"{name} ({reason})"), self.expected, self.remedy)


def size_of(path: Any, wanted: Wanted) -> int:
    """Return the size of a regular file, without opening it.

    Parameters
    ----------
    path : path
    wanted : Wanted

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
def opened(path: Any, wanted: Wanted) -> Iterator[BinaryIO]:
    """Open a regular file of bounded size for reading.

    Parameters
    ----------
    path : path
    wanted : Wanted

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
    >>> wanted = Wanted("path", "a file", "Check the path.", 1000)
    >>> with opened(os.devnull, wanted):
    ...     pass
    Traceback (most recent call last):
    ...
    robustpolish.errors.InvalidInputError: path: got /dev/null (a device), expected a file...
    """
    size_of(path, wanted)  # asked first: opening a device may move it
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


def content(path: Any, wanted: Wanted) -> bytes:
    """Return the bytes of a file; see :func:`opened`.

    Parameters
    ----------
    path : path
    wanted : Wanted

    Returns
    -------
    bytes

    Raises
    ------
    InvalidInputError
        As `opened`, and if the file grows beyond the limit while it is read.
    """
    with opened(path, wanted) as file:
        try:
            found = file.read(wanted.largest + 1)
        except OSError as error:
            raise wanted.refused(path, error.strerror) from None
    if len(found) > wanted.largest:
        raise wanted.too_large(path, len(found))
    return found


def text(path: Any, wanted: Wanted, encoding: str = "utf-8") -> str:
    """Return the text of a file; see :func:`content`.

    Parameters
    ----------
    path : path
    wanted : Wanted
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


def _check_regular(path: Any, status: os.stat_result, wanted: Wanted) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise wanted.refused(path, _OTHERS.get(stat.S_IFMT(status.st_mode), "no regular file"))


def _name(path: Any) -> str:
    return Path(path).name
