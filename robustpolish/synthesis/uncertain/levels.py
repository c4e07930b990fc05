"""The level that the best scalings prove, frequency by frequency, and where to look."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from robustpolish.arrays import AnyArray, Array, Vector
from robustpolish.robust.scaled.centre import Level, at, lowered, started
from robustpolish.robust.scaled.scalings import Inequality, Space
from robustpolish.robust.structure import Structure

# Frequencies per decade, and how far they reach beyond the rates of the loop.
_DENSITY = 9.0
_BEYOND = 30.0


@dataclass(frozen=True, eq=False)
class Levels:
    """What scalings prove at frequencies.

    Attributes
    ----------
    omega : ndarray, shape (k,)
    values : ndarray, shape (k,)
        beta at each; infinite where none was found.
    found : tuple of Level
    space : Space
    """

    omega: Vector
    values: Vector
    found: tuple[Level, ...]
    space: Space

    @property
    def peak(self) -> float:
        """The largest."""
        return float(self.values.max())

    def diagonals(self) -> Array:
        """Return the square roots of the diagonal of D per copy, the last one 1; shape (k, n)."""
        rows = []
        for level in self.found:
            row = []
            for kind, numbers, units in self.space.pieces:
                if kind == "D":
                    D = np.tensordot(level.x[numbers], units, 1)
                    row += np.sqrt(np.real(np.diag(D))).tolist()
            rows.append(np.array(row) / row[-1])
        return np.array(rows)


def levels(structure: Structure, omega: Vector, M: AnyArray, best: bool = True) -> Levels:
    """Find scalings at each frequency: the best ones, or quickly those that balance M.

    Parameters
    ----------
    structure : Structure
    omega : ndarray, shape (k,)
    M : ndarray of complex, shape (k, nz, nw)
    best : bool, optional
        Neighbours then help each other.
    """
    space = Space(structure, (False,) * len(structure.blocks))
    found: list[Level] = []
    for one in M:
        inequality = Inequality(space, one[None])
        if not best:
            found.append(started(inequality))
            continue
        starts = [started(inequality), *(at(inequality, Level(0.0, f.x)) for f in found[-1:])]
        start = min(starts, key=lambda level: level.square)
        found.append(lowered(inequality, start) if math.isfinite(start.square) else start)
    values = np.array([math.sqrt(max(level.square, 0.0)) for level in found])
    return Levels(omega, values, tuple(found), space)


def grid(poles: Iterable[AnyArray], more: Iterable[float] = ()) -> Vector:
    """Return frequencies that cover the rates of the poles, those of each, 0 and infinity."""
    rates = np.abs(np.concatenate([np.asarray(p) for p in poles]))
    rates = rates[rates > 0]
    low, high = (rates.min(), rates.max()) if len(rates) else (1.0, 1.0)
    low, high = max(low, 1e-9 * high) / _BEYOND, high * _BEYOND
    count = math.ceil(_DENSITY * math.log10(high / low))
    found = np.concatenate([np.geomspace(low, high, count), rates[rates > low], list(more)])
    found = found[np.isfinite(found) & (found > 0)]
    kept: list[float] = []
    for omega in np.sort(found):
        if not kept or omega > kept[-1] * 1.02:
            kept.append(float(omega))
    return np.array([0.0, *kept, np.inf])
