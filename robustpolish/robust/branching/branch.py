"""Branch and bound over real numbers and frequencies: both bounds drawn together.

What scalings prove of many real numbers may be far below what is true, for they forget that a
number is the same at all frequencies, and more. Over a small box and a short band, polynomials are
nearly linear, and their Bernstein coefficients prove nearly all that is true [1]_. The region with
the lowest bound is halved, again and again, until none has one far below the witness.

References
----------
.. [1] M. Zettler, J. Garloff, "Robustness analysis of polynomials with polynomial parameter
   dependency using Bernstein expansion", IEEE Transactions on Automatic Control 43 (1998) 425-431.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Literal

import flint
import numpy as np

from robustpolish.arrays import AnyArray, Vector
from robustpolish.deadline import look_at_the_clock
from robustpolish.exact.balls import precision
from robustpolish.robust.branching.bernstein import Balls, from_powers
from robustpolish.robust.branching.polynomials import Family, family, is_small
from robustpolish.robust.branching.regions import Gauge, Region, bent, bound
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.structure import Structure

_BITS = 320
_UNIT = 2.0**-53

Goal = Literal["pole", "both", "gain"]


@dataclass(frozen=True)
class BranchPolicy:
    """How much work branching may be.

    Attributes
    ----------
    coefficients : int
        Of a polynomial at the beginning, beyond which there is no branching at all: those of five
        numbers that occur once each, and a gain, with 15 states.
    work : float
        Coefficients of all regions that are looked at: a few seconds.
    overhead : float
        What looking at a region costs beside, in coefficients.
    bands : int
        Of frequency at the beginning, each an octave wide or more.
    probed : int
        Regions after which a witness is looked for, and again after twice as many.
    again : float
        Part of the gap by which the size of numbers has to fall for a new beginning.
    """

    coefficients: int = 4000
    work: float = 1e8
    overhead: float = 5e3
    bands: int = 10
    probed: int = 8
    again: float = 0.25


POLICY = BranchPolicy()

Probe = Callable[[Vector, float], float]
"""Looks for a witness near real numbers and a frequency; returns the size of the smallest yet."""


@dataclass(eq=False)
class Branching:
    """What is asked of a loop, and how far the answer is.

    Attributes
    ----------
    goal : {"pole", "both", "gain"}
        Least size of real numbers that put a pole on the axis; least size of these and of the one
        other block together; or of that block alone, with the numbers up to size 1.
    gauge : Gauge
    proven : float
        A size below which nothing is known to happen.
    best : float
        The size of the smallest witness.
    gap : float
        Relative distance of both that is small enough.
    looked_at : int
        Number of regions.
    begun : float
        Size of the numbers in the regions that it began with.
    heap : list
        Regions that are not done, with their bounds; that with the least bound is first.
    """

    goal: Goal
    gauge: Gauge
    proven: float
    best: float
    gap: float
    looked_at: int = 0
    begun: float = 0.0
    heap: list[tuple[float, int, Region, tuple[AnyArray, ...]]] = field(default_factory=list)

    @property
    def target(self) -> float:
        """The size that is to be proven."""
        return self.best / (1 + self.gap)

    @property
    def radius(self) -> float:
        """Of the balls of numbers that count together."""
        return 1.0 if self.goal == "gain" else self.target

    def begin(self, loop: LoopModel) -> None:
        """Take the whole box: regions that reach beyond the radius would have low bounds."""
        self.begun, self.heap = self.radius, []
        with precision(_BITS):
            regions = list(_first(family(loop, self.begun), loop))
        for region in regions:
            self.add(region, self.proven)

    def add(self, region: Region, least: float) -> None:
        """Keep a region unless it is done."""
        self.looked_at += 1
        far = np.maximum(np.abs(region.low), np.abs(region.high)).max()
        near = self.gauge.least(region.low, region.high)
        if near > self.radius or (self.goal == "pole" and far <= self.proven):
            return
        found = bound(region, self.gauge, self.radius, self.target)
        if self.goal == "gain":
            size = max(least, found.size)
        elif self.goal == "both":
            size = max(least, found.size, near)
        else:
            size = max(least, near) if found.size == 0 else math.inf
        if size < self.target:
            heapq.heappush(self.heap, (size, self.looked_at, region, found.parts))


def can_branch(loop: LoopModel) -> bool:
    """Say whether a loop is one of few real numbers, with at most one other block."""
    return is_small(loop, POLICY.coefficients)


def branched(
    loop: LoopModel,
    goal: Goal,
    proven: float,
    best: float,
    gap: float,
    probe: Probe,
) -> float:
    """Raise what is proven of a loop until it is near the smallest witness, or work runs out.

    Parameters
    ----------
    loop : LoopModel
        Stable, and one that :func:`can_branch`.
    goal : {"pole", "both", "gain"}
        As of :class:`Branching`.
    proven, best : float
        Sizes that are known: nothing happens below the first, the second is that of a witness.
    gap : float
        Relative distance at which to stop.
    probe : callable
        Looks for a smaller witness: where the bound is lowest after 8, 16, 32, ... regions.

    Returns
    -------
    float
        A size below which nothing happens: at most the smallest witness less the gap.
    """
    state = Branching(goal, gauge_of(loop.structure), proven, best, gap)
    try:
        state.begin(loop)
    except ZeroDivisionError:
        return proven
    work, steps = 0.0, 0
    while state.heap and state.heap[0][0] < state.target and work < POLICY.work:
        look_at_the_clock()
        least, _, region, parts = heapq.heappop(state.heap)
        work += 2 * (region.rows.size + POLICY.overhead)
        steps += 1
        if steps >= POLICY.probed and steps & (steps - 1) == 0:
            state.best = probe(region.centre, region.frequency)
            if state.radius < state.begun * (1 - POLICY.again * gap):
                state.begin(loop)
                continue
        for half in region.halved(bent(parts)):
            state.add(half, least)
    least = state.heap[0][0] if state.heap else math.inf
    return max(proven, min(least, state.target))


def gauge_of(structure: Structure) -> Gauge:
    """Return the gauge of the real numbers of a structure, in their order."""
    real = structure.only([k for k, b in enumerate(structure.blocks) if b.kind == "real"])
    alone = tuple(i for i, block in enumerate(real.blocks) if not block.group)
    return Gauge(alone, real.together)


def _first(parts: Family, loop: LoopModel) -> Iterator[Region]:
    """Yield regions of the whole box, one for each band of frequency."""
    real, imag = _on_axis(parts.parts)
    for axis in (i for group in gauge_of(loop.structure).together for i in group):
        real, imag = _elevated(real, axis + 1), _elevated(imag, axis + 1)
    edges = _edges(loop)
    for start, stop in zip([0.0, *edges], [*edges, math.inf], strict=True):
        above = math.isinf(stop)
        band = (0.0, 1 / start) if above else (start, stop)
        matrix = from_powers(parts.states, *band)
        both = [_multiplied(one[..., ::-1] if above else one, matrix) for one in (real, imag)]
        yield _region(both, parts, band, above)


def _on_axis(parts: Balls) -> tuple[Balls, Balls]:
    """Return the real and imaginary parts at s = j w, as coefficients of powers of w."""
    real, imag = np.full(parts.shape, flint.arb(0), dtype=object), parts.copy()
    real[..., 0::2], imag[..., 0::2] = parts[..., 0::2], flint.arb(0)
    for one in (real, imag):
        for power in range(parts.shape[-1]):
            if power % 4 in (2, 3):
                one[..., power] = -one[..., power]
    return real, imag


def _elevated(table: Balls, axis: int) -> Balls:
    """Return the coefficients with a degree of at least 2 along an axis."""
    if table.shape[axis] > 2:
        return table
    low, high = np.take(table, [0], axis), np.take(table, [1], axis)
    return np.concatenate([low, (low + high) / 2, high], axis=axis)


def _multiplied(table: Balls, matrix: Any) -> Balls:
    """Return rows of coefficients times a matrix."""
    flat = table.reshape(-1, table.shape[-1])
    found = flint.arb_mat(flat.tolist()) * matrix
    result = np.empty(flat.shape, dtype=object)
    for i, row in enumerate(found.tolist()):
        result[i] = row
    return result.reshape(table.shape)


def _region(both: list[Balls], parts: Family, band: tuple[float, float], above: bool) -> Region:
    middles = [np.vectorize(float, otypes=[float])(one) for one in both]
    rows = middles[0] + 1j * middles[1]
    errors = []
    for row, real, imag in zip(rows, *both, strict=True):
        radius = max(float(entry.rad()) for one in (real, imag) for entry in one.ravel())
        errors.append(2 * radius + 4 * _UNIT * float(np.abs(row).max()))
    k = len(parts.degrees)
    low, high = np.full(k, -parts.size), np.full(k, parts.size)
    return Region(rows, np.array(errors), parts.rest, low, high, band, above)


def _edges(loop: LoopModel) -> list[float]:
    """Return where bands of frequency meet: powers of 2."""
    poles = np.abs(np.linalg.eigvals(loop.model.A))
    poles = poles[poles > 0]
    low = math.floor(math.log2(poles.min() if poles.size else 1.0))
    high = math.ceil(math.log2(poles.max() if poles.size else 1.0)) + 1
    step = max(1, math.ceil((high - low) / POLICY.bands))
    return [2.0**power for power in range(low, high + 1, step)]
