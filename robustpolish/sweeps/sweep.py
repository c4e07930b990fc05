"""``sweep``: a function at every point of a grid, or at samples."""

from __future__ import annotations

import functools
import hashlib
import inspect
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import nullcontext
from typing import Any, Literal

import xarray as xr

from robustpolish.long_calls import working
from robustpolish.sweeps.assembled import assembled
from robustpolish.sweeps.chunk import Done, Job
from robustpolish.sweeps.outcome import Outcome
from robustpolish.sweeps.points import FAILURE, Points, read_points
from robustpolish.sweeps.record import Record
from robustpolish.sweeps.sent import as_bytes
from robustpolish.sweeps.work import not_found, on_executor, on_processes, serially
from robustpolish.validation import invalid, is_whole


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
    if not is_whole(seed) or seed < 0:
        raise invalid("seed", seed, "a whole number, at least zero", "Write seed=0.")
    seed = int(seed)
    if executor is not None and executor != "serial" and not isinstance(executor, Executor):
        remedy = "Of a Dask client, give client.get_executor()."
        raise invalid("executor", executor, 'None, "serial" or an executor', remedy)
    here = executor == "serial" or isinstance(executor, ThreadPoolExecutor)
    pickled = None if here and file is None else _pickled(function)
    sent = function if here or pickled is None else pickled
    job = Job(sent, seed, _takes_rng(function), (*asked.coords, *asked.dims, FAILURE))
    identity = _checksum(function, pickled, asked, seed) if pickled is not None else ""
    record = Record(file, identity, len(asked.each)) if file is not None else None
    with record or nullcontext():
        outcomes = dict(record.found) if record else {}
        todo = [(i, point) for i, point in enumerate(asked.each) if i not in outcomes]
        bar = working("Sweeping", len(todo)) if progress else nullcontext(_silent)
        with bar as tell:
            for done in _work(job, todo, executor):
                if done.unknown:
                    raise not_found(done.unknown)
                if record:
                    record.add(done.finished)
                _collect(done, outcomes, tell)
    return assembled(asked, outcomes)


def _work(job: Job, todo: list, executor: Any) -> Any:
    if executor == "serial":
        return serially(job, todo)
    return on_processes(job, todo) if executor is None else on_executor(job, todo, executor)


def _collect(done: Done, outcomes: dict[int, Outcome], tell: Callable[[str], None]) -> None:
    for i, outcome in done.finished:
        outcomes[i] = outcome
        tell("")


def _silent(_: str) -> None:
    """Show nothing."""


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
