"""What is said when the disk does not take a result: one line, as for any other error."""

from __future__ import annotations

import errno
import functools
import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import ParamSpec

from robustpolish.errors import StorageError
from robustpolish.validation import described, invalid

P = ParamSpec("P")

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
def told_of_disk(path: str | os.PathLike[str]) -> Iterator[None]:
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
    >>> with told_of_disk("results"):
    ...     raise OSError(errno.ENOSPC, "No space left on device")
    Traceback (most recent call last):
    ...
    robustpolish.errors.StorageError: results: not written (No space left on device). Free some...
    """
    if "\0" in os.fspath(path):
        raise invalid("out", described("a name with a NUL"), "a name", "Choose another name.")
    try:
        yield
    except OSError as error:
        if isinstance(error, StorageError) or error.errno not in _REMEDIES:
            raise
        raise refusal(path, error) from None


def refusal(path: object, error: OSError) -> StorageError:
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


def is_refusal(error: OSError) -> bool:
    """Return whether it is the disk that refuses, rather than a defect of the program.

    Parameters
    ----------
    error : OSError

    Returns
    -------
    bool
    """
    return error.errno in _REMEDIES


def tells_of_disk(
    manager: Callable[P, AbstractContextManager[Path]],
) -> Callable[P, AbstractContextManager[Path]]:
    """Decorate a context manager whose first argument is what it writes; see `told_of_disk`.

    Parameters
    ----------
    manager : callable

    Returns
    -------
    callable
    """

    @contextmanager
    def told(*args: P.args, **kwargs: P.kwargs) -> Iterator[Path]:
        path = args[0] if args else kwargs["path"]
        with told_of_disk(path), manager(*args, **kwargs) as draft:  # type: ignore[arg-type]
            yield draft

    return functools.wraps(manager)(told)
