"""A sweep of closed loops on local processes against the same points one after the other.

Each point draws the machine's masses and stiffnesses by a tenth and simulates five seconds of its
closed loop at 20 kHz. These times alone are of the wall clock: what counts is how well the cores
are used, the start of the processes included.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
import xarray as xr

import robustpolish as rp
from benchmarks.closed_loop import RATE, forces
from benchmarks.row import Row

LOOPS, SECONDS = 2000, 5.0
QUICK = (100, 0.5)
# Of the time that all cores would take at their best.
EFFICIENCY = 0.9
SPREAD = 0.1
_ALONE = "there is one core"
_SHARED = "the processes wait for memory, or their cores are two threads of one"

VARIED = ("brush_mass", "bearing_mass", "bearing_stiffness", "holder_stiffness")


@lru_cache(1)
def _given(seconds: float) -> tuple[np.ndarray, xr.Dataset]:
    """Return the gain and the forces of all points, once in each process."""
    plant = rp.air_bearing()
    gain = np.asarray(rp.state_feedback(plant, norm="h2", control_weight=1e-4).controller.D)
    names = plant.state_feedback_loop(gain).input_labels
    return gain, forces(round(seconds * RATE) + 1, names)


def largest_deviation(number: int, seconds: float, rng: np.random.Generator) -> float:
    """Return the largest deviation of the tool of one machine, in m."""
    gain, pushes = _given(seconds)
    nominal = rp.AirBearingParameters()
    drawn = {n: getattr(nominal, n) * rng.uniform(1 - SPREAD, 1 + SPREAD) for n in VARIED}
    loop = rp.air_bearing(replace(nominal, **drawn)).state_feedback_loop(gain)
    found = rp.simulate(loop, pushes)
    return max(float(np.abs(found[name]).max()) for name in loop.output_labels)


def rows(quick: bool) -> Iterator[Row]:
    """Time the sweep on as many processes as there are cores."""
    count, seconds = QUICK if quick else (LOOPS, SECONDS)
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    function = partial(largest_deviation, seconds=seconds)
    found, spent = {}, {}
    for executor in (None, "serial"):
        start = time.perf_counter()
        points = {"number": range(count)}
        found[executor] = rp.sweep(function, points, executor=executor, progress=False)
        spent[executor] = 1e3 * (time.perf_counter() - start)
    share = spent["serial"] / spent[None] / (cores or 1)
    same = "same bits" if found[None].identical(found["serial"]) else "they differ"
    yield Row(
        "sweeps", f"{count} closed loops of {seconds:g} s, wall clock",
        f"rp.sweep, {cores} processes", spent[None], "one process", spent["serial"],
        f"{same}, {share:.0%} of all cores used",
        asked=1 / (EFFICIENCY * (cores or 1)), reason=_ALONE if cores == 1 else _SHARED,
    )  # fmt: skip
