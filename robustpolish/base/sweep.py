"""``sweep``: a function at every point of a grid, or at samples."""

from __future__ import annotations

import base64
import ctypes
import functools
import hashlib
import inspect
import io
import itertools
import json
import math
import multiprocessing
import operator
import os
import pickle
import re
import threading
import time
import zlib
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, nullcontext
from dataclasses import dataclass, field
from multiprocessing import connection, parent_process
from pathlib import Path
from typing import Any, BinaryIO, Literal

import control
import numpy as np
import xarray as xr

from robustpolish.base.budget import progress_bar, single_threaded_blas
from robustpolish.base.checks import invalid, misfit, whole_number

# What a function returned at one point, as named arrays that a file holds bit for bit.

RESULT = "result"
"""The variable of a function that returns a number or an array without a name."""

Named = dict[str, tuple[tuple[str, ...], np.ndarray]]


@dataclass(frozen=True)
class Outcome:
    """The result of a point, or why there is none.

    Attributes
    ----------
    values, coords : dict of str to (tuple of str, ndarray)
        Variables and their coordinates with their dimensions.
    failure : str
        The reason why the point has none; empty if it has.
    """

    values: Named = field(default_factory=dict)
    coords: Named = field(default_factory=dict)
    failure: str = ""

    def to_json(self) -> dict[str, Any]:
        """Return what a line of JSON holds."""
        if self.failure:
            return {"failure": self.failure}
        return {"values": _written(self.values), "coords": _written(self.coords)}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Outcome:
        """Read what :meth:`to_json` wrote."""
        if "failure" in data:
            return cls(failure=data["failure"])
        return cls(_read(data["values"]), _read(data["coords"]))

    @property
    def form(self) -> tuple[Any, ...]:
        """Names, dimensions, shapes and coordinates, in which all points have to agree."""
        shapes = {name: (dims, array.shape) for name, (dims, array) in self.values.items()}
        coords = [(name, d, a.dtype.str, a.tobytes()) for name, (d, a) in self.coords.items()]
        return shapes, sorted(coords)


def outcome_of(returned: Any, taken: Collection[str]) -> Outcome:
    """Sort what a function returned into variables; `taken` are names that points have.

    Raises
    ------
    TypeError, ValueError
        If it is none of what a sweep can hold; the sweep records that as the point's failure.
    """
    coords: Named = {}
    if isinstance(returned, xr.DataArray):
        returned = returned.to_dataset(name=str(returned.name or RESULT))
    if isinstance(returned, xr.Dataset):
        coords = {str(name): _labelled(name, returned[name]) for name in returned.coords}
        returned = dict(returned.data_vars)
    variables = returned if isinstance(returned, Mapping) else {RESULT: returned}
    values: Named = {str(name): _labelled(name, value) for name, value in variables.items()}
    names = {*values, *coords, *(dim for dims, _ in values.values() for dim in dims)}
    if double := sorted(names & set(taken)):
        raise ValueError(f"returned the name {double[0]!r}, which a parameter of the sweep has")
    return Outcome(values, coords)


def _labelled(name: Any, value: Any) -> tuple[tuple[str, ...], np.ndarray]:
    """Return dimensions and values; those of a bare array are called after its name."""
    array = np.asarray(value)
    if array.dtype.kind not in "biufcUmM":
        what = type(value).__name__
        raise TypeError(f"returned {what} as {name!r}; numbers, text and arrays can be kept")
    labelled = isinstance(value, xr.DataArray)
    dims = map(str, value.dims) if labelled else (f"{name}_{i}" for i in range(array.ndim))
    return tuple(dims), np.ascontiguousarray(array).reshape(array.shape)


def _written(named: Named) -> dict[str, Any]:
    return {
        name: [dims, a.dtype.str, a.shape, base64.b64encode(a.tobytes()).decode("ascii")]
        for name, (dims, a) in named.items()
    }


def _read(data: Mapping[str, Any]) -> Named:
    return {
        name: (tuple(dims), np.ndarray(shape, np.dtype(kind), base64.b64decode(text)))
        for name, (dims, kind, shape, text) in data.items()
    }


# What a worker does: a few points one after the other, each with its own random numbers.

Chunk = list[tuple[int, dict[str, Any]]]
"""Points with their places."""

SECONDS = 0.25
"""Work that a task should hold: a thousand times what it costs to send it."""

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
"""Names of settings in malloc.h of the GNU C library (mallopt(3))."""
_KEPT = 1 << 28
"""Bytes up to which a worker keeps what it has freed."""


