"""Calls that end in time even if the code they call does not."""

from __future__ import annotations

import contextlib
import os
import pickle
import select
import signal
import time
import warnings
from collections.abc import Callable
from typing import Any

from robustpolish.errors import RobustPolishError
from robustpolish.synthesis.backends.parent_watch import end_with

# Longer waits may exceed what the system's clock can hold.
_A_DAY = 86400.0


def run_limited(call: Callable[[], Any], seconds: float) -> Any:
    """Run `call` in a process of its own and end it after some seconds.

    Solvers look at the clock between iterations at best, and one iteration on a large
    problem can take minutes. The process ends with this one, too, whatever ends it.

    Parameters
    ----------
    call : callable
        Without arguments; what it returns has to be picklable.
    seconds : float
        Where processes cannot be forked (Windows), `call` runs here and without this limit.

    Returns
    -------
    object or None
        What it returned; None if it was ended or failed.

    Raises
    ------
    RobustPolishError
        If `call` raised it.

    Examples
    --------
    >>> run_limited(lambda: 6 * 7, 10.0)
    42
    """
    if not hasattr(os, "fork"):
        return call()
    reader, writer = os.pipe()
    watched, life = os.pipe()
    parent = os.getpid()
    with warnings.catch_warnings():
        # Python warns of threads that hold locks; the child computes, answers and ends.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        os.close(reader)
        os.close(life)
        os.setpgid(0, 0)

        def watched_call() -> Any:
            end_with(parent, watched)
            return call()

        _answer(watched_call, writer)
    os.close(writer)
    os.close(watched)
    try:
        answer = _read(reader, time.monotonic() + seconds)
    finally:
        os.close(reader)
        _end(child)
        os.close(life)
    if isinstance(answer, RobustPolishError):
        raise answer
    return answer


def _end(child: int) -> None:
    """End the child and the processes that it started, which are of its group."""
    for kill in (os.killpg, os.kill):  # a child ended at once has no group of its own yet
        with contextlib.suppress(ProcessLookupError):
            kill(child, signal.SIGKILL)
    os.waitpid(child, 0)


def _answer(call: Callable[[], Any], writer: int) -> None:
    """Compute in the child, write the answer and end without any clean-up of the parent's."""
    try:
        try:
            data = pickle.dumps(call())
        except RobustPolishError as error:
            data = pickle.dumps(error)
        while data:
            data = data[os.write(writer, data) :]
    finally:
        os._exit(0)


def _read(reader: int, until: float) -> Any:
    data = b""
    while True:
        left = until - time.monotonic()
        if not select.select([reader], [], [], min(max(0.0, left), _A_DAY))[0]:
            return None
        piece = os.read(reader, 1 << 20)
        if not piece:
            break
        data += piece
    return pickle.loads(data) if data else None
