"""Drafts beside their final places: owned while their process lives, put in place at once."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import functools
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from robustpolish.base.checks import invalid
from robustpolish.base.input_files import write_errors_as_storage_errors

# Renames that replace nothing by accident, and that exchange two folders at once.

_AT_FDCWD = -100
_NOREPLACE, _EXCHANGE = 1, 2
# What kernels and file systems say that do not know the flags.
_UNKNOWN = (errno.ENOSYS, errno.EINVAL, errno.ENOTSUP)


def rename_noreplace(draft: Path, target: Path) -> None:
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
            return draft.unlink()
        except OSError as error:
            if error.errno not in (*_UNKNOWN, errno.EPERM):
                raise
    taken = FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(target))
    if os.path.lexists(target):
        raise taken
    try:
        draft.rename(target)
    except OSError as error:
        if error.errno in (errno.ENOTEMPTY, errno.ENOTDIR):  # it was put there just now
            raise taken from None
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


# Hidden folders in which results grow, and which the next run sweeps up if nobody lives in them.
#
# A stage lies beside the final place, so that a rename brings the result there at once. Its process
# holds a lock on it, which the kernel lets go whatever ends the process; who finds a stage without
# an owner removes it. Other users' stages and whatever else is there are left alone.

try:
    import fcntl
except ImportError:  # Windows: no locks on folders, and so nothing is swept up
    fcntl = None

_PREFIX = ".robustpolish-"
_NAME = re.compile(re.escape(_PREFIX) + r"[a-z0-9_]{8}")
# In a stage: the folder of the draft, what the draft has replaced, and the name that the draft is
# about to take where both cannot be exchanged at once.
_NEW, _OLD, _MANIFEST = "new", "old", "replacing"

_held: dict[Path, int | None] = {}


def _release_inherited_locks() -> None:
    """Close the locks that a forked process inherits, lest it outlives their owner with them."""
    for lock in filter(None, _held.values()):
        os.close(lock)
    _held.clear()


if fcntl is not None:
    os.register_at_fork(after_in_child=_release_inherited_locks)


@contextmanager
def stage(target: Path) -> Iterator[Path]:
    """Make a stage beside a place and remove it at the end.

    Yields
    ------
    pathlib.Path
        Where to put the draft, which does not exist yet; it has the name of `target`.
    """
    home, lock = _owned_folder(target.parent)
    _held[home] = lock
    try:
        (home / _NEW).mkdir()
        yield home / _NEW / target.name
    finally:
        if home in _held:  # it is ours, not that of the process that this one was forked from
            # What cannot be removed now is swept up by the next run.
            shutil.rmtree(home, ignore_errors=True)
            del _held[home]
            if lock is not None:
                os.close(lock)


def replace_folder(draft: Path, target: Path) -> None:
    """Put a folder in place of another one, which is then in the stage.

    Raises
    ------
    FileNotFoundError, FileExistsError
        If somebody else moved `target` meanwhile, or put something there. The draft is where it
        was.
    """
    if exchange(draft, target):
        return
    home = draft.parent.parent
    manifest, old = home / _MANIFEST, home / _OLD
    shutil.rmtree(old, ignore_errors=True)
    # Whoever finds the stage knows by it that the draft is complete and where it belongs.
    manifest.write_text(target.name, encoding="utf-8")
    try:
        target.rename(old)
    except OSError:
        manifest.unlink()
        raise
    try:
        rename_noreplace(draft, target)
    except FileExistsError:
        _finish(home)
        if draft.exists():  # otherwise the place was free again, and the draft has taken it
            raise
    finally:
        _finish(home)


def remove_stale_stages(folder: Path) -> None:
    """Remove the stages in a folder whose processes were ended, and finish what they had begun."""
    with contextlib.suppress(OSError):
        for found in sorted(folder.iterdir()):
            if _NAME.fullmatch(found.name) and found.is_dir() and not found.is_symlink():
                with contextlib.suppress(OSError):
                    _remove_stale_stage(found)


def _remove_stale_stage(home: Path) -> None:
    """Remove a stage unless it is somebody's."""
    lock = _locked(home, wait=False)
    if lock is None:
        return
    try:
        if os.fstat(lock).st_uid == os.geteuid():
            _finish(home)
            shutil.rmtree(home, ignore_errors=True)
    finally:
        os.close(lock)


def _finish(home: Path) -> None:
    """See to it that the place which a draft was about to take is not empty."""
    manifest = home / _MANIFEST
    if not manifest.is_file():
        return
    name = manifest.read_text(encoding="utf-8")
    if name != Path(name).name or name in ("", ".", ".."):
        return  # nothing that a draft is called
    target = home.parent / name
    for source in (home / _NEW / name, home / _OLD):
        if not os.path.lexists(target) and source.exists():
            with contextlib.suppress(FileExistsError):
                rename_noreplace(source, target)
    manifest.unlink()


def _owned_folder(parent: Path) -> tuple[Path, int | None]:
    """Make a stage and lock it, in the face of others who sweep."""
    while True:
        home = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=parent))
        try:
            lock = _locked(home, wait=True)
            if lock is None or os.path.samestat(os.fstat(lock), home.stat()):
                return home, lock
            os.close(lock)
        except FileNotFoundError:
            continue  # swept up before it was locked


