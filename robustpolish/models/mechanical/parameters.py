"""The numbers of a mechanical model by key, for fits that change them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeVar

from robustpolish.effects import Effect
from robustpolish.models.mechanical.data import MechanicalData
from robustpolish.validation import described, invalid

Model = TypeVar("Model", bound=MechanicalData)


def values(model: MechanicalData) -> dict[str, float]:
    """Every number of the model by its key."""
    result: dict[str, float] = {}
    for dof in model.dofs:
        result[".".join(dof.key)] = dof.mass
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


def replaced(model: Model, changes: Mapping[str, float]) -> Model:
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
        dofs=tuple(replace(d, mass=new[".".join(d.key)]) for d in model.dofs),
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
            effect.with_values({name: new[f"effect[{i}].{name}"] for name in effect.parameters})
            for i, effect in enumerate(model.effects)
        ),
    )


def unit_of(model: MechanicalData, key: str) -> str:
    """Return the SI unit of the number with a key of :func:`values`."""
    if key.startswith("dof."):
        return model.dof(key.removeprefix("dof.").rsplit(".", 1)[0]).unit
    if key.startswith("input."):
        return "1"
    index, name = int(key[key.index("[") + 1 : key.index("]")]), key.rsplit(".", 1)[1]
    if key.startswith("effect"):
        return effect_unit(model, model.effects[index], name)
    if key.startswith("spring"):
        return "N m/rad" if model.is_rotational(model.springs[index].between) else "N/m"
    return "N m s/rad" if model.is_rotational(model.dampers[index].between) else "N s/m"


def effect_unit(model: MechanicalData, effect: Effect, name: str) -> str:
    """Return the SI unit of a parameter of an effect at its place in a model."""
    parameter = effect.definition.parameter(name)
    if parameter.dimension == "signal":
        signals = (*model.inputs, *model.outputs)
        return model.unit_of(next(item for item in signals if item.name == effect.at[0]))
    return parameter.unit(model.is_rotational(effect.at))
