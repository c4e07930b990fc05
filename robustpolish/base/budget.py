"""Work budgets, deadlines, single-threaded linear algebra and progress bars of long calls.

A search counts its work and asks its budget. A certificate has no budget: it is complete, or there
is none. So it is cut by an error, and what was not proven is never returned.
"""

from __future__ import annotations

import functools
import math
import os
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, nullcontext
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any, ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

from robustpolish.errors import SolverError

# What long calls share: a budget of work, a clock, the cores, a bar.
#
# Linear algebra runs on one thread, what is independent on all cores.
#
# Work is counted, so that every machine gives the same answer; seconds are a safety net only. They
# leave out those in which other programs have the processor, and those in which functions are
# compiled, once per user and version: what a call finds must not depend on whether the machine is
# busy, or it happens to be the first one. The bar is silent in tests, pipes and files.

Arguments = ParamSpec("Arguments")
Item = TypeVar("Item")
Result = TypeVar("Result")

WORK = 1e5
"""Steps that one design may take, as norms of small loops; a second has a thousand or two of them.

Within a minute on an idle machine: AC3, the mixed designs of 12 states and a bound on the gain of
the brush's plant need most of it, one program for 40 states 15 000."""

_lock = threading.Lock()
_limit = ExitStack()
_open_blas_blocks = 0
_clock = threading.Lock()
_last, _seconds, _paused = (0.0, 0.0), 0.0, False


def now() -> float:
    """Return the seconds on the clock of all limits; only differences mean something.

    It stands while the process and its children get no processor, so that no limit depends on what
    else the machine does; with several threads at work it goes as a clock on the wall.

    Examples
    --------
    >>> before = now()
    >>> now() >= before
    True
    """
    global _last, _seconds
    with _clock:
        children = os.times()  # those that have ended
        worked = time.process_time() + children.children_user + children.children_system
        wall = time.monotonic()
        if not _paused:
            _seconds += max(0.0, min(wall - _last[0], worked - _last[1]))
        _last = wall, worked
        return _seconds


@contextmanager
def paused_clock() -> Iterator[None]:
    """Let the clock stand in the block, for all threads; blocks do not overlap or nest.

    Examples
    --------
    >>> with paused_clock():
    ...     before = now()
    ...     now() == before
    True
    """
    global _paused
    now()
    _paused = True
    try:
        yield
    finally:
        now()
        _paused = False


def step_cost(states: int) -> float:
    """Return the work of one step on matrices of this size, in steps on small ones.

    A step is a dense factorisation or what costs as much. On few states it is all
    overhead; on many it grows with the cube.

    Examples
    --------
    >>> step_cost(0), step_cost(40)
    (1.0, 9.0)
    """
    return 1.0 + (states / 20.0) ** 3


@dataclass
class Budget:
    """Work that may be spent, with seconds as a safety net only.

    What a search does may depend on :attr:`exhausted`, which is the same on every machine. That
    the safety net was reached (:attr:`late`) has to be said in status and message.

    Parameters
    ----------
    work : float
        Steps, each weighted by :func:`step_cost`; infinite for no limit.
    seconds : float
        The safety net; infinite for none.
    kept : float
        Seconds of it that are kept for what follows the search.

    Examples
    --------
    >>> budget = Budget(10.0)
    >>> half = budget.share(0.5)
    >>> half.spend(5.0)
    >>> half.exhausted, budget.exhausted, budget.work_left
    (True, False, 5.0)
    """

    work: float = math.inf
    seconds: float = math.inf
    kept: float = 0.0
    spent: float = field(default=0.0, init=False)
    _parent: Budget | None = field(default=None, init=False, repr=False)
    _start: float = field(default_factory=now, init=False, repr=False)
    _late: bool = field(default=False, init=False, repr=False)

    def spend(self, work: float = 1.0) -> None:
        """Count work, here and in the budgets that this one is a share of."""
        self.spent += work
        if self._parent is not None:
            self._parent.spend(work)

    def share(self, part: float) -> Budget:
        """Return a budget for a part of the work that is left, under the same safety net."""
        own = Budget(part * self.work_left, self.seconds, self.kept)
        own._parent, own._start = self, self._start
        return own

    @classmethod
    def with_certificate_reserve(cls, work: float, seconds: float) -> Budget:
        """Return a budget that keeps a quarter of the time, at most 5 s, for the certificate."""
        return cls(work, seconds, min(5.0, seconds / 4))

    @property
    def work_left(self) -> float:
        """Work that may still be done, at least zero."""
        left = max(0.0, self.work - self.spent)
        return left if self._parent is None else min(left, self._parent.work_left)

    @property
    def exhausted(self) -> bool:
        """Whether the work is done; the same on every machine."""
        return self.work_left <= 0

    @property
    def late(self) -> bool:
        """Whether the safety net was reached; once it was, that stays so."""
        self.update_late()
        return self._late

    def update_late(self) -> None:
        """Look at the clock, after a call that ends with the safety net by itself."""
        reached: Budget | None = self
        if not self._late and self.elapsed >= self.seconds - self.kept:
            while reached is not None:
                reached._late, reached = True, reached._parent

    @property
    def was_late(self) -> bool:
        """Whether a search has seen that it was late, and so may have ended for that reason."""
        return self._late

    @property
    def over(self) -> bool:
        """Whether to stop, for whichever reason."""
        return self.exhausted or self.late

    @property
    def elapsed(self) -> float:
        """Seconds since the start, without those in which functions were compiled."""
        return now() - self._start

    @property
    def seconds_left(self) -> float:
        """Seconds until the safety net, at least zero."""
        return max(0.0, self.seconds - self.kept - self.elapsed)