ChunkResult = tuple[list[tuple[int, Outcome]], float]
"""Finished points, and the seconds that they took."""


@single_threaded_blas
def run_chunk(
    function: Callable[..., Any] | bytes, seed: int, taken: Collection[str], chunk: Chunk
) -> ChunkResult:
    """Call a function, pickled for other processes, at some points, given with their places.

    Raises
    ------
    InvalidInputError
        If the worker does not find the function.
    """
    try:
        found = _loaded(function) if isinstance(function, bytes) else function
    except Exception as error:
        expected = "a function that a worker process can import"
        remedy = 'Put it into a module (.py file), or write executor="serial".'
        why = f"one with {type(error).__name__}: {error}"
        raise misfit("function", why, expected, remedy) from None
    start, takes_rng = time.perf_counter(), _takes_rng(found)
    finished = []
    for i, point in chunk:
        # The i-th of SeedSequence(seed).spawn(...), without making the others.
        own = np.random.SeedSequence(seed, spawn_key=(i,))
        rng = {"rng": np.random.default_rng(own)} if takes_rng else {}
        try:
            finished.append((i, outcome_of(found(**point, **rng), taken)))
        except Exception as error:
            finished.append((i, Outcome(failure=f"{type(error).__name__}: {error}")))
    return finished, time.perf_counter() - start


@functools.lru_cache(maxsize=1)
def _loaded(function: bytes) -> Callable[..., Any]:
    return pickle.loads(function)


