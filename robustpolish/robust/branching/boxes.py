"""Branch and bound over real numbers beside any other blocks: scalings for each part of their box.

Over a small box a real number has little left to do, and scalings of the other blocks prove nearly
all that is true there. Each part costs a cover of the axis, so there are few of them.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass, replace

import flint
import numpy as np

from robustpolish.arrays import Vector
from robustpolish.exact.balls import identity, precision
from robustpolish.robust.branching.branch import Probe, gauge_of
from robustpolish.robust.coverage import cover
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.scaled.scalings import Space
from robustpolish.robust.structure import Structure, positions
from robustpolish.robust.units.canonical import BITS, rounded


@dataclass(frozen=True)
class BoxPolicy:
    """How much work is put into boxes.

    Attributes
    ----------
    covers : int
        Parts whose frequencies are covered: some tenths of a second each.
    intervals : int
        Of all covers together: some hundredths of a second each.
    most : int
        Of one cover.
    slack : float
        Of a cover, as a part of the gap that is left.
    most_slack : float
        The largest one.
    """

    covers: int = 24
    intervals: int = 200
    most: int = 50
    slack: float = 0.2
    most_slack: float = 0.1


POLICY = BoxPolicy()

# By how much parts are taken larger, for no number between two of them to be lost in rounding.
_ROUNDING = 1e-13


@dataclass(frozen=True, order=True)
class _Box:
    """A part of the box, with a size that is proven for it."""

    size: float
    number: int
    low: tuple[float, ...]
    high: tuple[float, ...]
    frequency: float


def can_split(loop: LoopModel) -> bool:
    """Say whether there are real numbers beside other blocks."""
    kinds = {block.kind == "real" for block in loop.structure.blocks}
    return kinds == {True, False} and loop.model.states > 0


def split(
    loop: LoopModel,
    fixed: tuple[bool, ...] | None,
    proven: float,
    best: float,
    gap: float,
    probe: Probe,
) -> float:
    """Raise what is proven of a loop until it is near the smallest witness, or work runs out.

    Parameters
    ----------
    loop : LoopModel
        Stable, and one that :func:`can_split`.
    fixed : tuple of bool or None
        Blocks that have size 1 whatever the size of the others: all but the last one, or none.
    proven, best : float
        Sizes that are known: nothing happens below the first, the second is that of a witness.
    gap : float
        Relative distance at which to stop.
    probe : callable
        Looks for a smaller witness near real numbers and a frequency, where the bound is lowest
        after 1, 2, 4, ... steps; returns the size of the smallest yet.

    Returns
    -------
    float
        A size below which nothing happens.
    """
    gauge = gauge_of(loop.structure)
    real = [k for k, block in enumerate(loop.structure.blocks) if block.kind == "real"]
    radius = 1.0 if fixed else best / (1 + gap)
    heap = [_Box(proven, 0, (-radius,) * len(real), (radius,) * len(real), math.nan)]
    count = steps = work = 0
    while heap[0].size < best / (1 + gap) and count < POLICY.covers and work < POLICY.intervals:
        worst = heapq.heappop(heap)
        steps += 1
        left = best / worst.size - 1 if worst.size > 0 else math.inf
        slack = min(POLICY.slack * max(gap, left), POLICY.most_slack)
        for low, high in _halves(worst):
            near = gauge.least(low, high)
            if near > radius:
                continue
            count += 1
            size, frequency, spent = _size(loop, fixed, real, (low, high), best, slack)
            work += spent
            size = max(size, worst.size, 0.0 if fixed else near)
            heapq.heappush(heap, _Box(size, count, tuple(low), tuple(high), frequency))
        if not heap:
            return best / (1 + gap)
        lowest = heap[0]
        if steps & (steps - 1) == 0 and not math.isnan(lowest.frequency):
            best = probe((np.array(lowest.low) + np.array(lowest.high)) / 2, lowest.frequency)
    return max(proven, min(heap[0].size, best / (1 + gap)))


def _halves(box: _Box) -> tuple[tuple[Vector, Vector], tuple[Vector, Vector]]:
    low, high = np.array(box.low), np.array(box.high)
    axis = int(np.argmax(high - low))
    below, above = high.copy(), low.copy()
    below[axis] = above[axis] = (low[axis] + high[axis]) / 2
    return (low, below), (above, high)


def _size(
    loop: LoopModel,
    fixed: tuple[bool, ...] | None,
    real: list[int],
    box: tuple[Vector, Vector],
    best: float,
    slack: float,
) -> tuple[float, float, int]:
    """Return a size of the other blocks that is proven for a box, where, and the intervals."""
    low, high = box
    reach = (high - low) / 2 + _ROUNDING * np.maximum(np.abs(low), np.abs(high))
    part = moved(loop, real, (low + high) / 2, reach)
    if part is None or np.linalg.eigvals(part.model.A).real.max() >= 0:
        return 0.0, math.nan, 0
    held = fixed or tuple(block.kind == "real" for block in loop.structure.blocks)
    space, start = Space(part.structure, held), 1 / best / (1 + slack)
    found = cover(part, space, start, part.seeds(), slack, POLICY.most)
    frequency = found.peaks[0][0] if found.peaks else math.nan
    spent = len(found.intervals) if found.complete else POLICY.most
    return (1 / found.level if found.complete else 0.0), frequency, spent


def moved(loop: LoopModel, real: list[int], centre: Vector, reach: Vector) -> LoopModel | None:
    """Return the loop around numbers of size 1, which stand for those of a box.

    Parameters
    ----------
    loop : LoopModel
    real : list of int
        Positions of the blocks that are real numbers.
    centre, reach : ndarray
        Of the box.

    Returns
    -------
    LoopModel or None
        With numbers that count alone; None if it is not well posed at the centre.
    """
    structure = loop.structure
    nz, nw = structure.shape
    A, B, C, D = loop.balls
    with precision(BITS):
        onto, scale = flint.arb_mat(nw, nz), identity(nw)
        for k, c, h in zip(real, centre, reach, strict=True):
            own = (positions(places, [k]) for places in (structure.outputs, structure.inputs))
            for w, z in zip(*own, strict=True):
                onto[w, z], scale[w, w] = float(c), float(h)
        try:
            back = (identity(nz) - D * onto).inv()
        except ZeroDivisionError:
            return None
        through = onto * back
        forward = (identity(nw) + through * D) * scale
        balls = A + B * through * C, B * forward, back * C, back * D * scale
    blocks = tuple(replace(block, group="") for block in structure.blocks)
    return replace(loop, structure=Structure(blocks), model=rounded(balls), balls=balls)
