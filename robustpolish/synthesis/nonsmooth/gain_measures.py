"""Functions of the gain K itself, with gradients over K."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.synthesis.nonsmooth.problem import ActivePiece


@dataclass(frozen=True, eq=False)
class GainMeasure:
    """Largest singular value of left K right: the gain in the plant's own units.

    Attributes
    ----------
    left, right : ndarray
        Undo the scaling of u and y; zero rows leave parts of K out.
    """

    left: Matrix
    right: Matrix

    @property
    def work(self) -> float:
        """Work of one evaluation: next to nothing."""
        return 0.1

    def pieces(self, K: Matrix, width: float, frequencies: Sequence[float]) -> list[ActivePiece]:
        """Return one piece for each singular value near the largest."""
        factors = np.linalg.svd(self.left @ K @ self.right, full_matrices=False)
        U, sigma, Vh = (np.asarray(M, float) for M in factors)
        found = []
        for i in range(len(sigma)):
            if i > 0 and (width == 0 or sigma[i] < sigma[0] * (1 - width)):
                break
            slope = np.outer(self.left.T @ U[:, i], Vh[i] @ self.right.T)
            found.append(ActivePiece(float(sigma[i]), slope))
        return found


@dataclass(frozen=True, eq=False)
class FrobeniusMeasure:
    """Root of the sum of squares of K."""

    @property
    def work(self) -> float:
        """Work of one evaluation: next to nothing."""
        return 0.1

    def pieces(self, K: Matrix, width: float, frequencies: Sequence[float]) -> list[ActivePiece]:
        """Return the one piece."""
        size = float(np.linalg.norm(K))
        return [ActivePiece(size, K / size if size > 0 else np.zeros_like(K))]
