"""Try random plants on all public functions: ``python -m tests.fuzz.plants --count N --seed S``.

Every plant meets a few quick functions, and every tenth one that takes longer. A crash is anything
but a result without nan, an error of the package, or an answer that comes more than a second after
its time limit. Seeds make every run the same; ``--only NUMBER`` repeats one plant.
"""

import argparse
import os
import signal
import sys
import time
import traceback
import warnings
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

import robustpolish as rp
from robustpolish.base.budget import now

from .drawn_plants import drawn_plant
from .plant_calls import CHEAP, DEAR, LIMITED, TIME_LIMIT, Given
from .sixty_digits import FalsehoodError, checked

QUICK_PER_PLANT = 4
DEAR_EVERY = 10
# Seconds for calls that have no time limit of their own; none of them searches.
UNLIMITED = 20.0
LATE = 1.0
# Where nothing else ends a call, this does.
HANGS = 120.0
# What holds a certificate, and the word for one that sixty digits looked at and found true.
CERTIFIED = (rp.results.Certificate, rp.results.Design)
CERTIFICATE = "proven certificate"


@dataclass(frozen=True)
class Crash:
    """A call that ended in neither a result nor an error of the package."""

    function: str
    plant: str
    what: str
    where: str

    def __str__(self):
        return f"{self.function}: {self.what}\n    {self.where}\n    {self.plant}"


class HungError(BaseException):
    """Raised by the alarm, so that no handler of errors takes it for one."""


def try_plant(seed, number, names=None):
    """Return what became of the calls on one plant, as (name, word), and the crashes."""
    drawn = drawn_plant(seed, number)
    random = drawn.random("functions")
    chosen = list(random.choice(sorted(CHEAP), QUICK_PER_PLANT, replace=False))
    if random.random() < 1 / DEAR_EVERY:
        chosen.append(str(random.choice(sorted(DEAR))))
    outcomes, crashes = [], []
    for name in names or chosen:
        word, crash = _tried(str(name), drawn)
        outcomes.append((str(name), word))
        crashes += [crash] if crash else []
    return outcomes, crashes


def _tried(name, drawn):
    start, cpu = now(), _cpu()
    limit = TIME_LIMIT if name in LIMITED else UNLIMITED
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"), _alarm(HANGS):
            warnings.simplefilter("ignore")
            given = Given(drawn.plant(), drawn.system(), drawn.random(name))
            found = (CHEAP | DEAR)[name](given)
            word = checked(name, found, given)
            if word == "proven" and isinstance(found, CERTIFIED):
                word = CERTIFICATE
    except rp.RobustPolishError as error:
        word = type(error).__name__
    except (Exception, HungError, FalsehoodError) as error:
        return "crash", Crash(name, str(drawn), f"{type(error).__name__}: {error}", _place(error))
    # On a busy machine a call waits for its turn: only what it computes itself makes it late, and
    # limits do not count what is compiled once.
    took = min(now() - start, _cpu() - cpu)
    if took > limit + LATE:
        return "late", Crash(name, str(drawn), f"took {took:.1f} s of {limit:g} s", "late")
    return word, None


def _cpu():
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


@contextmanager
def _alarm(seconds):
    def ring(*_):
        raise HungError(f"no answer within {seconds:g} s")

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def _place(error):
    """Return the last places in the package that an error came through."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = [f for f in frames if "/robustpolish/" in f.filename]
    shown = [f"{f.filename.rpartition('/robustpolish/')[2]}:{f.lineno}" for f in ours[-3:]]
    return " < ".join(reversed(shown)) or str(frames[-1])


def run(count, seed, start=0, names=None, tell=lambda text: None):
    """Try plants `start` to `start + count`; return words by function and the crashes."""
    words, crashes = Counter(), []
    for number in range(start, start + count):
        outcomes, found = try_plant(seed, number, names)
        words.update(outcomes)
        crashes += found
        for crash in found:
            tell(str(crash))
    return words, crashes


def main():
    """Run from the command line; the exit status says whether anything crashed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--start", type=int, default=0)
    parser.add_argument("--only", type=int, help="try this plant alone")
    parser.add_argument("--functions", nargs="*", help="try these functions on every plant")
    asked = parser.parse_args()
    start, count = (asked.start, asked.count) if asked.only is None else (asked.only, 1)
    cpu = time.process_time()
    words, crashes = run(count, asked.seed, start, asked.functions, lambda s: print(s, flush=True))
    totals = Counter()
    for (_, word), number in words.items():
        totals[word] += number
    places = Counter((crash.where, crash.what.split(":")[0]) for crash in crashes)
    for (where, what), number in places.most_common():
        print(f"{number:6d}  {what:22s} {where}")
    print(f"{count} plants of seed {asked.seed}: {sum(words.values())} calls, {dict(totals)}")
    false = sum("FalsehoodError" in crash.what for crash in crashes)
    print(
        f"checked in sixty digits: {totals[CERTIFICATE]} certificates and {totals['proven']} other "
        f"results found true, {false} results found false"
    )
    print(f"{time.process_time() - cpu:.0f} s of CPU time")
    sys.exit(bool(crashes))


if __name__ == "__main__":
    main()
