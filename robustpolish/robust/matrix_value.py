"""What is known of a structured singular value; that of a matrix, by a proof and a witness."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from robustpolish.arrays import AnyMatrix
from robustpolish.display import Card, quantities
from robustpolish.exact.balls import precision
from robustpolish.robust.over_frequency import OverFrequency
from robustpolish.robust.proof import Weights, complex_ball, proves
from robustpolish.robust.scaled.centre import Level, lowered, started
from robustpolish.robust.scaled.scalings import Inequality, Space
from robustpolish.robust.structure import Structure
from robustpolish.robust.witness import Witness, directions, smallest

# Signals from which the lower bound starts: the worst of the upper bound, then mixtures.
_STARTS = 6
_BITS = 160

Status = Literal["bracketed", "wide", "no witness", "zero", "incomplete", "unstable", "marginal"]

_SAYS = {
    "bracketed": "proven above, and reached by the witness",
    "wide": "proven above, and reached by the witness, but farther apart than was asked for",
    "no witness": "proven above; no search found a Delta that makes I - M Delta singular",
    "zero": "no Delta makes I - M Delta singular, whatever its size",
    "incomplete": "not proven: the intervals do not cover the axis",
    "unstable": "M is unstable",
    "marginal": "M has a pole on the boundary of stability",
}


@dataclass(frozen=True, eq=False, repr=False)
class StructuredSingularValue(OverFrequency):
    """Bounds of the structured singular value of a matrix, or of its peak over all frequencies.

    Attributes
    ----------
    lower, upper : float
        The value lies between: 1 / lower is the size of `witness`, and no Delta below 1 / upper
        makes I - M Delta singular, at any frequency.
    witness : ndarray of complex or None
        A Delta of the structure for which I - M Delta is singular, of a system at
        `critical_frequency`; None if none was found.
    proven : bool
        Whether `upper` was proven in ball arithmetic, of a system for all frequencies.
    status : str
        "bracketed" or "no witness" where there are both bounds or none from below; "zero" where
        no Delta makes it singular. Of a system also "wide" where the bounds are farther apart than
        was asked for, "incomplete" where `upper` was not proven,
        and "unstable" or "marginal", with infinite bounds, where M itself is.
    reason : str
        The status in a sentence.
    critical_frequency : float
        In rad/s, where the witness makes a system singular; nan of a matrix or without a witness.
    intervals : tuple of (float, float)
        Frequencies in rad/s over each of which `upper` was proven; they cover the axis. None of a
        matrix.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.structured_singular_value([[0.0, 0.0], [0.0, 0.0]], ["real", "complex"]).status
    'zero'
    """

    lower: float
    upper: float
    witness: AnyMatrix | None
    proven: bool
    status: Status
    critical_frequency: float = math.nan
    intervals: tuple[tuple[float, float], ...] = ()

    @property
    def reason(self) -> str:
        """The status in a sentence."""
        return _SAYS[self.status]

    def _shown(self) -> tuple[str, tuple[float, float], float]:
        return self._drawn, (self.lower, self.upper), self.critical_frequency

    def _card(self) -> Card:
        rows = [("at least", self.lower), ("at most", self.upper), ("proven", self.proven)]
        if not math.isnan(self.critical_frequency):
            rows.insert(2, ("critical frequency [rad/s]", self.critical_frequency))
        title = f"Structured singular value: {self.status}"
        return Card(title, (quantities(*rows),), (self.reason,))


def matrix_value(M: AnyMatrix, structure: Structure) -> StructuredSingularValue:
    """Bound the structured singular value of a matrix that fits the structure.

    Parameters
    ----------
    M : ndarray of complex, shape (nz, nw)
    structure : Structure

    Returns
    -------
    StructuredSingularValue
    """
    space = Space(structure, (False,) * len(structure.blocks))
    size = float(np.linalg.norm(M, 2))
    if size == 0:
        return StructuredSingularValue(0.0, 0.0, None, True, "zero")
    unit = float(np.exp2(np.round(np.log2(size))))
    inequality = Inequality(space, (M / unit)[None])
    level = lowered(inequality, started(inequality))
    witness = worst_delta(structure, inequality, level)
    upper, proven = _proven(M / unit, space, level)
    lower = 1 / witness.size if witness else 0.0
    return StructuredSingularValue(
        lower * unit,
        upper * unit,
        witness.matrix(structure) / unit if witness else None,
        proven,
        "bracketed" if witness else "no witness",
    )


def worst_delta(structure: Structure, inequality: Inequality, level: Level) -> Witness | None:
    """Return the smallest Delta that a few searches find for one matrix."""
    M = inequality.M[0]
    still = np.zeros_like(M)
    Dz = inequality.space.matrices(level.x)[2]
    scale = 1 / np.sqrt(np.maximum(np.real(np.diagonal(Dz)), 1e-300))
    scale = scale / scale.max()
    best: Witness | None = None
    for w in directions(inequality, level.square, level.x, _STARTS):
        found = smallest(structure, lambda _: (M, still), w, 0.0, False, scale)
        if found and (best is None or found.size < best.size):
            best = found
        if best and 1 / best.size >= math.sqrt(max(level.square, 0.0)) * (1 - 1e-4):
            break
    return best


def _proven(M: AnyMatrix, space: Space, level: Level) -> tuple[float, bool]:
    """Widen the level until ball arithmetic agrees."""
    beta = math.sqrt(max(level.square, 0.0)) or 1e-12
    for slack in (1e-10, 1e-8, 1e-6, 1e-4):
        upper = beta * (1 + slack)
        weights = Weights.of(space, level.x, upper)
        with precision(_BITS):
            if weights and proves(complex_ball(M), weights):
                return upper, True
    return beta, False