def prepare_worker() -> None:
    """Prepare this process to work for another one, its parent.

    It ends when its parent is killed, for which it would wait for ever, and it keeps large arrays
    that it has freed for the next point.

    The C library would give each back to the system and ask for a new one, page by page: half of
    the time of a loop of 100,000 samples, and a time in which processes wait for each other. A C
    library without this setting goes on as it did.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if os.name == "posix" else None
    if mallopt is not None:
        for parameter in (_TRIM_THRESHOLD, _MMAP_THRESHOLD):
            mallopt(parameter, _KEPT)
    parent = parent_process()

    def watch() -> None:
        if parent is not None:
            connection.wait([parent.sentinel])
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


# The points of a sweep: every combination of a grid's values, or samples one by one.

SAMPLE = "sample"
FAILURE = "failure"


@dataclass(frozen=True)
class Points:
    """Points in their order, the last name of a grid fastest.

    Attributes
    ----------
    each : list of dict
        The arguments of every point, as numbers, truth values and text of Python.
    dims : tuple of str
        The dimensions that the points span.
    shape : tuple of int
        Their lengths.
    coords : dict of str to (tuple of str, ndarray)
        The parameters over these dimensions.
    """

    each: list[dict[str, Any]]
    dims: tuple[str, ...]
    shape: tuple[int, ...]
    coords: dict[str, tuple[tuple[str, ...], np.ndarray]]

    @property
    def text(self) -> str:
        """All of it as text, every number to the last bit, for a checksum."""
        return json.dumps([self.dims, self.shape, self.each])


def read_points(points: Any) -> Points:
    """Read a grid (mapping of names to values) or samples (mappings, or a Dataset)."""
    if isinstance(points, Mapping) and not isinstance(points, xr.Dataset):
        if not points:
            raise invalid("points", points, "at least one name", 'Write {"gain": [1, 2, 3]}.')
        values = {name: _column(name, given) for name, given in points.items()}
        each = _points_of(values, itertools.product(*(c.tolist() for c in values.values())))
        coords = {name: ((name,), column) for name, column in values.items()}
        return Points(each, tuple(values), tuple(map(len, values.values())), coords)
    if isinstance(points, xr.Dataset):
        if len(points.dims) != 1 or not points.data_vars:
            remedy = "Give each parameter as a variable over one dimension, the sample."
            raise invalid("points", dict(points.sizes), "a Dataset with one dimension", remedy)
        shape = tuple(points.sizes.values())
        given = {str(name): np.broadcast_to(points[name], shape) for name in points.data_vars}
    elif isinstance(points, Sequence) and not isinstance(points, str) and len(points) > 0:
        for i, sample in enumerate(points):
            if not isinstance(sample, Mapping) or set(sample) != set(points[0]):
                remedy = "Give every sample a value of every parameter."
                raise invalid(("points", i), sample, "a mapping with the first one's names", remedy)
        if not points[0]:
            raise invalid("points", points, "at least one name", 'Write [{"gain": 1.0}].')
        given = {name: [sample[name] for sample in points] for name in points[0]}
    else:
        expected = "a mapping of names to values, a sequence of mappings or a Dataset, not empty"
        raise invalid("points", points, expected, 'Write {"gain": [1, 2, 3]}, for example.')
    columns = {name: _column(name, values, (SAMPLE,)) for name, values in given.items()}
    each = _points_of(columns, zip(*(c.tolist() for c in columns.values()), strict=True))
    coords = {name: ((SAMPLE,), column) for name, column in columns.items()}
    return Points(each, (SAMPLE,), (len(each),), coords)


def _points_of(names: Collection[str], values: Iterable[Any]) -> list[dict[str, Any]]:
    return [dict(zip(names, point, strict=True)) for point in values]


def _column(name: Any, values: Any, taken: tuple[str, ...] = ()) -> np.ndarray:
    """Return the values of one parameter as an array of numbers, truth values or text."""
    reserved = (FAILURE, "rng", *taken)
    if not isinstance(name, str) or not name.isidentifier() or name in reserved:
        expected = f"a name of an argument, none of {', '.join(reserved)}"
        raise invalid(("points", str(name)), name, expected, "Rename the parameter.")
    try:
        column = np.array(values if isinstance(values, np.ndarray) else list(values))
    except (TypeError, ValueError):
        column = np.empty(0, dtype=object)
    if column.ndim != 1 or column.size == 0 or column.dtype.kind not in "bifuU":
        remedy = "Bind anything else to the function by functools.partial, or sweep its index."
        raise invalid(("points", name), values, "real numbers, truth values or text", remedy)
    if column.dtype.kind == "f" and not all(math.isfinite(value) for value in column):
        raise invalid(("points", name), values, "finite numbers", "Leave the others out.")
    return column


# Outcomes of all points as one Dataset over the parameters.


def assemble_dataset(points: Points, outcomes: Mapping[int, Outcome]) -> xr.Dataset:
    """Return one Dataset; points that do not have the first one's form count as failures."""
    count = len(points.each)
    failures = [outcomes[i].failure for i in range(count)]
    good = [i for i in range(count) if not failures[i]]
    form = outcomes[good[0]].form if good else ()
    for i in good[1:]:
        if outcomes[i].form != form:
            failures[i] = (
                f"ValueError: names, shapes or coordinates differ from those of point {good[0]}"
            )
    good = [i for i in good if not failures[i]]
    variables: Named = {}
    coords = dict(points.coords)
    if good:
        first = outcomes[good[0]]
        coords |= first.coords
        for name, (dims, _) in first.values.items():
            stacked = np.stack([outcomes[i].values[name][1] for i in good])
            if len(good) < count:
                stacked = _with_gaps(stacked, good, count)
            shape = points.shape + stacked.shape[1:]
            variables[name] = (*points.dims, *dims), stacked.reshape(shape)
    reasons = np.array(failures, dtype=object).astype(str).reshape(points.shape)
    return xr.Dataset({**variables, FAILURE: (points.dims, reasons)}, coords)


def _with_gaps(values: np.ndarray, good: list[int], count: int) -> np.ndarray:
    """Return values at all points: nan, not a time or empty text where there is none."""
    if values.dtype.kind in "biu":
        values = values.astype(float)
    blank = {"U": "", "m": "NaT", "M": "NaT"}.get(values.dtype.kind, np.nan)
    kept = np.full((count, *values.shape[1:]), blank, values.dtype)
    kept[good] = values
    return kept


# The file of a sweep: a line per finished point, which a kill can only tear at the end.

FORMAT = "robustpolish sweep 1"


