"""Compiled functions are kept, but never after something that they were made of has changed."""

import ast
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

import robustpolish
from robustpolish.base.budget import Budget
from robustpolish.base.jit import checksum, njit

PACKAGE = Path(robustpolish.__file__).parent
CALLEE = """
from robustpolish.base.jit import njit
FACTOR = {factor}
@njit(cache=True)
def inner(x):
    return x {operation} 3.0
"""
CALLER = """
from callee import FACTOR, inner
from robustpolish.base.jit import njit
@njit(cache=True)
def outer(x):
    return FACTOR * between(x)
@njit(cache=True)
def between(x):
    return inner(x)
"""


def answer(folder):
    """Return what a new process gets from ``outer(2.0)``, and how often it had to compile."""
    program = (
        "import caller; r = caller.outer(2.0); s = caller.outer.stats; "
        "print(r, len(s.cache_misses), len(s.cache_hits))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], check=True, capture_output=True, text=True, cwd=folder,
        env={
            **os.environ,
            "PYTHONPATH": f"{folder}{os.pathsep}{PACKAGE.parent}",
            "NUMBA_CACHE_DIR": str(folder / "kept"),
            "PYTHONDONTWRITEBYTECODE": "1",
        },
    )  # fmt: skip
    result, misses, hits = done.stdout.split()
    return float(result), int(misses), int(hits)


@pytest.mark.long
def test_an_edited_callee_is_seen(tmp_path):
    (tmp_path / "caller.py").write_text(CALLER)
    callee = tmp_path / "callee.py"
    callee.write_text(CALLEE.format(factor=1.0, operation="+"))
    assert answer(tmp_path) == (5.0, 1, 0)
    assert answer(tmp_path) == (5.0, 0, 1)
    # a function that the caller's file defines below the caller calls another one now
    callee.write_text(CALLEE.format(factor=1.0, operation="*"))
    assert answer(tmp_path) == (6.0, 1, 0)
    # numbers of other files are constants of the compiled code
    callee.write_text(CALLEE.format(factor=10.0, operation="*"))
    assert answer(tmp_path) == (60.0, 1, 0)
    # and what was compiled before is still there
    callee.write_text(CALLEE.format(factor=1.0, operation="+"))
    assert answer(tmp_path) == (5.0, 0, 1)


def test_the_checksum_is_that_of_what_a_function_sees():
    from robustpolish.machines import stepper as kernel

    function = next(f.py_func for f in vars(kernel).values() if hasattr(f, "py_func"))
    assert checksum(function) == checksum(function)
    first = checksum(function)
    function.__globals__["_MADE_UP"] = 1.0
    try:
        assert checksum(function) != first
    finally:
        del function.__globals__["_MADE_UP"]
    assert checksum(function) == first


def test_what_is_not_kept_compiles_all_the_same():
    @njit(cache=False)
    def triple(x):
        return 3 * x

    assert triple(2) == 6


def test_all_compiled_functions_are_kept_that_way():
    found = 0
    for file in PACKAGE.rglob("*.py"):
        text = file.read_text()
        found += "robustpolish.base.jit import" in text
        if "numba" in text and file.name != "jit.py":
            for node in ast.walk(ast.parse(text)):
                named = isinstance(node, ast.ImportFrom) and node.module == "numba"
                assert not (named and any(alias.name in ("njit", "jit") for alias in node.names))
                assert not (isinstance(node, ast.Attribute) and node.attr in ("njit", "jit"))
    assert found > 10


def test_limits_of_time_do_not_count_what_is_compiled():
    @njit()
    def new(x):
        return x + 1.0

    budget, start = Budget(seconds=60.0), time.monotonic()
    assert new(1.0) == 2.0
    assert budget.elapsed < 0.5 * (time.monotonic() - start)
