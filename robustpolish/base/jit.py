"""Compiled functions, kept per user in files that forget nothing they were made of.

numba keeps a compiled function as long as the file of that function stays as it is, and does not
see that a function which it calls, in another file, has changed. Here the folder of the files has
a checksum in its name: of the source of the function, of all that it refers to, and of versions.
"""

from __future__ import annotations

import functools
import hashlib
import inspect
import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core import config, event

from robustpolish.base.budget import paused_clock, progress_bar
from robustpolish.base.versions import __version__

_lock = threading.RLock()
_config: Any = config  # numba sets its attributes from the environment
_PACKAGE = "robustpolish"


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function by :func:`numba.njit`; with ``cache=True``, into a file of its own.

    Examples
    --------
    >>> @njit(cache=False)
    ... def double(x):
    ...     return 2 * x
    >>> double(3)
    6
    """

    def decorated(function: Callable[..., Any]) -> Any:
        with cache_of(function):
            return numba.njit(**options)(function)

    return decorated


class _CompileListener(event.Listener):
    """Says that compiling happens once, and lets the clock of all limits stand meanwhile.

    Numba compiles in one thread at a time, and tells of the functions inside a function too.
    """

    def __init__(self) -> None:
        self._depth = 0
        self._block = ExitStack()

    def on_start(self, event: Any) -> None:
        """Begin with the outermost of the functions that are being compiled."""
        self._depth += 1
        if self._depth == 1:
            self._block.enter_context(paused_clock())
            function = getattr(event.data["dispatcher"], "py_func", None)
            if getattr(function, "__module__", "").startswith(_PACKAGE):
                self._block.enter_context(progress_bar("Compiling (once)"))

    def on_end(self, event: Any) -> None:
        """End with it."""
        del event
        self._depth -= 1
        if self._depth == 0:
            self._block.close()


event.register("numba:compile", _CompileListener())


@contextmanager
def cache_of(function: Any) -> Iterator[None]:
    """Let numba keep what is declared in this block in the folder that belongs to a function."""
    with _lock:
        before = _config.CACHE_DIR
        _config.CACHE_DIR = str(_root(before) / checksum(function))
        try:
            yield
        finally:
            _config.CACHE_DIR = before


def checksum(function: Any) -> str:
    """Return a checksum of a function's file, of all compiled code and numbers that it sees.

    Globals are constants for numba, and functions that are called become part of the caller. What
    a file sees counts as a whole, for a function may call one that is defined below it.
    """
    own = f"{sys.version} {numba.__version__} {np.__version__} {llvmlite.__version__}"
    parts = {own, _source(inspect.getfile(function))}
    _collect(function.__globals__, parts, set())
    for cell in function.__closure__ or ():
        _add("", cell.cell_contents, parts, set())
    return hashlib.sha256("\n".join(sorted(parts)).encode()).hexdigest()[:20]


def _collect(seen_names: dict[str, Any], parts: set[str], seen: set[int]) -> None:
    """Add what the globals of a file hold, once per file."""
    if id(seen_names) in seen:
        return
    seen.add(id(seen_names))
    for name, value in list(seen_names.items()):
        if not name.startswith("__"):
            _add(name, value, parts, seen)


def _add(name: str, value: Any, parts: set[str], seen: set[int]) -> None:
    """Add a number, or a compiled function with its file and all that this one sees."""
    compiled = getattr(value, "py_func", None) or getattr(value, "_defn", None)
    if isinstance(compiled, FunctionType):
        parts.add(_source(inspect.getfile(compiled)))
        _collect(compiled.__globals__, parts, seen)
    elif isinstance(value, ModuleType):
        if value.__name__.partition(".")[0] == _PACKAGE and value.__file__:
            parts.add(_source(value.__file__))
            if not hasattr(value, "__path__"):  # a package grows while others are imported
                _collect(vars(value), parts, seen)
    elif isinstance(value, tuple):
        for item in value:
            _add(name, item, parts, seen)
    elif isinstance(value, np.ndarray):
        content = hashlib.sha256(value.tobytes()).hexdigest()
        parts.add(f"{name} {value.dtype} {value.shape} {content}")
    elif isinstance(value, int | float | complex | np.generic):
        parts.add(f"{name} {value!r}")


@functools.cache
def _source(file: str) -> str:
    """Return a checksum of a file as it was when it was imported, as nearly as can be told."""
    try:
        return hashlib.sha256(Path(file).read_bytes()).hexdigest()
    except OSError:  # typed into a notebook, or in an archive
        return file


def _root(given: str) -> Path:
    """Return the folder of all compiled functions of this user and version."""
    if given:
        return Path(given) / _PACKAGE / __version__
    # without a home that can be written to, numba looks for another place
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(home, _PACKAGE, "compiled", __version__)
