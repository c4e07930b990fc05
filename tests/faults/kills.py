"""Kill whatever writes, everywhere, and look at what is left.

`python -m tests.faults.kills --count 1000` kills a thousand times and tells what it saw.
"""

from __future__ import annotations

import argparse
import itertools
import random
import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from tests.faults.injector import Fault, Outcome, living, suffer
from tests.faults.jobs import Job, jobs, put_old

GRACE = 2.0
"""Seconds after which no process of a killed job may live."""


@dataclass(frozen=True)
class Scene:
    """A job with what was there before: an old result that is replaced or not, or nothing."""

    name: str
    there: bool
    force: bool

    @property
    def job(self) -> Job:
        """What is done."""
        return jobs()[self.name]

    def act(self, folder: Path, fault: Fault) -> Outcome:
        """Do it with a fault."""
        return suffer(lambda: self.job.write(folder, self.force), fault)

    def prepared(self) -> Path:
        """Return a new folder with what was there before."""
        folder = Path(tempfile.mkdtemp(prefix="robustpolish-faults-"))
        if self.there:
            for name in self.job.targets:
                put_old(folder / name)
        return folder


@dataclass
class Tally:
    """What was seen."""

    kills: Counter[str] = field(default_factory=Counter)
    refusals: int = 0
    complaints: list[str] = field(default_factory=list)


def scenes() -> list[Scene]:
    """Return every job, with and without force, on an old result and on nothing."""
    found = []
    for name, job in jobs().items():
        found += [Scene(name, False, False), Scene(name, True, True)]
        found += [Scene(name, True, False)] if not job.asks else []
    return found


def content(folder: Path) -> dict[str, object]:
    """Return what a folder holds, all levels, hidden files too."""
    return {
        path.name: content(path) if path.is_dir() else path.read_bytes()
        for path in folder.iterdir()
    }


def try_fault(scene: Scene, fault: Fault, whole: dict[str, object], tally: Tally) -> Outcome:
    """Let a job suffer a fault, look at what is left, run it again and look once more."""
    folder = scene.prepared()
    before = content(folder)
    tag = f"{scene} {fault}"
    try:
        outcome = scene.act(folder, fault)
        if outcome.killed:
            tally.kills[scene.name] += 1
            until = time.monotonic() + GRACE
            while living(outcome.session) and time.monotonic() < until:
                time.sleep(0.01)
            if left := living(outcome.session):
                tally.complaints.append(f"{tag}: {left} live on")
        tally.refusals += outcome.refused
        after = content(folder)
        for name in scene.job.targets:
            allowed = [whole.get(name), before.get(name)]
            # Where folders cannot be exchanged, the next run finishes what was begun.
            waiting = not fault.exchange and name not in after
            if after.get(name) not in allowed and not waiting:
                tally.complaints.append(f"{tag}: {name} is neither old nor new")
        if not scene.job.ends:
            for name in scene.job.targets:
                put_old(folder / name)
            if sorted(content(folder)) != sorted(scene.job.targets):
                tally.complaints.append(f"{tag}: the next run leaves {sorted(content(folder))}")
            return outcome
        again = scene.act(folder, Fault(exchange=fault.exchange))
        done = content(folder)
        if again.refused and scene.force:
            tally.complaints.append(f"{tag}: the next run was refused")
        if sorted(done) != sorted(scene.job.targets) and not again.refused:
            tally.complaints.append(f"{tag}: the next run leaves {sorted(done)}")
        for name, found in done.items():
            if name not in scene.job.targets:
                tally.complaints.append(f"{tag}: {name} is left")
            elif found != whole[name] and not (again.refused and found == before.get(name)):
                tally.complaints.append(f"{tag}: {name} is not whole after the next run")
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


def plan(seed: int, only: str = "") -> Iterator[tuple[Scene, Fault, dict[str, object]]]:
    """Yield scenes in turn with their faults in a random order, and the whole new result."""
    chance = random.Random(seed)
    every: list[list[tuple[Scene, Fault, dict[str, object]]]] = []
    for scene, exchange in itertools.product(scenes(), (True, False)):
        if only not in scene.name:
            continue
        if not scene.job.ends:
            wait = [Fault("time", chance.randrange(100, 1000), exchange) for _ in range(4)]
            every.append([(scene, fault, {}) for fault in wait])
            continue
        folder = scene.prepared()
        try:
            done = scene.act(folder, Fault(exchange=exchange))
            assert not done.refused, f"{scene} is refused without a fault"
            whole = content(folder)
        finally:
            shutil.rmtree(folder)
        largest = max(_sizes(whole))
        own = faults(done.operations, largest, exchange, chance)
        every.append([(scene, fault, whole) for fault in own])
    for own in every:
        chance.shuffle(own)
    for turn in itertools.count():
        for own in every:
            yield own[turn % len(own)]


def _sizes(tree: dict[str, object]) -> Iterator[int]:
    for each in tree.values():
        if isinstance(each, dict):
            yield from _sizes(each)
        elif isinstance(each, bytes):
            yield len(each)


def kill(count: int, seed: int = 1, only: str = "") -> Tally:
    """Try faults on the jobs with a word in their name until `count` processes were killed."""
    tally = Tally()
    for scene, fault, whole in plan(seed, only):
        try_fault(scene, fault, whole, tally)
        if tally.kills.total() >= count:
            break
    return tally


def main() -> None:
    """Kill as often as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="a word in the names of the jobs")
    given = parser.parse_args()
    tally = kill(given.count, given.seed, given.only)
    print(f"{tally.kills.total()} kills: {dict(tally.kills)}; {tally.refusals} other refusals")
    print("\n".join(tally.complaints) or "every result whole, nothing left, nobody alive")
    raise SystemExit(bool(tally.complaints))


if __name__ == "__main__":
    main()
