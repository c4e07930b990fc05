"""One link of a block: a small system whose matrices depend on numbers, with their derivatives."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar, Self

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.arrays import AnyVector as Vector
from robustpolish.synthesis.blocks.slot import Slot
from robustpolish.validation import described, invalid


@dataclass(frozen=True, eq=False, kw_only=True)
class Stage(ABC):
    """A system with x' = A x + B e, v = C x + D e, all of it made of numbers.

    Attributes
    ----------
    name : str or None
        Given by the user; otherwise the kind and the signals name it.
    slots : tuple of Slot
        Its numbers.
    inputs, outputs : int
        Sizes of e and v.
    """

    kind: ClassVar[str]
    # Whether its numbers hold a gain from one unit to another; filters keep the unit.
    carries: ClassVar[bool] = True
    # Whether it takes as many signals as the plant has.
    resizable: ClassVar[bool] = False
    # Whether it means the same in discrete time.
    discrete: ClassVar[bool] = False

    name: str | None = None
    slots: tuple[Slot, ...] = ()
    inputs: int = 1
    outputs: int = 1

    @property
    @abstractmethod
    def states(self) -> tuple[str, ...]:
        """Names of x."""

    @property
    def integrators(self) -> tuple[str, ...]:
        """Names of those states that integrate e."""
        return ()

    @property
    @abstractmethod
    def formula(self) -> str:
        """Its transfer function in words."""

    @abstractmethod
    def matrix(self, values: Vector) -> Matrix:
        """Return [[A, B], [C, D]] for the values of the slots."""

    @abstractmethod
    def back(self, values: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over [[A, B], [C, D]] into one over the values of the slots."""

    def sized(self, inputs: int, outputs: int) -> Self:
        """Return the stage for so many signals."""
        if (inputs, outputs) != (self.inputs, self.outputs):
            raise invalid(
                "blocks",
                described(f"a {self.kind} from {inputs} to {outputs} signals"),
                f"{self.inputs} and {self.outputs}",
                "Name one measurement and one control: rp.pid('x', control='F').",
            )
        return self

    def in_time(self, unit: float) -> Self:
        """Return the stage in another unit of time; numbers of slots are converted elsewhere."""
        return self

    def named(self, name: str) -> Self:
        """Return the stage with a name."""
        return replace(self, name=name)
