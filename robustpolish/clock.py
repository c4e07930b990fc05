"""The clock of all limits of time: seconds, without those in which functions are compiled.

Functions are compiled once per user and version. What a call finds within its limit must not
depend on whether it happens to be the first one.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

_stood = 0.0
_stands_since: float | None = None


def now() -> float:
    """Return the seconds on the clock; only differences mean something.

    Examples
    --------
    >>> before = now()
    >>> now() >= before
    True
    """
    return (time.monotonic() if _stands_since is None else _stands_since) - _stood


@contextmanager
def standing() -> Iterator[None]:
    """Let the clock stand in the block, for all threads; blocks do not overlap or nest.

    Examples
    --------
    >>> with standing():
    ...     before = now()
    ...     now() == before
    True
    """
    global _stands_since, _stood
    _stands_since = start = time.monotonic()
    try:
        yield
    finally:
        _stood += time.monotonic() - start
        _stands_since = None
