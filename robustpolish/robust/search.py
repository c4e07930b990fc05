"""Both bounds of a loop's peak: a level over all frequencies, and a Delta that is near it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from robustpolish.arrays import Vector
from robustpolish.robust.branching.branch import Goal, branched, can_branch
from robustpolish.robust.branching.probe import nearby
from robustpolish.robust.coverage import Coverage, cover, response
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.numbers.one_number import proven_size
from robustpolish.robust.numbers.rays import Crossing, crossings
from robustpolish.robust.scaled.centre import Level
from robustpolish.robust.scaled.scalings import Inequality, Space
from robustpolish.robust.witness import Witness, directions, smallest

GAP = 2e-3
"""Relative distance of both bounds that is small enough, if nothing else is asked for."""
EVERYWHERE = ((0.0, math.inf),)

# Crossings, peaks and directions that a search starts from: the first ones are the best nearly
# always, the others are for real numbers, whose searches end in different places.
_CROSSINGS = 4
_PEAKS = 3
_DIRECTIONS = 4
# Relative gap at which no further search is worth it: what intervals need is above.
_NEAR = 1.5e-3
# Angle beside rest and infinity from which a search along the axis begins.
_BESIDE = 1e-3
# Frequencies beside those of all poles, relative, at which a loop is as at rest or at infinity; and
# how much larger its witness there may be, for what is left of its dynamics.
_END = 1e-6
_BESIDE_END = 1e-6
# Size of real numbers, beside what was said to be possible, that is looked at without a witness.
_FAR = 1e3
# Part of the gap that branching aims at, which need not stop at the last moment.
_AIM = 0.5
# Distances of both bounds that are told: the least one, above what intervals leave around a peak,
# and how much larger the next one is.
_STEP = 1.04e-3
_RATIO = 0.25
# Relative difference of sizes that are the same but for rounding.
_EQUAL = 1e-9
# Imaginary parts of values at rest that are nothing but rounding, relative.
_ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class Bounds:
    """What was found of a loop.

    Attributes
    ----------
    coverage : Coverage
    witness : Witness or None
    """

    coverage: Coverage
    witness: Witness | None

    @property
    def gap(self) -> float:
        """Relative distance of the level above what the witness shows; infinite without either."""
        if self.witness is None or not self.coverage.complete:
            return math.inf
        return self.coverage.level * self.witness.size - 1


def bounds(loop: LoopModel, fixed: tuple[bool, ...] | None = None, gap: float = GAP) -> Bounds:
    """Bound the peak of the structured singular value of a stable loop from both sides.

    Parameters
    ----------
    loop : LoopModel
    fixed : tuple of bool, optional
        Blocks that have size 1 whatever the level is; none by default.
    gap : float, optional
        Relative distance of both bounds that is small enough: what is above is branched over, if
        the loop is small.

    Returns
    -------
    Bounds
    """
    found = _at_the_ends(loop, fixed, _by_scalings(loop, fixed))
    if found.witness is None and not fixed:
        return _without_witness(loop, found, gap)
    exact = proven_size(loop, found.witness.size) if found.witness and not fixed else None
    if exact is not None:
        return replace(found, coverage=_everywhere(found.coverage, 1 / exact))
    if found.witness and found.gap > gap and can_branch(loop):
        return _at_the_ends(loop, fixed, _by_branching(loop, found, fixed, _AIM * gap))
    return _outward(found, gap)


def _without_witness(loop: LoopModel, found: Bounds, gap: float) -> Bounds:
    """Prove that real numbers up to a size far beyond what was said to be possible do nothing."""
    if found.coverage.complete or any(b.kind != "real" for b in loop.structure.blocks):
        return found
    far = _FAR * loop.gain
    size = proven_size(loop, far)
    if size is None and can_branch(loop):
        size = branched(loop, "pole", 0.0, far, gap, lambda numbers, frequency: far)
    return replace(found, coverage=_everywhere(found.coverage, 1 / size)) if size else found


def _outward(found: Bounds, gap: float) -> Bounds:
    """Raise the level to one of a few distances from the witness.

    Where intervals happen to end moves it by less than these are apart, and with it how numbers
    were rounded: without this, other units of the same loop would give another bound.
    """
    if not (found.witness and 0 < found.gap < math.inf):
        return found
    steps = max(0, math.ceil(math.log(found.gap / _STEP) / math.log1p(_RATIO)))
    rounded = _STEP * (1 + _RATIO) ** steps
    if found.gap <= gap < rounded:
        return found
    level = (1 + rounded) / found.witness.size
    return replace(found, coverage=replace(found.coverage, level=level))


def _at_the_ends(loop: LoopModel, fixed: tuple[bool, ...] | None, found: Bounds) -> Bounds:
    """Bring a witness that is all but at rest or at infinity there, where its values are real.

    Its lags would turn phases that are nothing but rounding.
    """
    witness = found.witness
    poles = np.abs(np.linalg.eigvals(loop.model.A)) if loop.model.states else np.zeros(0)
    poles = poles[poles > 0]
    if witness is None or not poles.size:
        return found
    frequency = loop.frequency(witness.at)
    if poles.min() * _END < frequency < poles.max() / _END or frequency in (0.0, math.inf):
        return found
    end = 0.0 if frequency < poles.min() else math.pi / 2
    structure = loop.structure
    M = np.real(loop.response(end)[0])
    delta = np.real(witness.matrix(structure))
    w = np.linalg.svd(np.eye(len(delta)) - delta @ M)[2][-1].astype(complex)
    scale = np.ones(len(w))
    there = smallest(structure, loop.response, w, end, False, scale, fixed=fixed)
    if there is None or not _is_real(there) or there.size > witness.size * (1 + _BESIDE_END):
        return found
    return replace(found, witness=there)


def _everywhere(coverage: Coverage, level: float) -> Coverage:
    """Return what is proven if a level is proven over all of the axis."""
    return replace(coverage, level=level, intervals=EVERYWHERE, complete=True)


def _by_branching(
    loop: LoopModel, found: Bounds, fixed: tuple[bool, ...] | None, gap: float
) -> Bounds:
    """Draw both bounds together by branch and bound over the real numbers."""
    coverage, best = found.coverage, found.witness
    real_alone = all(block.kind == "real" for block in loop.structure.blocks)
    goal: Goal = "pole" if real_alone else "gain" if fixed else "both"
    held = fixed or (False,) * len(loop.structure.blocks)

    def probe(numbers: Vector, frequency: float) -> float:
        nonlocal best
        best = _better(best, nearby(loop, numbers, frequency, held))
        return best.size if best else math.inf

    start = 1 / coverage.level if coverage.complete and coverage.level else 0.0
    size = branched(loop, goal, start, best.size if best else math.inf, gap, probe)
    if size > start:
        coverage = _everywhere(coverage, 1 / size)
    return Bounds(coverage, best)


def _by_scalings(loop: LoopModel, fixed: tuple[bool, ...] | None) -> Bounds:
    """Bound the peak by scalings that hold over intervals, and by searches from where they end."""
    structure = loop.structure
    space = Space(structure, fixed or (False,) * len(structure.blocks))
    found = None if fixed else _from_crossings(loop, crossings(loop))
    seeds = loop.seeds()
    if found is not None:
        seeds = [loop.frequency(found.at), *seeds]
    start = 1 / found.size if found else 0.0
    coverage = cover(loop.model, space, start, seeds)
    branches = can_branch(loop)
    for frequency, _, level in coverage.peaks[:_PEAKS]:
        if found and (branches or coverage.level * found.size <= 1 + _NEAR):
            break
        # Where branching follows, it finds the place, and any witness is enough.
        count = 1 if branches else _DIRECTIONS
        near = _from_peak(loop, space, frequency, level, coverage.level, count)
        found = _better(found, near)
    return Bounds(coverage, found)


def _from_crossings(loop: LoopModel, known: list[Crossing]) -> Witness | None:
    """Return the smallest Delta near the crossings of rays."""
    best: Witness | None = None
    scale = np.ones(loop.structure.shape[1])
    for crossing in known[:_CROSSINGS]:
        angle, moves = loop.start(crossing.frequency)
        found = smallest(
            loop.structure, loop.response, crossing.w, angle, moves, scale, crossing.deltas
        )
        best = _better(best, found)
    return best


def _from_peak(
    loop: LoopModel, space: Space, frequency: float, level: Level, reached: float, count: int
) -> Witness | None:
    """Return the smallest Delta near what the scalings of a peak say is the worst."""
    inequality = Inequality(space, response(loop.model, frequency)[None])
    _, still, free, _ = space.matrices(level.x)
    scaled = np.real(np.diagonal(still + free))
    scale = 1 / np.sqrt(np.maximum(scaled, 1e-300))
    scale = scale / scale.max()
    best: Witness | None = None
    angle, ends = loop.angle(frequency), frequency in (0.0, math.inf)
    # At rest and at infinity a stable real system has real values: look there, and nearby.
    near = min(max(angle, _BESIDE), math.pi / 2 - _BESIDE)
    for w in directions(inequality, level.square, level.x, count):
        starts = [(w, near, True)]
        if ends:
            starts = [(np.real(w).astype(complex), angle, False), *starts]
        else:  # a search along the axis may leap off a narrow peak, and end on another
            starts = [*starts, (w, angle, False)]
        for signals, at, moves in starts:
            if best and reached * best.size <= 1 + _NEAR:
                break
            found = smallest(
                loop.structure, loop.response, signals, at, moves, scale, fixed=space.fixed
            )
            if found and (moves or not ends or _is_real(found)):
                best = _better(best, found)
        if best and reached * best.size <= 1 + _NEAR:
            break
    return best


def _is_real(witness: Witness) -> bool:
    """Say whether all values are real but for rounding."""
    return all(np.abs(np.imag(d)).max() <= _ROUNDING * witness.size for d in witness.deltas)


def _better(one: Witness | None, other: Witness | None) -> Witness | None:
    """Return the smaller one; the first of equals, which is the one at rest or at infinity."""
    if one is None or other is None:
        return one or other
    return one if one.size <= other.size * (1 + _EQUAL) else other
