"""Springs and dampers between places of a machine, instead of a controller."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import control
import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.arrays import AnyVector as Vector
from robustpolish.long_calls import Budget
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.nonsmooth import FrobeniusMeasure, PositiveElements
from robustpolish.synthesis.problem.decoupling import PlantPart, named_controller
from robustpolish.synthesis.problem.passive_element import PassiveElement, Place
from robustpolish.synthesis.problem.scaling import ScaledPlant, scale_plant
from robustpolish.synthesis.structured_search.policy import POLICY
from robustpolish.synthesis.structured_search.starts import KnownStarts
from robustpolish.synthesis.structured_search.structure import (
    Norm,
    PartDesign,
    PartProblem,
    Structure,
)

GROUND = "ground"


@dataclass(frozen=True, eq=False)
class Mechanics:
    """Which states are displacements, which are their velocities, and which forces act there."""

    plant: GeneralizedPlant
    velocity: Mapping[str, int]
    force: Mapping[str, int]

    @classmethod
    def of(cls, plant: GeneralizedPlant) -> Mechanics:
        """Read the places of a machine off its matrices."""
        A, B = plant.A, plant.B2
        velocity: dict[str, int] = {}
        force: dict[str, int] = {}
        for i, name in enumerate(plant.states):
            into = np.flatnonzero(A[i])
            if len(into) != 1 or A[i, into[0]] != 1 or into[0] == i or B[i].any():
                continue
            velocity[name] = int(into[0])
            for j in range(plant.nu):
                if B[into[0], j] > 0 and np.count_nonzero(B[:, j]) == 1:
                    force[name] = j
        return cls(plant, velocity, force)

    def gain(self, kind: str, place: Place) -> Matrix:
        """Return the state feedback of one element with coefficient 1."""
        nx = self.plant.nx
        apart = np.zeros(nx)
        for name, sign in zip(place, (1.0, -1.0), strict=True):
            if name != GROUND:
                at = self.plant.states.index(name) if kind == "spring" else self.velocity[name]
                apart[at] = sign
        F = np.zeros((self.plant.nu, nx))
        for name, sign in zip(place, (-1.0, 1.0), strict=True):
            if name != GROUND:
                F[self.force[name]] += sign * apart
        return F

    def unit(self, kind: str, place: Place) -> str:
        """Return the unit of a coefficient."""
        name = next(n for n in place if n != GROUND)
        of_u = self.plant.units.get(self.plant.control_names[self.force[name]], "N")
        of_q = self.plant.units.get(name, "m")
        return f"{of_u}/{of_q}" if kind == "spring" else f"{of_u} s/{of_q}"


@dataclass(frozen=True, eq=False)
class PassiveStructure(Structure):
    """Coefficients of springs and dampers, not negative.

    Attributes
    ----------
    norm : {"hinf", "h2"}
    mechanics : Mechanics
    wanted : sequence of (kind, place)
    limits : ndarray
        Largest coefficient of each; infinite for none.
    """

    norm: Norm
    mechanics: Mechanics
    wanted: Sequence[tuple[str, Place]]
    limits: Vector
    method: ClassVar[str] = "passive"

    @cached_property
    def elements(self) -> Matrix:
        """State feedback of each element with coefficient 1."""
        return np.array([self.mechanics.gain(kind, place) for kind, place in self.wanted])

    @property
    def joined(self) -> Matrix:
        """Which controls the elements join to which states."""
        return (self.elements != 0).any(axis=0)

    def problem(self, part: PlantPart) -> PartProblem | None:
        """State the search over the coefficients in one part; see :meth:`Structure.problem`."""
        members, local = self._within(part)
        if not members:
            return None
        scaled = scale_plant(part.plant)
        size, limits = _sizes(scaled, local), self.limits[members]
        u, y = scaled.control[:, None], scaled.measurement
        top = np.minimum(np.log(limits / size), POLICY.highest)
        bottom = np.minimum(np.full(len(size), np.log(POLICY.nothing)), top - 1.0)
        levels = [np.full(len(size), level) for level in (0.0, -3.0, 3.0, -8.0, 8.0)]
        return PartProblem(
            scaled=scaled,
            norm=self.norm,
            order=0,
            parametrisation=PositiveElements(size[:, None, None] * local * y / u),
            starts=(KnownStarts([*levels, top, bottom]), _DrawnCoefficients(len(size))),
            what="choice of springs and dampers",
            effort=POLICY.passive,
            bounds=(bottom, top),
            open_ended=np.isinf(limits),
            size=FrobeniusMeasure(),
            slack=POLICY.passive_slack,
            extra=local.tobytes() + limits.tobytes(),
        )

    def join(
        self,
        plant: GeneralizedPlant,
        parts: Sequence[PlantPart],
        designs: Sequence[PartDesign | None],
    ) -> tuple[control.StateSpace, dict[str, Any]]:
        """Return the state feedback that all elements amount to, and list them."""
        coefficients = np.zeros(len(self.wanted))
        for part, found in zip(parts, designs, strict=True):
            if found is not None:
                members, local = self._within(part)
                used = found.point > np.log(2 * POLICY.nothing)
                coefficients[members] = np.exp(found.point) * _sizes(found.scaled, local) * used
        F = np.tensordot(coefficients, self.elements, axes=1)
        none = np.zeros
        named = named_controller(plant, none((0, 0)), none((0, plant.nx)), none((plant.nu, 0)), F)
        elements = tuple(
            PassiveElement(kind, place, float(value), self.mechanics.unit(kind, place))
            for (kind, place), value in zip(self.wanted, coefficients, strict=True)
        )
        return named, {"elements": elements}

    def _within(self, part: PlantPart) -> tuple[list[int], Matrix]:
        """Return which elements act in a part, and their gains there."""
        own = self.elements[:, *np.ix_(part.controls, part.measurements)]
        members = [i for i, E in enumerate(own) if E.any()]
        return members, own[members]


@dataclass(frozen=True)
class _DrawnCoefficients:
    """Logarithms of random coefficients, without an end."""

    count: int

    def propose(
        self, earlier: Sequence[Vector], budget: Budget, rng: np.random.Generator
    ) -> Iterator[Vector]:
        """Propose coefficients from next to nothing to very hard."""
        while True:
            yield rng.uniform(-10.0, 10.0, self.count)


def _sizes(scaled: ScaledPlant, elements: Matrix) -> Vector:
    """Return for each element the coefficient that is 1 in scaled units."""
    u, y = scaled.control[:, None], scaled.measurement
    return np.array([1 / np.abs(E * y / u).max() for E in elements])