class SweepRecord:
    """Finished points, appended to a file as they come.

    Parameters
    ----------
    path : path
        The file; made if it does not exist, continued if it is of the same sweep.
    checksum : str
        Of function, points and seed.
    count : int
        Number of points.

    Notes
    -----
    The first line names format, checksum and count. Each line begins with the CRC-32 of the
    rest. A last line without its end, or with another CRC, was torn by a kill and is cut off.
    """

    def __init__(self, path: str | os.PathLike[str], checksum: str, count: int) -> None:
        self.path = Path(path)
        if not self.path.parent.is_dir():
            remedy = "Create the folder first."
            raise invalid("file", str(self.path), "a path in an existing folder", remedy)
        head = {"format": FORMAT, "checksum": checksum, "count": count}
        self.found = self._read(head) if self.path.exists() else {}
        self._file: BinaryIO = self.path.open("ab")
        if not self.path.stat().st_size:
            self._write([head])

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def add(self, finished: list[tuple[int, Outcome]]) -> None:
        """Append points; they are with the operating system when this returns."""
        self._write([{"point": i, **outcome.to_json()} for i, outcome in finished])

    def _write(self, entries: list[dict]) -> None:
        self._file.writelines(map(_line, entries))
        self._file.flush()

    def _read(self, head: dict[str, Any]) -> dict[int, Outcome]:
        """Return the points that the file holds, and cut off a torn end."""
        content = self.path.read_bytes()
        if _line(head)[:-1].startswith(content):  # empty, or a first line that was torn
            os.truncate(self.path, 0)
            return {}
        lines = content.splitlines(keepends=True)
        entries = [_entry(line) for line in lines]
        if entries[0] == head and entries[-1] is None:
            os.truncate(self.path, len(content) - len(lines[-1]))
            entries.pop()
        if entries[0] is None or entries[0].get("format") != FORMAT:
            why = "holds something else"
        elif entries[0] != head:
            why = "holds another function, other points or another seed"
        elif None in entries:
            why = f"is damaged in line {entries.index(None) + 1}"
        else:
            return {entry["point"]: Outcome.from_json(entry) for entry in entries[1:] if entry}
        remedy = f"Choose another file, or delete {self.path} to start anew."
        raise misfit("file", f"one that {why}", "a file of this sweep", remedy)


def _line(entry: dict[str, Any]) -> bytes:
    text = json.dumps(entry).encode()
    return b"%08x %s\n" % (zlib.crc32(text), text)


def _entry(line: bytes) -> dict | None:
    code, _, text = line.rstrip(b"\n").partition(b" ")
    if not line.endswith(b"\n") or code != b"%08x" % zlib.crc32(text):
        return None
    return json.loads(text)


# A function as bytes for other processes, with the systems of control that are bound to it.

_GENERATED = re.compile(r"sys\[\d+\]")
"""Names that control counts up: they depend on what else a process has made."""


def as_bytes(value: Any) -> bytes:
    """Pickle a function and what is bound to it.

    State-space systems and read-only mappings, which pickle refuses, are taken apart: a plant or a
    controller can be bound to a function, and the same matrices give the same bytes everywhere.

    Raises
    ------
    Exception
        Whatever pickle has to say about a value that no other process could build.
    """
    stream = io.BytesIO()
    _Pickler(stream, protocol=5).dump(value)
    return stream.getvalue()


class _Pickler(pickle.Pickler):
    def reducer_override(self, obj: Any) -> Any:
        if type(obj) is not control.StateSpace:
            return NotImplemented
        matrices = [np.ascontiguousarray(M) for M in (obj.A, obj.B, obj.C, obj.D)]
        labels = {"inputs": obj.input_labels, "outputs": obj.output_labels}
        name = {} if _GENERATED.fullmatch(obj.name) else {"name": obj.name}
        return _state_space, (matrices, obj.dt, {**labels, "states": obj.state_labels, **name})


def _state_space(matrices: list[np.ndarray], dt: Any, labels: dict[str, Any]) -> Any:
    return control.StateSpace(*matrices, dt, remove_useless_states=False, **labels)


# Points handed to workers in tasks of a quarter of a second, and again if a worker dies.
#
# joblib would not do here: it takes no executor of the caller, such as that of a Dask client; when
# a worker dies it ends the whole call and does not tell which points were lost; and each of its
# workers imports this package anew, where a server to fork from does so once.

ATTEMPTS = 2
"""Workers that a point may kill while it is alone; a second time is no accident."""

_AHEAD = 2
"""Tasks per worker that are under way, so that none waits for the next."""

_UNKNOWN_WORKERS = 16
"""Taken of an executor that does not tell how many it has, as those of clusters."""

_PRELOADED = ["robustpolish.base.sweep", "robustpolish.closed_loop.simulate"]
"""Modules of this package alone: those of users may change between two sweeps."""

Work = Callable[[Chunk], ChunkResult]


