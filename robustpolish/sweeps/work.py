"""Points handed to workers in tasks of a quarter of a second, and again if a worker dies."""

from __future__ import annotations

import math
import multiprocessing
import os
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from robustpolish.errors import InvalidInputError
from robustpolish.sweeps.chunk import SECONDS, Done, Job, begin, run_chunk
from robustpolish.sweeps.outcome import Outcome
from robustpolish.validation import described, invalid

ATTEMPTS = 2
"""Workers that a point may kill while it is alone; a second time is no accident."""

_AHEAD = 2
"""Tasks per worker that are under way, so that none waits for the next."""

_UNKNOWN_WORKERS = 16
"""Taken of an executor that does not tell how many it has, as those of clusters."""

_PRELOADED = ["robustpolish.sweeps.chunk", "robustpolish.closed_loop.simulation"]
"""Modules of this package alone: those of users may change between two sweeps."""

Chunk = list[tuple[int, dict[str, Any]]]


def serially(job: Job, todo: Chunk) -> Iterator[Done]:
    """Do the points in this process, one by one."""
    for point in todo:
        yield run_chunk(job, [point])


def on_executor(job: Job, todo: Chunk, executor: Executor) -> Iterator[Done]:
    """Do the points on an executor of the caller, which stays open."""
    workers = getattr(executor, "_max_workers", None) or _UNKNOWN_WORKERS
    queue = deque(todo)
    yield from _flow(job, queue, executor, workers, {})


def on_processes(job: Job, todo: Chunk) -> Iterator[Done]:
    """Do the points in local processes, one per core that this process may use.

    When a worker dies, what was under way is done again point by point, so that only the point
    that kills its worker can fail for it.
    """
    workers = min(cores(), len(todo))
    queue, suspects = deque(todo), deque[tuple[int, dict[str, Any]]]()
    attempts: dict[int, int] = {}
    while queue or suspects:
        pool = _pool(workers)
        under_way: dict[Future[Done], Chunk] = {}
        try:
            _check_start(pool)
            while suspects:
                under_way = {pool.submit(run_chunk, job, [suspects[0]]): [suspects[0]]}
                done = next(iter(under_way)).result()
                suspects.popleft()
                under_way = {}
                yield done
            yield from _flow(job, queue, pool, workers, under_way)
        except BrokenProcessPool:
            lost = [point for chunk in under_way.values() for point in chunk]
            if suspects:
                place = suspects[0][0]
                attempts[place] = attempts.get(place, 0) + 1
                if attempts[place] >= ATTEMPTS:
                    suspects.popleft()
                    reason = f"its worker process died {ATTEMPTS} times while it ran"
                    yield Done([(place, Outcome(failure=reason))])
            else:
                suspects.extend(sorted(lost, key=lambda point: point[0]))
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _flow(
    job: Job,
    queue: deque[tuple[int, dict[str, Any]]],
    executor: Executor,
    workers: int,
    under_way: dict[Future[Done], Chunk],
) -> Iterator[Done]:
    """Keep all workers busy; what is lost when one dies stands in `under_way`."""
    size = 1
    while queue or under_way:
        while queue and len(under_way) < _AHEAD * workers:
            chunk = [queue.popleft() for _ in range(min(size, len(queue)))]
            try:
                under_way[executor.submit(run_chunk, job, chunk)] = chunk
            except BrokenProcessPool:
                queue.extendleft(reversed(chunk))
                raise
        ended = _first(list(under_way))
        for future in ended:
            done = future.result()
            count = len(under_way.pop(future))
            size = _size(count, done.seconds, len(queue), workers)
            yield done


def _first(futures: Sequence[Future[Done]]) -> list[Future[Done]]:
    ended = wait(futures, return_when=FIRST_COMPLETED).done
    # Those that were lost last, so that all that was finished is kept.
    return sorted(ended, key=lambda future: future.exception() is not None)


def _size(count: int, seconds: float, left: int, workers: int) -> int:
    """Return how many points make a task, fewer at the end so that workers end together."""
    fitting = count * SECONDS / max(seconds, 1e-9)
    return max(1, min(math.floor(fitting), 4 * count, left // (2 * _AHEAD * workers)))


def _pool(workers: int) -> ProcessPoolExecutor:
    # A fork of this process would copy locks that its threads hold. Where there is a server to
    # fork from, workers find this package imported, which takes seconds; a fresh one does it anew.
    kind = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
    context = multiprocessing.get_context(kind)
    if kind == "forkserver":
        context.set_forkserver_preload(_PRELOADED)
    return ProcessPoolExecutor(workers, context, begin)


def _check_start(pool: ProcessPoolExecutor) -> None:
    try:
        pool.submit(_nothing).result()
    except BrokenProcessPool:
        expected = "a script that can be imported, for each worker process imports it"
        remedy = (
            'Put what the script does below `if __name__ == "__main__":`, '
            'or write executor="serial".'
        )
        raise invalid("executor", described("workers that end at once"), expected, remedy) from None


def _nothing() -> None:
    """Do nothing, in a worker that has started."""


def cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return max(1, len(os.sched_getaffinity(0)))
    return os.cpu_count() or 1


def not_found(why: str) -> InvalidInputError:
    """Build the error for a function that the workers do not find."""
    expected = "a function that a worker process can import"
    remedy = 'Put it into a module (.py file), or write executor="serial".'
    return invalid("function", described(f"one with {why}"), expected, remedy)
