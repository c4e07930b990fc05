"""Both bounds of a loop's peak: a level over all frequencies, and a Delta that is near it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robustpolish.robust.coverage import Coverage, cover, response
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.rays import Crossing, crossings
from robustpolish.robust.scaled.centre import Level
from robustpolish.robust.scaled.scalings import Inequality, Space
from robustpolish.robust.witness import Witness, directions, smallest

# Crossings, peaks and directions that a search starts from: the first ones are the best nearly
# always, the others are for real numbers, whose searches end in different places.
_CROSSINGS = 4
_PEAKS = 3
_DIRECTIONS = 4
# Relative gap at which no further search is worth it: what intervals need is above.
_NEAR = 1.5e-3
# Angle beside rest and infinity from which a search along the axis begins.
_BESIDE = 1e-3
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


def bounds(loop: LoopModel, fixed: tuple[bool, ...] | None = None) -> Bounds:
    """Bound the peak of the structured singular value of a stable loop from both sides.

    Parameters
    ----------
    loop : LoopModel
    fixed : tuple of bool, optional
        Blocks that have size 1 whatever the level is; none by default.

    Returns
    -------
    Bounds
    """
    structure = loop.structure
    space = Space(structure, fixed or (False,) * len(structure.blocks))
    found = None if fixed else _from_crossings(loop, crossings(loop))
    seeds = loop.seeds()
    if found is not None:
        seeds = [loop.frequency(found.at), *seeds]
    start = 1 / found.size if found else 0.0
    coverage = cover(loop.model, space, start, seeds)
    for frequency, _, level in coverage.peaks[:_PEAKS]:
        if found and coverage.level * found.size <= 1 + _NEAR:
            break
        found = _better(found, _from_peak(loop, space, frequency, level, coverage.level))
    return Bounds(coverage, found)


def _from_crossings(loop: LoopModel, known: list[Crossing]) -> Witness | None:
    """Return the smallest Delta near the crossings of rays."""
    best: Witness | None = None
    scale = np.ones(loop.structure.shape[1])
    for crossing in known[:_CROSSINGS]:
        angle = loop.angle(crossing.frequency)
        moves = crossing.frequency > 1e-7 * loop.rate
        found = smallest(
            loop.structure, loop.response, crossing.w, angle if moves else 0.0, moves, scale,
            crossing.deltas,
        )  # fmt: skip
        best = _better(best, found)
    return best


def _from_peak(
    loop: LoopModel, space: Space, frequency: float, level: Level, reached: float
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
    for w in directions(inequality, level.square, level.x, _DIRECTIONS):
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
