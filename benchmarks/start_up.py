"""How long the command and the import take: new processes, their whole time of the processor."""

from __future__ import annotations

import resource
import subprocess
import sys
from collections.abc import Iterator

from benchmarks.row import Row

PEER = "python -c 'import control'"
LINES = (
    ("robustpolish --version", ["-m", "robustpolish", "--version"], 0.5),
    ("import robustpolish", ["-c", "import robustpolish"], 1.0),
    ("robustpolish --help", ["-m", "robustpolish", "--help"], 0.7),
)


def process_ms(arguments: list[str], repeats: int) -> float:
    """Return the least time of the processor of a new Python with these arguments."""
    spent = []
    for _ in range(repeats + 1):  # the first one reads the files from the disk
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return 1e3 * min(spent[1:])


def rows(quick: bool) -> Iterator[Row]:
    """Time what a user waits for first."""
    repeats = 2 if quick else 5
    theirs = process_ms(["-c", "import control"], repeats)
    for task, arguments, seconds in LINES:
        spent = process_ms(arguments, repeats)
        yield Row("start-up", task, task, spent, PEER, theirs, asked=seconds, seconds=True)
