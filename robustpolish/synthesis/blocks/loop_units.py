"""Units that suit a loop: frequencies at which it may cross over, and gains that do it there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.synthesis.blocks.placement import PlacedBlock
from robustpolish.synthesis.blocks.slot import Slot
from robustpolish.synthesis.problem.matrices import PlantMatrices

# A mode counts if its part of the response from u to y is not below this share of the largest:
# the modes of weights and of what nobody measures do not belong to the loop.
_VISIBLE = 1e-9
# How far beyond the modes of the plant a loop may cross over.
_BELOW, _ABOVE = 30.0, 10.0


@dataclass(frozen=True, eq=False)
class LoopUnits:
    """What numbers of blocks are measured by.

    Attributes
    ----------
    plant : PlantMatrices
        Scaled, continuous.
    frequency : float
        In rad/s of the scaled plant; 0 for the middle of :attr:`band`.
    """

    plant: PlantMatrices
    frequency: float = 0.0

    @cached_property
    def band(self) -> tuple[float, float]:
        """The lowest and the highest frequency at which the loop may cross over."""
        P = self.plant
        if not P.nx:
            return 1 / _BELOW, _ABOVE
        found = np.linalg.eig(P.A)
        poles, right = np.asarray(found[0]), np.asarray(found[1])
        left = np.linalg.pinv(right)
        part = np.linalg.norm(left @ P.B2, axis=1) * np.linalg.norm(P.C2 @ right, axis=0)
        size = np.abs(poles)
        kept = (part > _VISIBLE * part.max()) & (size > 1e-6 * size.max(initial=0.0))
        if not kept.any():
            return 1 / _BELOW, _ABOVE
        return float(size[kept].min()) / _BELOW, float(size[kept].max()) * _ABOVE

    @property
    def middle(self) -> float:
        """The frequency that sizes belong to."""
        return self.frequency or float(np.sqrt(self.band[0] * self.band[1]))

    @cached_property
    def response(self) -> Matrix:
        """The response from u to y there."""
        P = self.plant
        pencil = 1j * self.middle * np.eye(P.nx) - P.A
        try:
            return np.abs(P.C2 @ np.linalg.solve(pencil, P.B2) + P.D22)
        except np.linalg.LinAlgError:
            return np.ones((P.ny, P.nu))

    def size(self, block: PlacedBlock, stage: int, slot: Slot) -> float:
        """Return the number that matters in the loop at that frequency, in scaled units."""
        rate = self.middle ** (-slot.time)
        if slot.out is None or stage != block.carrier:
            return rate
        gain = float(np.linalg.norm(self.response[block.read[:, None], block.driven]))
        return rate / gain if gain > 0 else rate
