"""Kill a process that writes a folder or a file, everywhere, and look at what is left."""

from __future__ import annotations

import itertools
import random
import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from robustpolish.base.atomic_writes import new_folder
from tests.faults.injector import Fault, Outcome, living, suffer

GRACE = 2.0
"""Seconds after which no process of a killed job may live."""

Tree = dict[str, Any]


@dataclass(frozen=True)
class Job:
    """What writes a result: `write` takes the folder and whether to replace what is there.

    `target` is what it writes there; a name without an ending is a folder. `ends` tells whether it
    ends by itself.
    """

    write: Callable[[Path, bool], Any]
    target: str
    ends: bool = True


@dataclass
class Tally:
    """What was seen."""

    kills: Counter[str] = field(default_factory=Counter)
    refusals: int = 0
    complaints: list[str] = field(default_factory=list)


def put_old(place: Path) -> None:
    """Put an earlier result at a place."""
    if place.suffix:
        place.write_bytes(b"old\n")
        return
    with new_folder(place, force=True) as folder:
        for name in ("design.json", "old.txt"):
            (folder / name).write_bytes(b"old\n")


def content(folder: Path) -> Tree:
    """Return what a folder holds, all levels, hidden files too."""
    return {
        path.name: content(path) if path.is_dir() else path.read_bytes()
        for path in folder.iterdir()
    }


def try_fault(job: Job, there: bool, fault: Fault, whole: Tree, tally: Tally) -> Outcome:
    """Let a job suffer a fault, look at what is left, run it again and look once more.

    With something there it is replaced by force. `whole` is what a run without a fault leaves.
    """
    folder = Path(tempfile.mkdtemp(prefix="robustpolish-faults-"))
    if there:
        put_old(folder / job.target)
    before, name = content(folder), job.target

    def act(fault: Fault) -> Outcome:
        return suffer(lambda: job.write(folder, there), fault)

    def complain(what: str) -> None:
        tally.complaints.append(f"{name} {'on the old one ' * there}{fault}: {what}")

    try:
        outcome = act(fault)
        if outcome.killed:
            tally.kills[name] += 1
            until = time.monotonic() + GRACE
            while living(outcome.session) and time.monotonic() < until:
                time.sleep(0.01)
            if left := living(outcome.session):
                complain(f"{left} live on")
        tally.refusals += outcome.refused
        after = content(folder)
        # Where folders cannot be exchanged, the next run finishes what was begun.
        waiting = not fault.exchange and name not in after
        if after.get(name) not in [whole.get(name), before.get(name)] and not waiting:
            complain("neither old nor new")
        if not job.ends:
            return outcome
        again, done = act(Fault(exchange=fault.exchange)), content(folder)
        if again.refused and there:
            complain("the next run was refused")
        if not again.refused and done != whole:
            complain(f"the next run leaves {sorted(done)}, or not whole")
        return outcome
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def faults(operations: int, largest: int, exchange: bool, chance: random.Random) -> list[Fault]:
    """Return one fault for each operation, and others inside writes and at any time."""
    found = [Fault("kill", at, exchange) for at in range(1, operations + 1)]
    found += [Fault("size", chance.randrange(largest), exchange) for _ in range(operations // 4)]
    found += [Fault("time", chance.randrange(400), exchange) for _ in range(operations // 4)]
    for kind in ("denied", "full", "clock"):
        found += [Fault(kind, at, exchange) for at in range(1, operations + 1, 7)]
    return found


def plan(jobs: list[Job], seed: int) -> Iterator[tuple[Job, bool, Fault, Tree]]:
    """Yield jobs in turn with their faults in a random order, and the whole new result."""
    chance = random.Random(seed)
    every = []
    for job, there, exchange in itertools.product(jobs, (False, True), (True, False)):
        folder = Path(tempfile.mkdtemp(prefix="robustpolish-faults-"))
        try:
            done = suffer(lambda j=job, f=folder: j.write(f, False), Fault(exchange=exchange))
            assert not done.refused, f"{job} is refused without a fault"
            whole = content(folder)
        finally:
            shutil.rmtree(folder)
        own = faults(done.operations, max(_sizes(whole)), exchange, chance)
        chance.shuffle(own)
        every.append([(job, there, fault, whole) for fault in own])
    for turn in itertools.count():
        for own in every:
            yield own[turn % len(own)]


def _sizes(tree: Mapping[str, Any]) -> Iterator[int]:
    for each in tree.values():
        if isinstance(each, dict):
            yield from _sizes(each)
        else:
            yield len(each)


def kill(jobs: list[Job], count: int, seed: int = 1) -> Tally:
    """Try faults on the jobs until `count` processes were killed."""
    tally = Tally()
    for job, there, fault, whole in plan(jobs, seed):
        try_fault(job, there, fault, whole, tally)
        if tally.kills.total() >= count:
            break
    return tally
