"""Damaged files of every kind, read as users read them: `python -m tests.fuzz.files --count N`.

A crash is whatever is neither a result nor an error of the package, a process that dies or takes
too much memory, and a call that takes longer than its limit. Case i of a seed is the same on every
machine: `--first i --count 1 --keep FOLDER` writes it down.
"""

from __future__ import annotations

import argparse
import os
import pickle
import random
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import robustpolish as rp
from robustpolish.signals.frequency_response import holds_frequency_response
from tests.fuzz.files_corpus import Corpus, corpus
from tests.fuzz.files_mutations import mutated

SECONDS = 10
"""That reading a small file may take, on a machine that does other things too."""

MEMORY = 3 << 30
"""Bytes of address space that reading a small file may add."""


def _load(path: Path) -> object:
    found = rp.load(path)
    again = found.to_toml() if isinstance(found, rp.MechanicalModel) else None
    return repr(found), again


def _task(path: Path) -> object:
    task = rp.read_design_task(path)
    return task.plant, task.weighted


def _response(path: Path) -> object:
    return holds_frequency_response(path), rp.read_frequency_response(path)


def _mould(path: Path) -> object:
    if path.suffix == ".csv":
        return rp.polishing.Mould.from_csv(path, unit="mm")
    return rp.polishing.Mould.from_stl(path, unit="mm")


def _path(path: Path) -> object:
    timed = b"t" in path.read_bytes()[:20]
    return rp.polishing.ToolPath.from_csv(path, unit="mm", speed=None if timed else 0.02)


READERS: dict[str, Callable[[Path], Any]] = {
    "load": _load,
    "task": _task,
    "record": lambda path: repr(rp.read_measurement(path)),
    "response": _response,
    "mould": _mould,
    "path": _path,
}


@dataclass
class Report:
    """What came of a run.

    Attributes
    ----------
    read : collections.Counter
        Cases by kind of file that ended in a result.
    refused : collections.Counter
        Cases by kind of file that ended in an error of the package.
    crashes : list of (int, str, str)
        Number of the case, kind of file, what happened.
    slowest : tuple of (float, int)
        Seconds of CPU, and the case.
    """

    read: Counter[str] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)
    crashes: list[tuple[int, str, str]] = field(default_factory=list)
    slowest: tuple[float, int] = (0.0, -1)

    @property
    def count(self) -> int:
        """Cases in all."""
        return self.read.total() + self.refused.total() + len(self.crashes)

    def take(self, case: int, name: str, what: str, seconds: float) -> None:
        """Add a case."""
        self.slowest = max(self.slowest, (seconds, case))
        if what in ("read", "refused"):
            getattr(self, what)[name] += 1
        else:
            self.crashes.append((case, name, what))


def case_of(seed: int, i: int, files: Corpus) -> tuple[str, bytes]:
    """Return case i of a seed: the name of what was damaged, and the damaged content."""
    chance = random.Random(f"{seed} {i}")
    name = chance.choice(list(files))
    kind = name.rpartition(".")[2]
    others = [content for other, content in files.items() if other.endswith(kind)]
    return name, mutated(chance, name, files[name], others)


def outcome(name: str, content: bytes, folder: Path) -> str:
    """Read a content as its name says; "read", "refused" or what went wrong."""
    path = folder / f"case{Path(name).suffix}"
    path.write_bytes(content)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            READERS[name.partition("/")[0]](path)
    except rp.RobustPolishError:
        return "refused"
    except BaseException as error:
        return f"{type(error).__name__}: {str(error)[:100]} <- {_places(error)}"
    return "read"


def _places(error: BaseException) -> str:
    """Return the last lines of our own, and the very last."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if "/robustpolish/" in f.filename][-2:]
    return ", ".join(f"{Path(f.filename).name}:{f.lineno} {f.name}" for f in [*own, frames[-1]])


def run(seed: int, cases: range, files: Corpus, seconds: float | None = None) -> Report:
    """Read the cases of a seed, each in a process that may die of it.

    Parameters
    ----------
    seed : int
    cases : range
    files : mapping
    seconds : float, optional
        Wall clock after which no further case is begun.

    Returns
    -------
    Report
    """
    report, first = Report(), cases.start
    end = None if seconds is None else time.monotonic() + seconds
    while first < cases.stop:
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reading)
            _child(seed, range(first, cases.stop), files, writing, end)
        os.close(writing)
        begun = None
        with os.fdopen(reading, "rb") as stream:
            for case, *found in _messages(stream):
                begun = case if not found else None
                first = case + 1
                if found:
                    report.take(case, *found)
        _, status = os.waitpid(child, 0)
        if begun is not None:
            name = case_of(seed, begun, files)[0]
            report.take(begun, name, f"the process ended with status {status}", SECONDS)
        elif status == 0:
            break
    return report


def _messages(stream: Any) -> Iterator[Any]:
    while True:
        try:
            yield pickle.load(stream)
        except EOFError:
            return


def _child(seed: int, cases: range, files: Corpus, writing: int, end: float | None) -> None:
    """Read cases and tell of each before and after; never return."""
    status = 1
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        limit = pages * resource.getpagesize() + MEMORY
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        signal.signal(signal.SIGPROF, _too_long)
        with tempfile.TemporaryDirectory(prefix="fuzz-") as folder, os.fdopen(writing, "wb") as out:
            for case in cases:
                if end is not None and time.monotonic() > end:
                    break
                pickle.dump((case,), out)
                out.flush()
                name, content = case_of(seed, case, files)
                # Python hears the first; what is stuck in compiled code is ended by the second.
                signal.setitimer(signal.ITIMER_PROF, SECONDS)
                used = int(time.process_time() + 2 * SECONDS) + 1
                resource.setrlimit(resource.RLIMIT_CPU, (used, resource.RLIM_INFINITY))
                start = time.process_time()
                what = outcome(name, content, Path(folder))
                signal.setitimer(signal.ITIMER_PROF, 0)
                pickle.dump((case, name, what, time.process_time() - start), out)
                out.flush()
        status = 0
    finally:
        os._exit(status)


class TooLongError(BaseException):
    """A call took longer than its limit."""


def _too_long(*_: object) -> None:
    raise TooLongError(f"more than {SECONDS} s of CPU")


def main() -> None:
    """Run from the command line; the exit code is 1 if anything crashed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seconds", type=float, help="begin no case after so many")
    parser.add_argument("--only", default="", help="kinds of files whose name holds this")
    parser.add_argument("--keep", type=Path, help="folder for what crashes, or the case")
    given = parser.parse_args()
    files = {name: content for name, content in corpus().items() if given.only in name}
    report = run(given.seed, range(given.first, given.first + given.count), files, given.seconds)
    print(f"{report.count} files, seed {given.seed}: {report.read.total()} read,")
    print(f"{report.refused.total()} refused, {len(report.crashes)} crashed;")
    print(f"slowest {report.slowest[0]:.2f} s of CPU (case {report.slowest[1]})")
    seen = Counter(what.partition(" <- ")[2] or what for _, _, what in report.crashes)
    for place, times in seen.most_common():
        case, name, what = next(c for c in report.crashes if c[2].endswith(place))
        print(f"{times:6} x {name} (case {case}): {what}")
    if given.keep:
        given.keep.mkdir(parents=True, exist_ok=True)
        kept = [case for case, *_ in report.crashes] or [given.first]
        for case in kept[:100]:
            name, content = case_of(given.seed, case, files)
            (given.keep / f"{case}-{Path(name).name}").write_bytes(content)
    sys.exit(bool(report.crashes))


if __name__ == "__main__":
    main()
