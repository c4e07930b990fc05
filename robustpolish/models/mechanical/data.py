"""The data of a mechanical model: its parts, checked, with their names, units and matrices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from robustpolish.effects import Effect
from robustpolish.models.mechanical.checks import checked_fields
from robustpolish.models.mechanical.matrices import MechanicalMatrices, assemble
from robustpolish.models.mechanical.parts import (
    UNITS,
    Damper,
    Dof,
    Input,
    Output,
    Spring,
    imposed_by,
)


@dataclass(frozen=True, repr=False)
class MechanicalData:
    """What a `MechanicalModel` consists of; see there for the fields.

    Whatever is computed from a model, shown or written of it, is a function of this class.
    """

    dofs: tuple[Dof, ...]
    springs: tuple[Spring, ...] = ()
    dampers: tuple[Damper, ...] = ()
    inputs: tuple[Input, ...] = ()
    outputs: tuple[Output, ...] = ()
    effects: tuple[Effect, ...] = ()
    spin_frequency: float | None = None
    name: str = ""

    def __post_init__(self) -> None:
        for name, value in checked_fields(vars(self)).items():
            object.__setattr__(self, name, value)

    @cached_property
    def matrices(self) -> MechanicalMatrices:
        """Mass, damping and stiffness matrices, and the rows of the outputs; no effects."""
        return assemble(self.dofs, self.springs, self.dampers, self.inputs, self.outputs)

    def __getstate__(self) -> dict[str, Any]:
        # The cached matrices are made anew where they are needed.
        return {key: value for key, value in self.__dict__.items() if key != "matrices"}

    @property
    def dof_names(self) -> tuple[str, ...]:
        """Names of all coordinates."""
        return tuple(dof.name for dof in self.dofs)

    @property
    def imposed(self) -> tuple[str, ...]:
        """Names of the coordinates whose motion an input imposes."""
        moved = imposed_by(self.inputs)
        return tuple(name for name in self.dof_names if name in moved)

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the coordinates that move by the equations of motion."""
        moved = imposed_by(self.inputs)
        return tuple(name for name in self.dof_names if name not in moved)

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the inputs: data columns."""
        return tuple(item.name for item in self.inputs)

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of the outputs: data columns."""
        return tuple(item.name for item in self.outputs)

    def dof(self, name: str) -> Dof:
        """Return the degree of freedom with this name.

        Parameters
        ----------
        name : str

        Returns
        -------
        Dof
        """
        return self.dofs[self.dof_names.index(name)]

    def is_rotational(self, at: Sequence[str]) -> bool:
        """Return whether a place is an angle.

        Parameters
        ----------
        at : sequence of str
            Names of coordinates, or "ground".

        Returns
        -------
        bool
        """
        return any(dof.rotational for dof in self.dofs if dof.name in at)

    def unit_of(self, item: Input | Output) -> str:
        """Return the SI unit of an input or output of this model, before its gain.

        Parameters
        ----------
        item : Input or Output

        Returns
        -------
        str
        """
        if item.unit is not None:
            return item.unit
        if isinstance(item, Input):
            return UNITS[self.is_rotational(item.on)][item.imposes or "force"]
        return UNITS[self.is_rotational(item.of)][item.quantity]