def _locked(home: Path, wait: bool) -> int | None:
    """Open and lock a folder; None if another process holds it or folders cannot be locked."""
    if fcntl is None:
        return None
    handle = os.open(home, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except OSError:
        os.close(handle)
        return None
    return handle


# Folders of results that appear whole or not at all.


@contextmanager
def new_folder(path: str | os.PathLike[str], force: bool = False) -> Iterator[Path]:
    """Fill a folder beside its final place and move it there at the end.

    Parameters
    ----------
    path : path
        The final place. It must not exist, unless `force`.
    force : bool, optional
        Replace an existing folder, once the new one is complete. Only a folder that this
        function made before is replaced, so that a slip of the pen deletes nothing else.

    Yields
    ------
    pathlib.Path
        The folder to write to. After an exception it is removed, and what stood at `path`
        stays as it was. Of several writers with `force` the last one wins. What a process
        that was killed left beside `path` is removed by the next call.

    Raises
    ------
    InvalidInputError
        If `path` exists and `force` is not set, or if it is not a folder of results.
    StorageError
        If the disk is full, or the place may not be written to.
    """
    target = Path(path)
    with write_errors_as_storage_errors(path):
        # what a run that was ended had begun may have to be finished first
        remove_stale_stages(target.parent)
        _check(target, force)
        target.parent.mkdir(parents=True, exist_ok=True)
        with stage(target) as draft:
            draft.mkdir()
            (draft / _MARK).write_text("Made by robustpolish; replaced as a whole by --force.\n")
            yield draft
            _put(draft, target, force)


def _put(draft: Path, target: Path, force: bool) -> None:
    """Move a folder to its place, whatever other writers do meanwhile; the last one wins."""
    for _ in range(_TRIALS):
        _check(target, force)
        try:
            return (replace_folder if target.exists() else rename_noreplace)(draft, target)
        except (FileExistsError, FileNotFoundError):
            continue  # another writer was quicker
    expected = "a place that nobody else writes to all the time"
    raise invalid("out", str(target), expected, "Let one writer finish before the next begins.")


_TRIALS = 100
_MARK = ".robustpolish"


def _check(target: Path, force: bool) -> None:
    if not target.exists():
        return
    if not force:
        remedy = "Choose another one, or replace it with --force."
        raise invalid("out", str(target), "a folder that does not exist yet", remedy)
    if not _may_be_replaced(target):
        remedy = "It holds something else and is left alone; choose another folder."
        raise invalid("out", str(target), "a folder of results made by robustpolish", remedy)


def _may_be_replaced(target: Path) -> bool:
    """Whether a place is free, an empty folder or one of results, while others may replace it."""
    while True:
        try:
            before = target.stat()
            names = os.listdir(target)
            if not names or _MARK in names:
                return True
            # Another writer may have taken the folder away, and half of it, while it was read.
            if os.path.samestat(before, target.stat()):
                return False
        except FileNotFoundError:
            return True
        except NotADirectoryError:
            return False


@contextmanager
def new_file(
    path: str | os.PathLike[str], force: bool = False, suffixes: tuple[str, ...] = ()
) -> Iterator[Path]:
    """Write a file beside its final place and move it there at the end.

    Parameters
    ----------
    path : path
        The final place, in an existing folder.
    force : bool, optional
        Replace an existing file, once the new one is complete.
    suffixes : tuple of str, optional
        The endings allowed; any by default.

    Yields
    ------
    pathlib.Path
        The file to write to; it has the same ending. After an exception it is removed, and
        what stood at `path` stays as it was.

    Raises
    ------
    InvalidInputError
        If the file exists and `force` is not set, if its folder does not exist, or if its
        ending is not allowed.
    StorageError
        If the disk is full, or the place may not be written to.
    """
    target = Path(path)
    with write_errors_as_storage_errors(path):
        check_new_file(target, force, suffixes)
        with stage(target) as draft:
            yield draft
            if force:
                draft.replace(target)
                return
            try:
                rename_noreplace(draft, target)
            except FileExistsError:
                check_new_file(target)
                raise


def check_new_file(
    path: str | os.PathLike[str], force: bool = False, suffixes: tuple[str, ...] = ()
) -> None:
    """Refuse a place that :func:`new_file` would refuse, before what is to be saved is computed.

    What a run that was killed left beside it is removed, whether it is refused or not.
    """
    target = Path(path)
    remove_stale_stages(target.parent)
    if suffixes and target.suffix not in suffixes:
        expected, remedy = f"a name that ends in {' or '.join(suffixes)}", "Rename the file."
    elif target.exists() and not force:
        expected, remedy = "a file that does not exist yet", "Replace it with force=True (--force)."
    elif not target.parent.is_dir():
        expected, remedy = "a path in an existing folder", "Create the folder first."
    else:
        return
    raise invalid("out", str(target), expected, remedy)


def write_file(path: str | os.PathLike[str], text: str, force: bool = False) -> None:
    """Write a text file whole or not at all; see :func:`new_file`."""
    with new_file(path, force) as draft:
        draft.write_text(text, encoding="utf-8")
