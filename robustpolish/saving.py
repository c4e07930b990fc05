"""Folders of results that appear whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from robustpolish.drafts.stage import put_instead, put_new, stage, sweep
from robustpolish.errors import InvalidInputError
from robustpolish.files import tells_of_disk
from robustpolish.validation import invalid


@tells_of_disk
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
    sweep(target.parent)  # what a run that was ended had begun may have to be finished first
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
            if target.exists():
                put_instead(draft, target)
            else:
                put_new(draft, target)
        except (FileExistsError, FileNotFoundError):
            continue  # another writer was quicker
        return
    remedy = "Let one writer finish before the next begins."
    raise _refused(target, "a place that nobody else writes to all the time", remedy)


_TRIALS = 100
_MARK = ".robustpolish"


def _check(target: Path, force: bool) -> None:
    if not target.exists():
        return
    if not force:
        remedy = "Choose another one, or replace it with --force."
        raise _refused(target, "a folder that does not exist yet", remedy)
    if not _may_be_replaced(target):
        remedy = "It holds something else and is left alone; choose another folder."
        raise _refused(target, "a folder of results made by robustpolish", remedy)


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


def _refused(target: Path, expected: str, remedy: str) -> InvalidInputError:
    return invalid("out", str(target), expected, remedy)


@tells_of_disk
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
    check_new_file(target, force, suffixes)
    with stage(target) as draft:
        yield draft
        if force:
            draft.replace(target)
            return
        try:
            put_new(draft, target)
        except FileExistsError:
            raise _file_exists(target) from None


def check_new_file(
    path: str | os.PathLike[str], force: bool = False, suffixes: tuple[str, ...] = ()
) -> None:
    """Refuse a place that :func:`new_file` would refuse, before what is to be saved is computed.

    What a run that was killed left beside it is removed, whether it is refused or not.
    """
    target = Path(path)
    sweep(target.parent)
    if suffixes and target.suffix not in suffixes:
        raise _refused(target, f"a name that ends in {' or '.join(suffixes)}", "Rename the file.")
    if target.exists() and not force:
        raise _file_exists(target)
    if not target.parent.is_dir():
        raise _refused(target, "a path in an existing folder", "Create the folder first.")


def _file_exists(target: Path) -> InvalidInputError:
    remedy = "Replace it with force=True (--force)."
    return _refused(target, "a file that does not exist yet", remedy)


def write_file(path: str | os.PathLike[str], text: str, force: bool = False) -> None:
    """Write a text file whole or not at all; see :func:`new_file`."""
    with new_file(path, force) as draft:
        draft.write_text(text, encoding="utf-8")
