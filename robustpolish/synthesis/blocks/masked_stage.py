"""A link whose numbers are the free entries of its matrix."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.arrays import AnyVector as Vector
from robustpolish.synthesis.blocks.stage import Stage


@dataclass(frozen=True, eq=False, kw_only=True)
class MaskedStage(Stage):
    """A stage with one number for each free entry of [[A, B], [C, D]], row by row."""

    @property
    @abstractmethod
    def mask(self) -> NDArray[np.bool_]:
        """Free entries of [[A, B], [C, D]]; the others are zero."""

    def matrix(self, values: Vector) -> Matrix:
        """Return [[A, B], [C, D]]."""
        M = np.zeros(self.mask.shape)
        M[self.mask] = values
        return M

    def back(self, values: Vector, gradient: Matrix) -> Vector:
        """Return the free entries of the gradient."""
        return gradient[self.mask]
