"""A bar for work that takes longer than two seconds; silent in tests, pipes and files."""

from __future__ import annotations

import os
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

PATIENCE = 2.0
"""Seconds after which a bar appears."""

_REFRESH = 0.5
_busy = threading.Lock()


@contextmanager
def working(what: str, total: int | None = None) -> Iterator[Callable[[str], None]]:
    """Show a bar on standard error while the block takes longer than two seconds.

    Parameters
    ----------
    what : str
        What is being done.
    total : int, optional
        Number of steps, if it is known; each is to be told. Otherwise the bar shows the time.

    Yields
    ------
    callable
        Takes a remark on the step that begins; an empty one counts the step only.

    Notes
    -----
    Only the outermost block has a bar, and only a terminal or a notebook shows one. The
    environment variable TQDM_DISABLE=1 turns bars off there too.

    Examples
    --------
    >>> with working("Adding", total=3) as tell:
    ...     for i in range(3):
    ...         tell(f"number {i}")
    """
    if not someone_looks() or not _busy.acquire(blocking=False):
        yield lambda _: None
        return
    try:
        with _Bar(what, total) as bar:
            yield bar.tell
    finally:
        _busy.release()


def someone_looks() -> bool:
    """Tell whether standard error is a terminal, or this is a notebook; never if bars are off."""
    if os.environ.get("TQDM_DISABLE", "0") not in ("", "0"):
        return False
    if sys.stderr is not None and sys.stderr.isatty():
        return True
    interactive = sys.modules.get("IPython")
    shell = interactive.get_ipython() if interactive else None
    return shell is not None and hasattr(shell, "kernel")


class _Bar:
    """Waits in a thread of its own, so that no loop needs to know of it."""

    def __init__(self, what: str, total: int | None) -> None:
        # Imported here, for the import changes the filters of warnings, which threads share. In a
        # notebook without ipywidgets it warns, and then falls back to a bar of text, which will do.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from tqdm.auto import tqdm

        self._make: Any = tqdm
        self._what, self._total = what, total
        self._steps, self._remark = 0, ""
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> _Bar:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def tell(self, remark: str) -> None:
        """Count a step and show a remark."""
        self._steps, self._remark = self._steps + 1, remark

    def _run(self) -> None:
        if self._over.wait(PATIENCE):
            return
        form = None if self._total else "{desc} {elapsed}{postfix}"
        bar: Any = self._make(total=self._total, desc=self._what, bar_format=form, leave=False)
        while True:
            if self._total:
                bar.n = min(max(self._steps - 1, 0), self._total)
            bar.set_postfix_str(self._remark, refresh=True)
            if self._over.wait(_REFRESH):
                break
        bar.close()
