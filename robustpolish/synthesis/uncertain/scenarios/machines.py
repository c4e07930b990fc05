"""The machines of an uncertain plant: at given values, at the corners, and farther out."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import control
import numpy as np

from robustpolish.arrays import Vector
from robustpolish.errors import InvalidInputError
from robustpolish.models import GeneralizedPlant
from robustpolish.models.uncertain.elements import RealElement
from robustpolish.models.uncertain.system import UncertainSystem
from robustpolish.robust.over_frequency import machine_at

Values = Mapping[str, Any]

# Real numbers of which all corners are looked at, and how many are drawn of more.
_NUMBERS = 7
_DRAWN = 2**_NUMBERS


@dataclass(frozen=True, eq=False)
class Machines:
    """The machines within the bounds of an uncertain plant.

    Attributes
    ----------
    system : UncertainSystem
        Its last outputs are measurements, its last inputs controls.
    ny, nu : int
    """

    system: UncertainSystem
    ny: int
    nu: int

    @cached_property
    def numbers(self) -> tuple[RealElement, ...]:
        """The real numbers among what is uncertain."""
        return tuple(e for e in self.system.elements.values() if isinstance(e, RealElement))

    @cached_property
    def nominal(self) -> GeneralizedPlant:
        """The plant with every delta 0."""
        return self._plant(self.system.nominal)

    def at(self, values: Values, omega: float = math.nan) -> GeneralizedPlant | None:
        """Return a machine; None where the plant is not well posed.

        Parameters
        ----------
        values : mapping of str to float, complex or control.StateSpace
            As a witness has them. What is not named is nominal.
        omega : float, optional
            In rad/s, where complex numbers have their values.
        """
        step = self.system.dt
        own = 0.0 if not step else 1.0 if step is True else float(step)
        try:
            found = machine_at(self.system, values, omega, own)
        except InvalidInputError:
            return None
        return self._plant(found.nominal if isinstance(found, UncertainSystem) else found)

    def corners(self) -> list[dict[str, float]]:
        """Return the values of the real numbers at the corners, or at some of very many.

        Of an ellipsoid they are the points whose directions are all of one size.
        """
        n = len(self.numbers)
        if not n:
            return []
        signs: list[Any] = list(itertools.product((-1.0, 1.0), repeat=n)) if n <= _NUMBERS else []
        if not signs:
            drawn = np.random.default_rng(0).choice([-1.0, 1.0], size=(_DRAWN, n))
            signs = drawn.tolist()
        members = [e.group for e in self.numbers]
        sizes = [1 / math.sqrt(members.count(g)) if g else 1.0 for g in members]
        return [self.values(np.array(one) * sizes) for one in signs]

    def values(self, deltas: Vector) -> dict[str, float]:
        """Return the real numbers at deltas."""
        return {e.name: e.value(float(d)) for e, d in zip(self.numbers, deltas, strict=True)}

    def deltas(self, values: Values) -> Vector:
        """Return the deltas of the real numbers."""
        return np.array([e.delta(values.get(e.name, e.nominal)) for e in self.numbers])

    def outward(self, values: Values) -> dict[str, Any]:
        """Return values with the real numbers moved outward to the bounds."""
        deltas = self.deltas(values)
        sizes = [abs(d) for d, e in zip(deltas, self.numbers, strict=True) if not e.group]
        for group in {e.group for e in self.numbers if e.group}:
            own = [d for d, e in zip(deltas, self.numbers, strict=True) if e.group == group]
            sizes.append(math.hypot(*own))
        largest = max(sizes, default=0.0)
        return {**values, **self.values(deltas / largest)} if largest > 0 else dict(values)

    def _plant(self, machine: Any) -> GeneralizedPlant:
        if not isinstance(machine, control.StateSpace):
            machine = control.StateSpace([], [], [], np.atleast_2d(machine), 0)
        return GeneralizedPlant(machine, self.ny, self.nu)
