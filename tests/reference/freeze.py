"""Freeze the answers of the package, or check that they are as they were.

``python -m tests.reference.freeze [subject ...]`` writes them into the folder ``answers``, and how
long each took into ``timings.json``. ``python -m tests.reference.freeze --check [subject ...]``
computes them anew and prints every difference; the exit code is 1 if there is any. Equal means
equal to the bit, unless there is a ``--tolerance``. Only public names, the command line and files
are used, so that modules may move. ``--list`` tells the subjects; long ones are left out unless
they are named, or asked for by ``--all``.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import resource
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import matplotlib as mpl

import robustpolish as rp

from .plain import differences, leaves, plain
from .subjects import SUBJECTS, Subject

HERE = Path(__file__).parent
ANSWERS = HERE / "answers"
TIMINGS = HERE / "timings.json"
MACHINE = HERE / "environment.json"
LIBRARIES = ("numpy", "scipy", "control", "cvxpy", "clarabel", "slycot", "numba", "picos", "cvxopt")


def environment() -> dict[str, str]:
    """Return what the last bits of numbers depend on, besides the package."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        processor = next(line.split(":")[1].strip() for line in lines if line[:10] == "model name")
    except (OSError, StopIteration):
        processor = platform.processor()
    found = {"python": platform.python_version(), "processor": processor}
    return found | {name: version(name) for name in LIBRARIES}


def seconds_of_processor() -> float:
    """Return the processor's seconds of this process and of those that it has waited for."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def answer(call: Callable[[], Any]) -> Any:
    """Return what a call says: its answer or error, and the warnings of the package."""
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        try:
            found = plain(call())
        except Exception as error:
            found = {"error": type(error).__name__, "message": str(error)}
            if not isinstance(error, rp.RobustPolishError):
                found["unexpected"] = True
    told = sorted({str(w.message) for w in seen if issubclass(w.category, rp.RobustPolishWarning)})
    return {"answer": found, "warnings": told} if told else found


def measure(name: str, subject: Subject, only: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the answers of a subject, and for each the seconds by the clock and the processor.

    Only those with a certain text in their names.
    """
    answers, timings = {}, {}
    home = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)  # so that names of files in messages are the same each time
        try:
            for case, call in subject.cases():
                if only not in case:
                    continue
                clock, processor = time.perf_counter(), seconds_of_processor()
                answers[case] = answer(call)
                timings[case] = {
                    "clock": round(time.perf_counter() - clock, 3),
                    "processor": round(seconds_of_processor() - processor, 3),
                }
                print(f"  {name}: {case}, {timings[case]['processor']:.1f} s", flush=True)
        finally:
            os.chdir(home)
    return answers, timings


def stored(file: Path) -> dict[str, Any]:
    """Return the content of a file of ours, nothing if there is none."""
    return json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}


def write(file: Path, content: Any) -> None:
    """Write a file of ours."""
    file.parent.mkdir(exist_ok=True)
    file.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def chosen(names: Iterable[str]) -> dict[str, Subject]:
    """Return the subjects that are asked for and whose data are here."""
    found = {name: SUBJECTS[name] for name in names}
    absent = [name for name, subject in found.items() if not subject.available()]
    if absent:
        print(f"Left out, their data are not here: {', '.join(absent)}")
    return {name: subject for name, subject in found.items() if name not in absent}


def freeze(names: Iterable[str], only: str = "") -> int:
    """Write the answers; an error that is not of the package is told, and the exit code is 1."""
    code = 0
    for name, subject in chosen(names).items():
        answers, timings = measure(name, subject, only)
        for path, _ in leaves(answers):
            if path[-1] == "unexpected":
                print(f"{name} / {' / '.join(path)}: {answers[path[0]]}")
                code = 1
        if only:
            answers = stored(ANSWERS / f"{name}.json") | answers
            timings = stored(TIMINGS).get(name, {}) | timings
        write(ANSWERS / f"{name}.json", answers)
        write(TIMINGS, dict(sorted((stored(TIMINGS) | {name: timings}).items())))
        write(MACHINE, environment())
    return code


def check(names: Iterable[str], tolerance: float | None = None, only: str = "") -> int:
    """Print every difference; the exit code is 1 if there is any."""
    told = environment()
    changed = [f"{key} {was} -> {told[key]}" for key, was in stored(MACHINE).items()
               if told.get(key) != was]  # fmt: skip
    if changed:
        print(f"Another environment, bits may differ: {', '.join(changed)}")
    count = 0
    for name, subject in chosen(names).items():
        answers, timings = measure(name, subject, only)
        before = {k: v for k, v in stored(ANSWERS / f"{name}.json").items() if only in k}
        found = differences(before, json.loads(json.dumps(answers)), tolerance)
        found = [line for line in found if not subject.allowed(line)]
        was, now = (
            sum(t["processor"] for case, t in timing.items() if only in case)
            for timing in (stored(TIMINGS).get(name, {}), timings)
        )
        print(f"{name}: {len(found)} differences, {now:.1f} s of the processor (was {was:.1f} s)")
        for line in found:
            print(f"  {name} / {line}")
        count += len(found)
    return int(count > 0)


def main() -> int:
    """Do what the command line says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("subjects", nargs="*", metavar="subject")
    parser.add_argument("--check", action="store_true", help="compare instead of writing")
    parser.add_argument("--tolerance", type=float, help="relative, instead of equal to the bit")
    parser.add_argument("--all", action="store_true", help="the long subjects, too")
    parser.add_argument("--only", default="", metavar="TEXT", help="answers with it in their names")
    parser.add_argument("--list", action="store_true", help="tell the subjects")
    given = parser.parse_args()
    unknown = set(given.subjects) - set(SUBJECTS)
    if unknown:
        parser.error(f"no subject {', '.join(sorted(unknown))}; there are {', '.join(SUBJECTS)}")
    if given.list:
        for name, subject in SUBJECTS.items():
            spent = sum(t["processor"] for t in stored(TIMINGS).get(name, {}).values())
            print(f"{name:12s} {spent:6.1f} s  {subject.about}{' (long)' * subject.long}")
        return 0
    names = given.subjects or [n for n, s in SUBJECTS.items() if given.all or not s.long]
    mpl.use("Agg")
    if given.check:
        return check(names, given.tolerance, given.only)
    return freeze(names, given.only)


if __name__ == "__main__":
    sys.exit(main())