def run_on_processes(work: Work, todo: Chunk) -> Iterator[ChunkResult]:
    """Do the points in local processes, one per core that this process may use.

    When a worker dies, what was under way is done again point by point, so that only the point
    that kills its worker can fail for it.
    """
    workers = min(cores(), len(todo))
    queue, suspects = deque(todo), deque[tuple[int, dict[str, Any]]]()
    attempts = Counter[int]()
    while queue or suspects:
        pool = _pool(workers)
        under_way: dict[Future[ChunkResult], Chunk] = {}
        try:
            _check_start(pool)
            while suspects:
                done = pool.submit(work, [suspects[0]]).result()
                suspects.popleft()
                yield done
            yield from _flow(work, queue, pool, workers, under_way)
        except BrokenProcessPool:
            if suspects:
                place, _ = suspects[0]
                attempts[place] += 1
                if attempts[place] >= ATTEMPTS:
                    suspects.popleft()
                    reason = f"its worker process died {ATTEMPTS} times while it ran"
                    yield [(place, Outcome(failure=reason))], 0.0
            else:
                lost = itertools.chain.from_iterable(under_way.values())
                suspects.extend(sorted(lost, key=operator.itemgetter(0)))
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _flow(
    work: Work,
    queue: deque[tuple[int, dict[str, Any]]],
    executor: Executor,
    workers: int,
    under_way: dict[Future[ChunkResult], Chunk],
) -> Iterator[ChunkResult]:
    """Keep all workers busy; what is lost when one dies stands in `under_way`."""
    size = 1
    while queue or under_way:
        while queue and len(under_way) < _AHEAD * workers:
            chunk = [queue.popleft() for _ in range(min(size, len(queue)))]
            try:
                under_way[executor.submit(work, chunk)] = chunk
            except BrokenProcessPool:
                queue.extendleft(reversed(chunk))
                raise
        ended = wait(under_way, return_when=FIRST_COMPLETED).done
        # Those that were lost last, so that all that was finished is kept.
        for future in sorted(ended, key=lambda future: future.exception() is not None):
            done = future.result()
            count = len(under_way.pop(future))
            # Fewer points at the end make a task, so that workers end together.
            fitting = math.floor(count * SECONDS / max(done[1], 1e-9))
            size = max(1, min(fitting, 4 * count, len(queue) // (2 * _AHEAD * workers)))
            yield done


def _pool(workers: int) -> ProcessPoolExecutor:
    # A fork of this process would copy locks that its threads hold. Where there is a server to
    # fork from, workers find this package imported, which takes seconds; a fresh one does it anew.
    kind = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
    context = multiprocessing.get_context(kind)
    if kind == "forkserver":
        context.set_forkserver_preload(_PRELOADED)
    return ProcessPoolExecutor(workers, context, prepare_worker)


def _check_start(pool: ProcessPoolExecutor) -> None:
    try:
        pool.submit(bool).result()
    except BrokenProcessPool:
        expected = "a script that can be imported, for each worker process imports it"
        remedy = (
            'Put what the script does below `if __name__ == "__main__":`, '
            'or write executor="serial".'
        )
        raise misfit("executor", "workers that end at once", expected, remedy) from None


def cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return max(1, len(os.sched_getaffinity(0)))
    return os.cpu_count() or 1


def sweep(
    function: Callable[..., Any],
    points: Mapping[str, Any] | Sequence[Mapping[str, Any]] | xr.Dataset,
    *,
    executor: Executor | Literal["serial"] | None = None,
    file: str | os.PathLike[str] | None = None,
    seed: int = 0,
    progress: bool = True,
) -> xr.Dataset:
    """Call a function at many points, on all cores or on a cluster.

    Parameters
    ----------
    function : callable
        Takes a point's parameters by name, in whatever units the caller counts them. If it has
        a parameter `rng`, it gets a ``numpy.random.Generator`` of its own at every point.
        Returns a number, text, an array, a mapping of names to these, or labelled data of xarray.
    points : mapping, sequence of mappings or xarray.Dataset
        A grid: values of each parameter, of which every combination is a point. Or samples: one
        mapping per point, or a Dataset with one dimension. Values are numbers, truth values or
        text; anything else is bound to the function by ``functools.partial``.
    executor : concurrent.futures.Executor or "serial", optional
        Who does the work: local processes by default, one per core that this process may use.
        ``client.get_executor()`` of a Dask client is one. ``"serial"`` is this process, for
        lambdas and functions of a notebook, which other processes cannot import.
    file : path, optional
        Where finished points are kept. If it exists already, the sweep goes on from there.
    seed : int, optional
        Of the random numbers, at least zero. Those of a point depend on it and on the place of
        the point only, never on workers or their order.
    progress : bool, optional
        Show a bar in terminals and notebooks.

    Returns
    -------
    xarray.Dataset
        Results over the parameters of a grid, or over ``sample``; an unnamed result is
        ``result``. ``failure`` holds the reason why a point has no result, else "". Where some
        have none, results are nan there (whole numbers and truth values become real numbers).

    Raises
    ------
    InvalidInputError
        If points or seed are none, if workers cannot import the function, or if `file` is of
        another function, other points or another seed.

    Notes
    -----
    A point that raises, or whose results have another shape than the first one's, is a failure
    and stops nothing. When a local worker dies, what was under way is done again; a point that
    kills its worker twice is a failure. Linear algebra runs on one thread per worker. In
    scripts, a sweep on processes stands below ``if __name__ == "__main__":``.

    `file` recognises a function by its name, its source and its bound arguments, but not the
    functions that it calls: delete the file after changing these. One process at a time may
    write to it.

    Examples
    --------
    >>> import robustpolish as rp
    >>> def overshoot(damping):
    ...     return np.exp(-np.pi * damping / np.sqrt(1 - damping**2))
    >>> import numpy as np
    >>> found = rp.sweep(overshoot, {"damping": [0.1, 0.5, 2.0]}, executor="serial")
    >>> found.result.values.round(3).tolist()
    [0.729, 0.163, nan]
    >>> rp.sweep(lambda k: 1 / k, {"k": [0, 2]}, executor="serial").failure.values.tolist()
    ['ZeroDivisionError: division by zero', '']
    """
    asked = read_points(points)
    if not callable(function):
        raise invalid("function", function, "a function", "Give the function to be called.")
    seed = whole_number("seed", seed, 0, remedy="Write seed=0.")
    if executor is not None and executor != "serial" and not isinstance(executor, Executor):
        remedy = "Of a Dask client, give client.get_executor()."
        raise invalid("executor", executor, 'None, "serial" or an executor', remedy)
    here = executor == "serial" or isinstance(executor, ThreadPoolExecutor)
    pickled = b"" if here and file is None else _pickled(function)
    sent = function if here else pickled
    work = functools.partial(run_chunk, sent, seed, (*asked.coords, *asked.dims, FAILURE))
    record = None
    if file is not None:
        record = SweepRecord(file, _checksum(function, pickled, asked, seed), len(asked.each))
    with closing(record) if record else nullcontext():
        outcomes = dict(record.found) if record else {}
        todo = [(i, point) for i, point in enumerate(asked.each) if i not in outcomes]
        bar = progress_bar("Sweeping", len(todo)) if progress else nullcontext(lambda _: None)
        with bar as tell:
            for finished, _ in _results(work, todo, executor):
                if record:
                    record.add(finished)
                for i, outcome in finished:
                    outcomes[i] = outcome
                    tell("")
    return assemble_dataset(asked, outcomes)


def _results(work: Work, todo: Chunk, executor: Any) -> Iterator[ChunkResult]:
    """Yield results in this process, in local processes, or of an executor, which stays open."""
    if executor == "serial":
        return (work([point]) for point in todo)
    if executor is None:
        return run_on_processes(work, todo)
    workers = getattr(executor, "_max_workers", None) or _UNKNOWN_WORKERS
    return _flow(work, deque(todo), executor, workers, {})


def _takes_rng(function: Callable[..., Any]) -> bool:
    try:
        return "rng" in inspect.signature(function).parameters
    except (TypeError, ValueError):  # some compiled functions have none
        return False


def _pickled(function: Callable[..., Any]) -> bytes:
    try:
        return as_bytes(function)
    except Exception as error:
        # Other processes import a function by its name; a lambda has none to be found by.
        expected = "a function with a name in a module, which workers and files can find"
        remedy = f'Put it into a module, or write executor="serial" without file= ({error}).'
        raise invalid("function", function, expected, remedy) from None


def _checksum(function: Any, pickled: bytes, points: Points, seed: int) -> str:
    while isinstance(function, functools.partial):
        function = function.func
    try:
        source = inspect.getsource(function)
    except (OSError, TypeError):
        source = ""
    text = "\n".join([points.text, str(seed), source])
    return hashlib.sha256(pickled + text.encode()).hexdigest()
