"""The analytic centre of the scalings that prove a level, and the least level that any prove."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from robustpolish.arrays import Vector
from robustpolish.deadline import look_at_the_clock
from robustpolish.robust.scaled.barrier import Barrier
from robustpolish.robust.scaled.scalings import Box, Inequality, Space


@dataclass(frozen=True)
class Effort:
    """How far centres and levels are followed.

    Attributes
    ----------
    steps : int
        Newton steps of one centre; about ten are usual.
    centred : float
        Newton decrement at which a centre is good enough: within 1 a full step is safe.
    levels : int
        Centres on the way to the least level.
    between : float
        Where the next level lies between what the scalings prove and the level that they are the
        centre of: small steps would be safe and slow.
    above : float
        Where the first of these levels lies above what the first scalings prove.
    settled : float
        Relative distance of a level from what its centre proves at which the least one is near:
        it is closer than that times the number of rows, far below the 1e-3 of intervals.
    largest : float
        Bound on G beside D and the gain: the inequality of a single real number has no other.
    """

    steps: int = 40
    centred: float = 0.3
    levels: int = 60
    between: float = 0.1
    above: float = 2.0
    settled: float = 1e-7
    largest: float = 1e3


EFFORT = Effort()


@dataclass(frozen=True, eq=False)
class Level:
    """Scalings and what they prove.

    Attributes
    ----------
    square : float
        The least beta^2 that they prove; infinite for none.
    x : ndarray
        The scalings.
    """

    square: float
    x: Vector


def lowered(inequality: Inequality, start: Level, target: float = 0.0) -> Level:
    """Lower the level until it is below a target, or no lower one is found.

    Parameters
    ----------
    inequality : Inequality
    start : Level
        Scalings with a finite level.
    target : float, optional
        A beta^2 that is low enough.

    Returns
    -------
    Level
        If its square is below the target, the scalings are the centre of those that prove it.
    """
    best, square = start, EFFORT.above * start.square
    walls = Barrier.of_bounds(inequality.space.size, _bounds(inequality))
    for _ in range(EFFORT.levels):
        look_at_the_clock()
        if best.square < target * (1 - 1e-9):
            x = centre(inequality, target, best.x)
            return Level(inequality.least_square(x), x)
        if best.square <= 0 or not np.isfinite(best.square):
            return best
        if square - best.square < EFFORT.settled * best.square:
            return best
        x = centre(inequality, square, best.x)
        found = _further(inequality, Level(inequality.least_square(x), x), best.x, walls)
        best = min(best, found, key=lambda level: level.square)
        square = best.square + EFFORT.between * (square - best.square)
    return best


def _further(inequality: Inequality, found: Level, before: Vector, walls: Barrier) -> Level:
    """Go on in the direction of the last step as long as the level falls, within what bounds it.

    From outside, no centre would be found any more.
    """
    direction, reach = found.x - before, 1.0
    for _ in range(8):
        x = normalised(inequality.space, found.x + reach * direction)
        if x is None or not np.isfinite(walls.value(x)):
            break
        level = inequality.least_square(x)
        if not level < found.square:
            break
        found, reach = Level(level, x), 2 * reach
    return found


def normalised(space: Space, x: Vector) -> Vector | None:
    """Return the scalings with a largest D of 1/2; None if one is not positive."""
    largest = 0.0
    for kind, numbers, units in space.pieces:
        if kind == "D":
            values = np.linalg.eigvalsh(np.tensordot(x[numbers], units, 1))
            if not values[0] > 0:
                return None
            largest = max(largest, float(values[-1]))
    return 0.5 * x / largest


def centre(inequality: Inequality, square: float, x: Vector) -> Vector:
    """Return the analytic centre of the scalings that prove a level, from one that does."""
    barrier = Barrier.of(inequality.coefficients(square), _bounds(inequality))
    value = barrier.value(x)
    if not np.isfinite(value):
        return x
    for _ in range(EFFORT.steps):
        slope, curvature = barrier.derivatives(x)
        # Scalings differ by many orders of magnitude: each number in its own unit.
        units = np.sqrt(np.maximum(np.diagonal(curvature), 1e-300))
        try:
            factor = cho_factor(curvature / np.outer(units, units) + 1e-13 * np.eye(len(x)))
        except (np.linalg.LinAlgError, ValueError):  # not definite, or not even finite
            return x
        step = -cho_solve(factor, slope / units) / units
        decrement = np.sqrt(max(-(slope @ step), 0.0))
        length, moved, trial, after = 1.0, False, x, value
        while length > 1e-6 and not moved:
            trial = x + length * step
            after = barrier.value(trial)
            moved = after < value - 0.1 * length * decrement**2 or (
                decrement < 0.1 and after <= value
            )
            length /= 2
        if not moved:
            return x
        x, value = trial, after
        if decrement < EFFORT.centred:
            return x
    return x


def _bounds(inequality: Inequality) -> tuple[Box, ...]:
    return inequality.space.boxes(EFFORT.largest * (inequality.size or 1.0))


def started(inequality: Inequality) -> Level:
    """Return scalings of a finite level to begin with; of an infinite one if none were found.

    Those that balance M have one, unless the size of some blocks is fixed: then these alone are
    looked at first, and all others are given so small a D that they do not matter.
    """
    space = inequality.space
    held = [k for k, fixed in enumerate(space.fixed) if fixed]
    x = inequality.start()
    if not held:
        return Level(inequality.least_square(x), x)
    inner = lowered(_restricted(inequality, held), _balanced(inequality, held), 1.0)
    if not inner.square < 1:
        return Level(np.inf, x)
    x = np.zeros(space.size)
    first = 0
    for (kind, k), (_, numbers, units) in zip(space.layout, space.pieces, strict=True):
        if k in held:
            count = numbers.stop - numbers.start
            x[numbers] = inner.x[first : first + count]
            first += count
        elif kind == "D":
            x[numbers][: units.shape[1]] = 1.0
    free = [n for (kind, k), (_, n, _) in zip(space.layout, space.pieces, strict=True)
            if kind == "D" and k not in held]  # fmt: skip
    for _ in range(60):
        level, inside = inequality.least_square(x), normalised(space, x)
        if np.isfinite(level) and inside is not None:
            return Level(level, inside)
        for numbers in free:
            x[numbers] *= 0.1
    return Level(np.inf, x)


def _restricted(inequality: Inequality, keep: list[int]) -> Inequality:
    """Return the inequality of some of the blocks, of which none is fixed."""
    structure = inequality.space.structure
    rows = np.concatenate([np.r_[structure.inputs[k]] for k in keep])
    columns = np.concatenate([np.r_[structure.outputs[k]] for k in keep])
    space = Space(structure.only(keep), (False,) * len(keep))
    return Inequality(space, inequality.M[:, rows][:, :, columns])


def _balanced(inequality: Inequality, keep: list[int]) -> Level:
    return started(_restricted(inequality, keep))


def at(inequality: Inequality, level: Level) -> Level:
    """Return what scalings prove of another inequality."""
    return replace(level, square=inequality.least_square(level.x))
