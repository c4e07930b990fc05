"""What a worker does: a few points one after the other, each with its own random numbers."""

from __future__ import annotations

import ctypes
import functools
import os
import pickle
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing import connection, parent_process
from typing import Any

import numpy as np

from robustpolish.long_calls import same_bits
from robustpolish.sweeps.outcome import Outcome, outcome_of

SECONDS = 0.25
"""Work that a task should hold: a thousand times what it costs to send it."""

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
"""Names of settings in malloc.h of the GNU C library (mallopt(3))."""
_KEPT = 1 << 28
"""Bytes up to which a worker keeps what it has freed."""


@dataclass(frozen=True)
class Job:
    """What all points of a sweep share.

    Attributes
    ----------
    function : callable or bytes
        Pickled, if other processes are to call it.
    seed : int
        Of the sweep; that of a point follows from it and from the point's place.
    takes_rng : bool
        Whether the function asks for random numbers.
    taken : tuple of str
        Names that variables of results must not have.
    """

    function: Callable[..., Any] | bytes
    seed: int
    takes_rng: bool
    taken: tuple[str, ...]


@dataclass(frozen=True)
class Done:
    """Finished points and what they took; `unknown` says why the function was not found."""

    finished: list[tuple[int, Outcome]]
    seconds: float = 0.0
    unknown: str = ""


@same_bits
def run_chunk(job: Job, chunk: Sequence[tuple[int, dict[str, Any]]]) -> Done:
    """Call the function at some points, given with their places."""
    try:
        function = _loaded(job.function) if isinstance(job.function, bytes) else job.function
    except Exception as error:
        return Done([], unknown=f"{type(error).__name__}: {error}")
    start = time.perf_counter()
    finished = [(i, _run(job, function, i, point)) for i, point in chunk]
    return Done(finished, time.perf_counter() - start)


def _run(job: Job, function: Callable[..., Any], i: int, point: dict[str, Any]) -> Outcome:
    own: dict[str, Any] = dict(point)
    if job.takes_rng:
        # The i-th of SeedSequence(seed).spawn(...), without making the others.
        own["rng"] = np.random.default_rng(np.random.SeedSequence(job.seed, spawn_key=(i,)))
    try:
        return outcome_of(function(**own), job.taken)
    except Exception as error:
        return Outcome(failure=f"{type(error).__name__}: {error}")


@functools.lru_cache(maxsize=1)
def _loaded(function: bytes) -> Callable[..., Any]:
    return pickle.loads(function)


def begin() -> None:
    """Prepare this process to work for another one, its parent."""
    _keep_memory()
    _end_with_parent()


def _keep_memory() -> None:
    """Let this worker keep large arrays that it has freed, for the next point.

    The C library would give each back to the system and ask for a new one, page by page: half of
    the time of a loop of 100,000 samples, and a time in which processes wait for each other. A C
    library without this setting goes on as it did.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if os.name == "posix" else None
    if mallopt is not None:
        for parameter in (_TRIM_THRESHOLD, _MMAP_THRESHOLD):
            mallopt(parameter, _KEPT)


def _end_with_parent() -> None:
    """End this worker when the process that started it is killed; it would wait for ever."""
    parent = parent_process()
    if parent is None:
        return

    def watch() -> None:
        connection.wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
