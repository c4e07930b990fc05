"""A system that is given and not tuned, as a link of a block."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.arrays import AnyVector as Vector
from robustpolish.models.plant.elements import single_filter
from robustpolish.synthesis.blocks.stage import Stage
from robustpolish.synthesis.problem.matrices import Controller, balanced


@dataclass(frozen=True, eq=False, kw_only=True)
class GivenFilter(Stage):
    """A continuous system with fixed matrices.

    Attributes
    ----------
    A, B, C, D : ndarray
    """

    kind: ClassVar[str] = "given"
    carries: ClassVar[bool] = False

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix

    @classmethod
    def of(cls, system: Any) -> GivenFilter:
        """Take a system or a number.

        Raises
        ------
        InvalidInputError
            If it is no continuous system of one input and one output.
        """
        given = single_filter("blocks", system, 0)
        A, B, C, D = (np.array(getattr(given, name), dtype=float) for name in "ABCD")
        return cls(A=A, B=B.reshape(-1, 1), C=C.reshape(1, -1), D=D.reshape(1, 1))

    @property
    def states(self) -> tuple[str, ...]:
        """Names of x."""
        return tuple(f"x{i + 1}" for i in range(len(self.A)))

    @property
    def formula(self) -> str:
        """Its transfer function in words."""
        return f"a given filter of order {len(self.A)}" if len(self.A) else f"{self.D[0, 0]:g}"

    def matrix(self, values: Vector) -> Matrix:
        """Return [[A, B], [C, D]]."""
        return np.block([[self.A, self.B], [self.C, self.D]])

    def back(self, values: Vector, gradient: Matrix) -> Vector:
        """Return nothing: there are no numbers."""
        return np.zeros(0)

    def in_time(self, unit: float) -> Self:
        """Return the filter in another unit of time, with states of order one."""
        A, B, C, D = balanced(Controller(self.A * unit, self.B * unit, self.C, self.D))
        return replace(self, A=A, B=B, C=C, D=D)
