"""The numbers of a mechanical model by key, for fits that change them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from robustpolish.validation import described, invalid

if TYPE_CHECKING:
    from robustpolish.models.mechanical import MechanicalModel


def values(model: MechanicalModel) -> dict[str, float]:
    """Every number of the model by its key."""
    result: dict[str, float] = {}
    for dof in model.dofs:
        result[_mass_key(dof.name, dof.rotational)] = dof.mass
    for i, spring in enumerate(model.springs):
        result[f"spring[{i}].stiffness"] = spring.stiffness
    for i, damper in enumerate(model.dampers):
        result[f"damper[{i}].damping"] = damper.damping
    for item in model.inputs:
        result[f"input.{item.name}.gain"] = item.gain
    for i, effect in enumerate(model.effects):
        for name, value in effect.values.items():
            result[f"effect[{i}].{name}"] = value
    return result


def replaced(model: MechanicalModel, changes: Mapping[str, float]) -> MechanicalModel:
    """Return `model` with the numbers of `changes` instead of its own."""
    known = values(model)
    for key in changes:
        if key not in known:
            raise invalid(
                "values",
                key,
                "a key of model.parameters",
                described("Choose one of " + ", ".join(known) + "."),
            )
    new = {**known, **changes}
    return replace(
        model,
        dofs=tuple(replace(d, mass=new[_mass_key(d.name, d.rotational)]) for d in model.dofs),
        springs=tuple(
            replace(spring, stiffness=new[f"spring[{i}].stiffness"])
            for i, spring in enumerate(model.springs)
        ),
        dampers=tuple(
            replace(damper, damping=new[f"damper[{i}].damping"])
            for i, damper in enumerate(model.dampers)
        ),
        inputs=tuple(replace(item, gain=new[f"input.{item.name}.gain"]) for item in model.inputs),
        effects=tuple(
            replace(
                effect, parameters={name: new[f"effect[{i}].{name}"] for name in effect.parameters}
            )
            for i, effect in enumerate(model.effects)
        ),
    )


def _mass_key(name: str, rotational: bool) -> str:
    return f"dof.{name}.{'inertia' if rotational else 'mass'}"
