"""A sweep of closed loops on local processes against the same points one after the other.

Each point draws the machine's masses and stiffnesses by a tenth and simulates five seconds of its
closed loop at 20 kHz. These times alone are of the wall clock: what counts is how well the cores
are used, the start of the processes included. The peers are a loop over the points in one
process, as without a sweep, and the same sweep on one core. The first also tells what the workers'
way with memory gains; the second has it as well, so that it tells of sharing the work alone. What
the cores themselves lose when all of them work is told by sweeps that share nothing.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
import xarray as xr

import robustpolish as rp
from benchmarks.closed_loop import RATE, forces
from benchmarks.row import Row
from robustpolish.base.sweep import cores

LOOPS, SECONDS = 2000, 5.0
QUICK = (100, 0.5)
# Of the time that all cores would take at their best.
EFFICIENCY = 0.9
SPREAD = 0.1
_ALONE = "there is one core"
_START = "the processes are started, on one core, before the points are shared"

VARIED = ("brush_mass", "bearing_mass", "bearing_stiffness", "holder_stiffness")


@lru_cache(1)
def _pushes(seconds: float) -> xr.Dataset:
    """Return the forces of all points, once in each process."""
    return forces(round(seconds * RATE) + 1, rp.air_bearing().disturbance_names)


def largest_deviation(
    number: int, seconds: float, gain: np.ndarray, rng: np.random.Generator
) -> float:
    """Return the largest deviation of the tool of one machine, in m."""
    nominal = rp.polishing.AirBearingParameters()
    drawn = {n: getattr(nominal, n) * rng.uniform(1 - SPREAD, 1 + SPREAD) for n in VARIED}
    loop = rp.air_bearing(replace(nominal, **drawn)).state_feedback_loop(gain)
    found = rp.simulate(loop, _pushes(seconds))
    return max(float(np.abs(found[name]).max()) for name in loop.output_labels)


def controlled(seconds: float) -> partial[float]:
    """Return the function that is swept over ``number``: all points have the controller."""
    design = rp.state_feedback(rp.air_bearing(), norm="h2", control_weight=1e-4)
    return partial(largest_deviation, seconds=seconds, gain=np.asarray(design.controller.D))


def found_in(count: int, seconds: float, executor: str | None) -> tuple[xr.Dataset, float]:
    """Return what a sweep finds, and the time that it takes in ms."""
    function, points = controlled(seconds), {"number": range(count)}
    start = time.perf_counter()
    found = rp.sweep(function, points, executor=executor, progress=False)
    return found, 1e3 * (time.perf_counter() - start)


def on_one_core(count: int, seconds: float) -> float:
    """Return the time that the sweep takes with one worker, in ms; it has to start it as well."""
    return _time_of(_begun(count, seconds, min(os.sched_getaffinity(0))))


def at_once(count: int, seconds: float) -> float:
    """Return the time of sweeps that share nothing, in ms: one on each core, of its part of all.

    Cores share memory, cache and often more: no sharing of work is faster than that.
    """
    used = sorted(os.sched_getaffinity(0))[: cores()]
    running = [_begun(count // len(used), seconds, core) for core in used]
    return max(_time_of(run) for run in running)


def _begun(count: int, seconds: float, core: int) -> subprocess.Popen[str]:
    # An own interpreter, for this one has started its workers already.
    code = (
        "import os, benchmarks.sweeps as b; from threadpoolctl import threadpool_limits\n"
        f"os.sched_setaffinity(0, [{core}]); threadpool_limits(1)\n"
        f"print(b.found_in({count}, {seconds}, None)[1])"
    )
    return subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)


def _time_of(run: subprocess.Popen[str]) -> float:
    out, _ = run.communicate()
    if run.returncode:
        raise RuntimeError(f"a sweep on one core ended with code {run.returncode}; see above")
    return float(out)


def rows(quick: bool) -> Iterator[Row]:
    """Time the sweep on as many processes as there are cores."""
    count, seconds = QUICK if quick else (LOOPS, SECONDS)
    processes = cores()
    ours, spent = found_in(count, seconds, None)
    serial, alone = found_in(count, seconds, "serial")
    same = "same bits" if ours.identical(serial) else "they differ"
    peers = {"one process": (alone, f"{same}, ")}
    if hasattr(os, "sched_setaffinity") and processes > 1:
        peers["rp.sweep, 1 process"] = on_one_core(count, seconds), ""
    for peer, (time_of_peer, said) in peers.items():
        yield Row(
            "sweeps", f"{count} closed loops of {seconds:g} s, wall clock",
            f"rp.sweep, {processes} processes", spent, peer, time_of_peer,
            f"{said}{time_of_peer / spent / processes:.0%} of all cores used",
            asked=1 / (EFFICIENCY * processes), reason=_ALONE if processes == 1 else _START,
        )  # fmt: skip
    if len(peers) > 1:
        apart = at_once(count, seconds)
        yield Row(
            "sweeps", f"{count} closed loops of {seconds:g} s, wall clock",
            f"rp.sweep, {processes} processes", spent,
            f"{processes} sweeps of a part each, sharing nothing", apart,
            f"{apart / spent:.0%} of what these cores can do at once",
            asked=1 / EFFICIENCY, reason=_START,
        )  # fmt: skip