def single_threaded_blas(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Run the linear algebra of `function` on one thread, so that no sum changes its order.

    From about 100 rows on, OpenBLAS shares the work of solving equations and finding eigenvalues
    among threads, and rounds differently for every number of them. The matrices of control
    problems are too small to gain by it.

    Examples
    --------
    >>> import numpy as np
    >>> @single_threaded_blas
    ... def largest(M):
    ...     return float(np.linalg.norm(M, 2))
    >>> largest([[3.0]])
    3.0
    """
    return _one_thread()(function)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Limit linear algebra to one thread until the last of the blocks that overlap is done."""
    global _open_blas_blocks
    with _lock:
        if _open_blas_blocks == 0:
            _limit.enter_context(_libraries().limit(limits=1, user_api="blas"))
        _open_blas_blocks += 1
    try:
        yield
    finally:
        with _lock:
            _open_blas_blocks -= 1
            if _open_blas_blocks == 0:
                _limit.close()


@functools.cache
def _libraries() -> ThreadpoolController:
    """Find the libraries of linear algebra that are loaded, once, for it takes milliseconds."""
    return ThreadpoolController()


def parallel_map(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Return what a function gives for each item, in their order; threads run several at a time.

    Worth it where compiled loops or linear algebra take most of the time, and of the same bits on
    any number of cores as long as `function` does not change what the items share.

    Examples
    --------
    >>> parallel_map(abs, [-2, 1])
    [2, 1]
    """
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(function, items))


PROGRESS_DELAY = 2.0
"""Seconds after which a bar appears."""

_REFRESH = 0.5
_bar_lock = threading.Lock()
_staged_bars: list[_Bar] = []
"""The bar of a block that names its stages, if there is one."""


@contextmanager
def progress_bar(
    what: str, total: int | None = None, stages: bool = False
) -> Iterator[Callable[[str], None]]:
    """Show a bar on standard error while the block takes longer than two seconds.

    Parameters
    ----------
    what : str
        What is being done.
    total : int, optional
        Number of steps, if it is known; each is to be told. Otherwise the bar shows the time.
    stages : bool, optional
        Whether what blocks inside are doing is shown as stages of this one; not by default.

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
    >>> with progress_bar("Adding", total=3) as tell:
    ...     for i in range(3):
    ...         tell(f"number {i}")
    """
    if not is_interactive():
        yield lambda _: None
    elif not _bar_lock.acquire(blocking=False):
        with _staged_bars[0].stage(what) if _staged_bars else nullcontext(lambda _: None) as tell:
            yield tell
    else:
        try:
            with _Bar(what, total) as bar:
                _staged_bars[:] = [bar] if stages else []
                yield bar.tell
        finally:
            _staged_bars.clear()
            _bar_lock.release()


def is_interactive() -> bool:
    """Tell whether standard error is a terminal, or this is a notebook; never if bars are off."""
    if os.environ.get("TQDM_DISABLE", "0") not in ("", "0"):
        return False
    return (sys.stderr is not None and sys.stderr.isatty()) or _in_notebook()


def _in_notebook() -> bool:
    interactive = sys.modules.get("IPython")
    return interactive is not None and hasattr(interactive.get_ipython(), "kernel")


class _Bar:
    """Waits in a thread of its own, so that no loop needs to know of it."""

    def __init__(self, what: str, total: int | None) -> None:
        from tqdm import tqdm  # not for those who only import the package

        self._make: Any = tqdm
        self._file: Any = _NotebookLine() if _in_notebook() else sys.stderr
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

    @contextmanager
    def stage(self, name: str) -> Iterator[Callable[[str], None]]:
        """Show a name while a block inside runs, with what it has to say."""
        before, self._remark = self._remark, name

        def tell(remark: str) -> None:
            self._remark = f"{name}: {remark}" if remark else name

        try:
            yield tell
        finally:
            self._remark = before

    def _run(self) -> None:
        if self._over.wait(PROGRESS_DELAY):
            return
        form = None if self._total else "{desc} {elapsed}{postfix}"
        bar: Any = self._make(
            total=self._total, desc=self._what, bar_format=form, leave=False, file=self._file,
            **_size_if_unknown(self._file),
        )  # fmt: skip
        bar.start_t -= PROGRESS_DELAY  # the time that is shown is that of the work
        while True:
            if self._total:
                bar.n = min(max(self._steps - 1, 0), self._total)
            bar.set_postfix_str(self._remark, refresh=True)
            if self._over.wait(_REFRESH):
                break
        bar.close()


def _size_if_unknown(file: Any) -> dict[str, int]:
    """Return the usual size for a terminal that says it has none, as some serial lines do.

    The bar would take it at its word and stay away; any other size it finds by itself.
    """
    try:
        size = os.get_terminal_size(file.fileno())
    except (AttributeError, OSError, ValueError):
        return {}  # no terminal
    return {} if all(size) else {"ncols": 80, "nrows": 24}


class _NotebookLine:
    """A file to which bars are written: text that begins with a return replaces what is shown.

    On standard error a notebook would keep a red strip for every bar that was.
    """

    encoding = "utf-8"

    def __init__(self) -> None:
        self._shown = ""
        self._output: Any = None

    def write(self, text: str) -> int:
        """Show a text instead of the one before; blanks take it away."""
        line = text.strip()
        if text and line != self._shown:
            self._shown = line
            self._show({"text/plain": line} if line else {"text/html": "", "text/plain": ""})
        return len(text)

    def flush(self) -> None:
        """Do nothing: what is written is shown at once."""

    def _show(self, data: dict[str, str]) -> None:
        if self._output is None:
            from IPython.display import display

            self._output = display(data, raw=True, display_id=True)
        else:
            self._output.update(data, raw=True)


GRACE = 0.5
"""Seconds beyond its limit that a call may take for a proof that is nearly complete."""

_deadline: ContextVar[float] = ContextVar("until", default=math.inf)


class DeadlineError(SolverError):
    """The time of a call was over before its result was proven."""


@contextmanager
def enforce_deadline(budget: Budget, grace: float | None = None) -> Iterator[None]:
    """Cut what the block proves some time after the safety net of a budget is reached.

    Parameters
    ----------
    budget : Budget
    grace : float, optional
        That time, in seconds; :data:`GRACE` by default.

    Raises
    ------
    SolverError
        If :func:`check_deadline` was called in the block after that.

    Examples
    --------
    >>> from robustpolish.base.budget import Budget
    >>> with enforce_deadline(Budget(seconds=10.0)):
    ...     check_deadline()
    """
    ends = now() + budget.seconds - budget.elapsed + (GRACE if grace is None else grace)
    token = _deadline.set(min(_deadline.get(), ends))
    try:
        yield
    except DeadlineError:
        raise SolverError(
            f"The time limit of {budget.seconds:g} s was reached before the controller that was "
            "found had a complete certificate. Raise time_limit."
        ) from None
    finally:
        _deadline.reset(token)


@contextmanager
def partial_deadline(part: float) -> Iterator[None]:
    """Leave the block a part of the time that is left, so that something else can follow it."""
    begins = now()
    token = _deadline.set(begins + part * (_deadline.get() - begins))
    try:
        yield
    finally:
        _deadline.reset(token)


def check_deadline(needed: float = 0.0) -> None:
    """Raise an error if the time is over, or less than the seconds that are needed is left.

    To be called before every step that cannot be cut; a few microseconds outside of calls that
    have to end.
    """
    if deadline_passed(needed):
        raise DeadlineError("The time was over before the proof was complete.")


def deadline_passed(needed: float = 0.0) -> bool:
    """Return whether the time is over, for what may end with as much as it has proven."""
    return now() + needed > _deadline.get()
