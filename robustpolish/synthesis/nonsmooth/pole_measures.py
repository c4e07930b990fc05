"""Functions of the closed-loop poles, with gradients over K, and the worst of several functions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.long_calls import step_cost
from robustpolish.synthesis.nonsmooth.problem import ActivePiece, Measure
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.static_loop import close_static

# Distance of one pole from its region (negative inside), and the derivative of the
# distance over the pole's real and imaginary part, packed as a complex number.
Distance = Callable[[complex], tuple[float, complex]]


@dataclass(frozen=True, eq=False)
class RegionMeasure:
    """Largest distance of the closed-loop poles from a region; negative inside.

    Attributes
    ----------
    loop : PlantMatrices
    distance : callable
        pole -> (distance, derivative over real part + 1j times that over imaginary part).
    scale : float
        What distances are divided by, to be without a unit.
    """

    loop: PlantMatrices
    distance: Distance
    scale: float = 1.0

    @property
    def work(self) -> float:
        """Work of one evaluation: eigenvalues are a small part of that of a norm."""
        return 0.1 * step_cost(self.loop.nx)

    def pieces(self, K: Matrix, width: float, frequencies: Sequence[float]) -> list[ActivePiece]:
        """Return one piece for each pole (pair) near the worst."""
        closed = close_static(self.loop, K)
        if closed is None or not np.isfinite(closed.A).all():
            return []
        found = np.linalg.eig(closed.A)
        values, right = np.asarray(found[0], complex), np.asarray(found[1], complex)
        try:
            left = np.linalg.inv(right)
        except np.linalg.LinAlgError:
            left = np.linalg.pinv(right)
        marks = [self.distance(complex(v)) for v in values]
        sizes = np.array([mark[0] for mark in marks]) / self.scale
        worst = sizes.max()
        pieces = []
        for i in np.argsort(-sizes):
            if np.imag(values[i]) < 0 or sizes[i] < worst - width:
                continue
            into, outof = left[i] @ self.loop.B2, self.loop.C2 @ right[:, i]
            slope = (np.conj(marks[i][1]) * np.outer(into, outof)).real / self.scale
            pieces.append(ActivePiece(float(sizes[i]), closed.back(slope)))
            if width == 0:
                break
        return pieces


@dataclass(frozen=True, eq=False)
class StabilityMeasure(RegionMeasure):
    """Spectral abscissa, or in discrete time the spectral radius less one."""

    @classmethod
    def of(cls, loop: PlantMatrices, scale: float = 1.0) -> StabilityMeasure:
        """Measure how far the poles are inside the stable region."""
        return cls(loop, _radius if loop.discrete else _abscissa, scale)


@dataclass(frozen=True, eq=False)
class WorstMeasure:
    """The largest of several measures; infinite where one of them is."""

    measures: tuple[Measure, ...]

    @property
    def work(self) -> float:
        """Work of one evaluation: of all of them."""
        return sum(measure.work for measure in self.measures)

    def pieces(self, K: Matrix, width: float, frequencies: Sequence[float]) -> list[ActivePiece]:
        """Return the pieces of all measures, the largest first."""
        found = [measure.pieces(K, width, frequencies) for measure in self.measures]
        if not all(found):
            return []
        return sorted((p for pieces in found for p in pieces), key=lambda piece: -piece.value)


def _abscissa(pole: complex) -> tuple[float, complex]:
    return pole.real, 1.0 + 0j


def _radius(pole: complex) -> tuple[float, complex]:
    size = abs(pole)
    return size - 1, pole / size if size > 0 else 1.0 + 0j
