"""Loops parallel to an edge: lines of equal distance from it."""

from __future__ import annotations

from collections.abc import Callable

import contourpy
import numpy as np
from numpy.typing import ArrayLike

from robustpolish.brush.surfaces.polished_surface import Floats
from robustpolish.validation import described, invalid

_GRID = 240  # places along the longer side
_SHORTEST = 3.0  # loops shorter than so many steps are left out

Distance = Callable[[ArrayLike, ArrayLike], Floats]


def loops(
    distance: Distance,
    area: tuple[tuple[float, float], tuple[float, float]],
    step: float,
    margin: float,
) -> Floats:
    """Return loops at distances margin, margin + step, ... from the edge as one line, shape (n, 2).

    Each loop begins where it is next to the end of the one before. Where the area inside falls
    into parts, the nearest one is next.
    """
    (west, east), (south, north) = area
    spacing = max(east - west, north - south) / _GRID
    x = np.linspace(west, east, max(8, round((east - west) / spacing)) + 1)
    y = np.linspace(south, north, max(8, round((north - south) / spacing)) + 1)
    far = distance(x[:, None], y[None, :])
    deepest = float(np.max(far))
    if not deepest > margin:
        shown = described(f"{margin:g} m, but no place is more than {deepest:.3g} m from the edge")
        raise invalid("margin", shown, "less than that", "Take a smaller brush or a larger mould.")
    line = np.empty((0, 2))
    drawn = contourpy.contour_generator(x, y, far.T)
    for level in np.arange(margin, deepest, step):
        found = [np.array(part) for part in drawn.lines(level)]
        left = [part for part in found if _length(part) > _SHORTEST * step and _closed(part)]
        while left:
            nearest = min(range(len(left)), key=lambda k: _gap(line, left[k]))
            line = np.concatenate([line, _from_nearest(line, left.pop(nearest))])
    if len(line) < 4:
        shown = described(f"{step:g} m, with no loop longer than {_SHORTEST:g} steps")
        raise invalid("step", shown, "steps smaller than the mould", "Lower step or margin.")
    return line


def _length(part: Floats) -> float:
    return float(np.sum(np.hypot(*np.diff(part, axis=0).T)))


def _closed(part: Floats) -> bool:
    return bool(np.allclose(part[0], part[-1]))


def _gap(line: Floats, part: Floats) -> float:
    return 0.0 if not len(line) else float(np.min(np.hypot(*(part - line[-1]).T)))


def _from_nearest(line: Floats, part: Floats) -> Floats:
    """Return a closed loop that begins and ends next to the end of the line."""
    if not len(line):
        return part
    first = int(np.argmin(np.hypot(*(part[:-1] - line[-1]).T)))
    turned = np.roll(part[:-1], -first, axis=0)
    return np.concatenate([turned, turned[:1]])
