"""Bounds of the peak of mu over all frequencies: scalings above, a witness below, branching."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from robustpolish.base.arrays import Vector
from robustpolish.base.budget import check_deadline
from robustpolish.robust.branch_and_bound import (
    Goal,
    Probe,
    branch_and_bound,
    can_branch,
    can_split,
    local_witness,
    split,
)
from robustpolish.robust.coverage import SLACK, Coverage, cover, response
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.real_parameters import proven_real_margin, ray_crossings
from robustpolish.robust.scalings import Inequality, ScaledBound, Space
from robustpolish.robust.witness import Witness, singular_directions, smallest_delta

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
# What the level of scalings has above what is needed where branching follows, as little comes of
# short intervals then.
_ROUGH = 0.3
# Searches that begin where the last one ended.
_AGAIN = 5
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
    held = fixed or (False,) * len(loop.structure.blocks)
    branches = can_branch(loop)
    found = _settled(loop, fixed, _by_scalings(loop, fixed, _ROUGH if branches else SLACK))
    if found.witness is None:
        if branches and found.coverage.complete:
            found = _with_short_intervals(loop, fixed, found)
        if not (fixed or found.coverage.complete):
            # Real numbers up to a size far beyond what was said to be possible may do nothing.
            far, size = _FAR * loop.gain, None
            if all(block.kind == "real" for block in loop.structure.blocks):
                size = proven_real_margin(loop, far)
                if size is None and branches:
                    size = branch_and_bound(loop, "pole", gap, 0.0, far, lambda *_: far)
            if size:
                return replace(found, coverage=_everywhere(found.coverage, 1 / size))
        return found
    exact = None if fixed else proven_real_margin(loop, found.witness.size)
    if exact is not None:
        return replace(found, coverage=_everywhere(found.coverage, 1 / exact))

    def raised(found: Bounds, prove: Callable[[float, float, Probe], float]) -> Bounds:
        """Raise the size that is proven, with looks for smaller witnesses on the way."""
        coverage, best = found.coverage, found.witness

        def probe(numbers: Vector, frequency: float) -> float:
            nonlocal best
            best = _better(best, local_witness(loop, numbers, frequency, held))
            return best.size if best else math.inf

        start = 1 / coverage.level if coverage.complete and coverage.level else 0.0
        size = prove(start, best.size if best else math.inf, probe)
        if size > start:
            coverage = _everywhere(coverage, 1 / size)
        return _settled(loop, fixed, Bounds(coverage, best))

    aim = _AIM * gap
    if found.gap > gap and branches:
        # Both bounds together, by branch and bound over the real numbers.
        real_alone = all(block.kind == "real" for block in loop.structure.blocks)
        goal: Goal = "pole" if real_alone else "gain" if fixed else "both"
        found = raised(found, partial(branch_and_bound, loop, goal, aim))
        if found.gap > gap:
            found = _with_short_intervals(loop, fixed, found)
    if found.gap > gap and can_split(loop):
        # Both bounds together, by scalings for each part of the box of real numbers.
        found = raised(found, partial(split, loop, fixed, aim))
    return found


def _settled(loop: LoopModel, fixed: tuple[bool, ...] | None, found: Bounds) -> Bounds:
    """Search on from a witness while it gets smaller, then bring it to an end of the axis if near.

    A search may stop early where many numbers are nearly as good.
    """
    witness = found.witness
    for _ in range(_AGAIN):
        check_deadline()
        if witness is None:
            return found
        frequency = loop.frequency(witness.at)
        moves = loop.start(frequency)[1] and math.isfinite(frequency)
        near = _from_witness(loop, fixed, witness, witness.at, moves)
        if near is None or near.size >= witness.size * (1 - _EQUAL):
            break
        if not moves and _is_real(witness) and not _is_real(near):
            break
        witness = near
    return replace(found, witness=witness and _at_the_ends(loop, fixed, witness))


def _from_witness(
    loop: LoopModel, fixed: tuple[bool, ...] | None, witness: Witness, at: float, moves: bool
) -> Witness | None:
    """Return what a search finds that begins with a witness, at its angle or at an end beside."""
    structure = loop.structure
    try:
        delta, M = witness.matrix(structure), loop.response(at)[0]
    except np.linalg.LinAlgError:
        return None
    if at != witness.at or (not moves and _is_real(witness)):
        delta, M = np.real(delta), np.real(M)
    w = np.conj(np.linalg.svd(np.eye(len(delta)) - delta @ M)[2][-1]).astype(complex)
    return smallest_delta(structure, loop.response, w, at, moves, np.ones(len(w)), fixed=fixed)


def _at_the_ends(loop: LoopModel, fixed: tuple[bool, ...] | None, witness: Witness) -> Witness:
    """Bring a witness that is all but at rest or at infinity there, where its values are real.

    Its lags would turn phases that are nothing but rounding.
    """
    poles = np.abs(np.linalg.eigvals(loop.model.A)) if loop.model.states else np.zeros(0)
    poles = poles[poles > 0]
    frequency = loop.frequency(witness.at)
    if not poles.size or frequency in (0.0, math.inf):
        return witness
    if poles.min() * _END < frequency < poles.max() / _END:
        return witness
    end = 0.0 if frequency < poles.min() else math.pi / 2
    there = _from_witness(loop, fixed, witness, end, False)
    if there is None or not _is_real(there) or there.size > witness.size * (1 + _BESIDE_END):
        return witness
    return there


def _everywhere(coverage: Coverage, level: float) -> Coverage:
    """Return what is proven if a level is proven over all of the axis."""
    return replace(coverage, level=level, intervals=EVERYWHERE, complete=True)


def _with_short_intervals(loop: LoopModel, fixed: tuple[bool, ...] | None, found: Bounds) -> Bounds:
    """Lower the level by scalings that hold over shorter intervals, if they prove more."""
    near = 0.0 if found.witness is None else 1 / found.witness.size
    fine = cover(loop, Space(loop.structure, fixed or ()), near, loop.seeds())
    better = fine.complete and (not found.coverage.complete or fine.level < found.coverage.level)
    return replace(found, coverage=fine) if better else found


def _by_scalings(loop: LoopModel, fixed: tuple[bool, ...] | None, slack: float) -> Bounds:
    """Bound the peak by scalings that hold over intervals, and by searches from where they end."""
    space = Space(loop.structure, fixed or ())
    found, seeds, scale = None, loop.seeds(), np.ones(loop.structure.shape[1])
    for crossing in () if fixed else ray_crossings(loop)[:_CROSSINGS]:
        start, given = loop.start(crossing.frequency), crossing.deltas
        args = (loop.structure, loop.response, crossing.w, *start, scale, given)
        found = _better(found, smallest_delta(*args))
    if found is not None:
        seeds = [loop.frequency(found.at), *seeds]
    start = 1 / found.size if found else 0.0
    coverage = cover(loop, space, start, seeds, slack)
    branches = can_branch(loop)
    for frequency, _, level in coverage.peaks[:_PEAKS]:
        if found and (branches or coverage.level * found.size <= 1 + _NEAR):
            break
        # Where branching follows, it finds the place, and any witness is enough.
        count = 1 if branches else _DIRECTIONS
        near = _from_peak(loop, space, frequency, level, coverage.level, count)
        found = _better(found, near)
    return Bounds(coverage, found)


def _from_peak(
    loop: LoopModel, space: Space, frequency: float, level: ScaledBound, reached: float, count: int
) -> Witness | None:
    """Return the smallest Delta near what the scalings of a peak say is the worst."""
    inequality = Inequality(space, response(loop.model, frequency)[None])
    scale = space.units(level.x)
    best: Witness | None = None
    angle, ends = loop.angle(frequency), frequency in (0.0, math.inf)
    # At rest and at infinity a stable real system has real values: look there, and nearby.
    near = min(max(angle, _BESIDE), math.pi / 2 - _BESIDE)
    for w in singular_directions(inequality, level.square, level.x, count):
        starts = [(w, near, True)]
        if ends:
            starts = [(np.real(w).astype(complex), angle, False), *starts]
        else:  # a search along the axis may leap off a narrow peak, and end on another
            starts = [*starts, (w, angle, False)]
        for signals, at, moves in starts:
            if best and reached * best.size <= 1 + _NEAR:
                break
            found = smallest_delta(
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
