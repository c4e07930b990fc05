"""The same bits on any number of threads."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from contextlib import ExitStack
from typing import ParamSpec, TypeVar

import numpy.linalg  # noqa: F401 the libraries that are looked up below have to be loaded
import scipy.linalg  # noqa: F401
from threadpoolctl import ThreadpoolController

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")

_lock = threading.Lock()
_limit = ExitStack()
_inside = 0


def same_bits(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Run the linear algebra of `function` on one thread, so that no sum changes its order.

    From about 100 rows on, OpenBLAS shares the work of solving equations and finding eigenvalues
    among threads, and rounds differently for every number of them. The matrices of control
    problems are too small to gain by it.

    Examples
    --------
    >>> import numpy as np
    >>> @same_bits
    ... def largest(M):
    ...     return float(np.linalg.norm(M, 2))
    >>> largest([[3.0]])
    3.0
    """

    @functools.wraps(function)
    def on_one_thread(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        _enter()
        try:
            return function(*args, **kwargs)
        finally:
            _leave()

    return on_one_thread


def _enter() -> None:
    global _inside
    with _lock:
        if _inside == 0:
            _limit.enter_context(_libraries().limit(limits=1, user_api="blas"))
        _inside += 1


def _leave() -> None:
    """Give the threads back when the last of the calls that overlap is done."""
    global _inside
    with _lock:
        _inside -= 1
        if _inside == 0:
            _limit.close()


@functools.cache
def _libraries() -> ThreadpoolController:
    """Find the libraries of linear algebra that are loaded, once, for it takes milliseconds."""
    return ThreadpoolController()
