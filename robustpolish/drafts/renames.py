"""Renames that replace nothing by accident, and that exchange two folders at once."""

from __future__ import annotations

import ctypes
import errno
import functools
import os
from collections.abc import Callable
from pathlib import Path

_AT_FDCWD = -100
_NOREPLACE, _EXCHANGE = 1, 2
# What kernels and file systems say that do not know the flags.
_UNKNOWN = (errno.ENOSYS, errno.EINVAL, errno.ENOTSUP)


def rename_new(draft: Path, target: Path) -> None:
    """Rename a file or a folder to a name that nothing has.

    Raises
    ------
    FileExistsError
        If something has it.
    """
    if _renameat2(draft, target, _NOREPLACE):
        return
    if draft.is_file():
        try:
            os.link(draft, target)
        except OSError as error:
            if error.errno not in (*_UNKNOWN, errno.EPERM):
                raise
        else:
            draft.unlink()
            return
    if os.path.lexists(target):
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(target))
    try:
        draft.rename(target)
    except OSError as error:
        if error.errno in (errno.ENOTEMPTY, errno.ENOTDIR):  # it was put there just now
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(target)) from None
        raise


def exchange(draft: Path, target: Path) -> bool:
    """Exchange two folders at once; False where kernel or file system cannot.

    Raises
    ------
    FileNotFoundError
        If one of them is gone.
    """
    return _renameat2(draft, target, _EXCHANGE)


def _renameat2(source: Path, target: Path, flags: int) -> bool:
    """Call the kernel; False if it does not know the call or the flags."""
    call = _system_call()
    if call is None:
        return False
    if call(_AT_FDCWD, os.fsencode(source), _AT_FDCWD, os.fsencode(target), flags) == 0:
        return True
    number = ctypes.get_errno()
    if number in _UNKNOWN:
        return False
    raise OSError(number, os.strerror(number), str(source), None, str(target))


@functools.cache
def _system_call() -> Callable[..., int] | None:
    """Find the call, which Linux has."""
    try:
        call = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError, TypeError):
        return None
    call.argtypes = (ctypes.c_int, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_uint)
    return call
