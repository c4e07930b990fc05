"""Folders of results that appear whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from robustpolish.errors import InvalidInputError
from robustpolish.validation import invalid


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
        stays as it was.

    Raises
    ------
    InvalidInputError
        If `path` exists and `force` is not set, or if it is not a folder of results.
    """
    target = Path(path)
    _check(target, force)
    target.parent.mkdir(parents=True, exist_ok=True)
    draft = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
    try:
        (draft / _MARK).write_text("Made by robustpolish; replaced as a whole by --force.\n")
        draft.chmod(0o755)
        yield draft
        _check(target, force)
        if target.exists():
            old = Path(tempfile.mkdtemp(prefix=f".{target.name}-old-", dir=target.parent))
            target.rename(old / target.name)
            draft.rename(target)
            shutil.rmtree(old)
        else:
            draft.rename(target)
    finally:
        if draft.exists():
            shutil.rmtree(draft)


_MARK = ".robustpolish"


def _check(target: Path, force: bool) -> None:
    if not target.exists():
        return
    if not force:
        remedy = "Choose another one, or replace it with --force."
        raise _refused(target, "a folder that does not exist yet", remedy)
    empty = target.is_dir() and not any(target.iterdir())
    if not empty and not (target / _MARK).is_file():
        remedy = "It holds something else and is left alone; choose another folder."
        raise _refused(target, "a folder of results made by robustpolish", remedy)


def _refused(target: Path, expected: str, remedy: str) -> InvalidInputError:
    return invalid("out", str(target), expected, remedy)


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
    """
    target = Path(path)
    if suffixes and target.suffix not in suffixes:
        raise _refused(target, f"a name that ends in {' or '.join(suffixes)}", "Rename the file.")
    if target.exists() and not force:
        remedy = "Replace it with force=True (--force)."
        raise _refused(target, "a file that does not exist yet", remedy)
    if not target.parent.is_dir():
        raise _refused(target, "a path in an existing folder", "Create the folder first.")
    with tempfile.TemporaryDirectory(prefix=f".{target.name}-", dir=target.parent) as folder:
        draft = Path(folder) / target.name
        yield draft
        draft.replace(target)


def write_file(path: str | os.PathLike[str], text: str, force: bool = False) -> None:
    """Write a text file whole or not at all; see :func:`new_file`."""
    with new_file(path, force) as draft:
        draft.write_text(text, encoding="utf-8")
