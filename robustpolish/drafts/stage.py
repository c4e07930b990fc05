"""Hidden folders in which results grow, and which the next run sweeps up if nobody lives in them.

A stage lies beside the final place, so that a rename brings the result there at once. Its process
holds a lock on it, which the kernel lets go whatever ends the process; who finds a stage without
an owner removes it. Other users' stages and whatever else is there are left alone.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from robustpolish.drafts.renames import exchange, rename_new

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


def _let_go() -> None:
    """Close the locks that a forked process inherits, lest it outlives their owner with them."""
    for lock in filter(None, _held.values()):
        os.close(lock)
    _held.clear()


if fcntl is not None:
    os.register_at_fork(after_in_child=_let_go)


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


def put_new(draft: Path, target: Path) -> None:
    """Put a draft where nothing is; `FileExistsError` if something is there after all."""
    rename_new(draft, target)


def put_instead(draft: Path, target: Path) -> None:
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
        rename_new(draft, target)
    except FileExistsError:
        _finish(home)
        if draft.exists():  # otherwise the place was free again, and the draft has taken it
            raise
    finally:
        _finish(home)


def sweep(folder: Path) -> None:
    """Remove the stages in a folder whose processes were ended, and finish what they had begun."""
    with contextlib.suppress(OSError):
        for found in sorted(folder.iterdir()):
            if _NAME.fullmatch(found.name) and found.is_dir() and not found.is_symlink():
                _swept(found)


def _swept(home: Path) -> None:
    """Remove a stage unless it is somebody's."""
    with contextlib.suppress(OSError):
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
                rename_new(source, target)
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
