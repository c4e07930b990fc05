"""The plant as the engines see it: continuous, scaled, without D22; and the way back."""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np

from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.problem.bilinear import to_continuous, to_discrete
from robustpolish.synthesis.problem.decoupling import named_controller
from robustpolish.synthesis.problem.matrices import (
    Controller,
    Matrix,
    PlantMatrices,
    balanced,
    shift,
)
from robustpolish.synthesis.problem.scaling import ScaledPlant, scale_plant


@dataclass(frozen=True, eq=False)
class SolverPlant:
    """A plant prepared for an engine.

    Attributes
    ----------
    original : GeneralizedPlant
        In its own units, continuous or discrete.
    scaled : ScaledPlant
        The same, or its continuous-time image, before and after scaling.
    matrices : PlantMatrices
        The scaled matrices without D22.
    feedback : ndarray, shape (nu, ny)
        A static controller that was closed around a discrete-time plant before it was mapped.
    """

    original: GeneralizedPlant
    scaled: ScaledPlant
    matrices: PlantMatrices
    feedback: Matrix

    @classmethod
    def of(cls, plant: GeneralizedPlant, mapped: bool) -> SolverPlant:
        """Prepare a plant.

        Parameters
        ----------
        plant : GeneralizedPlant
        mapped : bool
            Whether to map a discrete-time plant to continuous time, which keeps the H-infinity
            norm but not the H2 norm.
        """
        feedback = np.zeros((plant.nu, plant.ny))
        image = plant
        if plant.is_discrete and mapped:
            image, feedback = to_continuous(plant)
        scaled = scale_plant(image)
        return cls(plant, scaled, PlantMatrices.of(scaled.plant).without_d22(), feedback)

    def norm(self, value: float, kind: str = "hinf") -> float:
        """Return a norm of the scaled loop in the plant's units."""
        return self.scaled.norm(value, kind)

    def controller(self, K: Controller) -> control.StateSpace | None:
        """Return a controller in the plant's units; None if its loop is not well posed."""
        shifted = shift(K, self.scaled.plant.D22)
        if shifted is None:
            return None
        found = self.scaled.controller(control.StateSpace(*shifted, remove_useless_states=False))
        final: Controller | None = Controller(
            *map(np.asarray, (found.A, found.B, found.C, found.D))
        )
        if self.original.is_discrete and not self.scaled.original.is_discrete:
            final = to_discrete(final, self.feedback, self.original.D22)
        if final is None or not all(np.isfinite(M).all() for M in final):
            return None
        return named_controller(self.original, *balanced(final))
