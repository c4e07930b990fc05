"""Which numbers of a model are fitted, in which units, between which bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robustpolish.effects import Effect
from robustpolish.identification.fit.chains import connected
from robustpolish.identification.fit.units_of_force import units_of_force
from robustpolish.models.mechanical import MechanicalModel

Array = NDArray[np.float64]

MASS_PRIOR = 0.05
GAIN_PRIOR = 0.05
SPRING_PRIOR = 0.3
DAMPER_PRIOR = 1.0
NOTHING = 1e-6


@dataclass(frozen=True)
class FreeParameter:
    """A number of a model that a fit may change.

    Attributes
    ----------
    key : str
        As in `MechanicalModel.parameters`.
    start, scale : float
        First value, and the unit in which the fit counts.
    lower, upper : float
        Bounds.
    prior : float
        Standard deviation of what is known about it beforehand, about `centre`;
        infinite if nothing is known.
    centre : float
    """

    key: str
    start: float
    scale: float
    lower: float
    upper: float
    prior: float = np.inf
    centre: float = 0.0

    @property
    def is_effect(self) -> bool:
        """Whether it belongs to an effect."""
        return self.key.startswith("effect[")


def free_parameters(
    model: MechanicalModel, bandwidth: float, reference: MechanicalModel | None = None
) -> list[FreeParameter]:
    """Return the parameters of a model that are fitted.

    Parameters
    ----------
    model : MechanicalModel
    bandwidth : float
        Excited bandwidth in rad/s; gives zero stiffness and damping a scale.
    reference : MechanicalModel, optional
        The model before any fit, about which the priors are centred.
    """
    known = (reference or model).parameters
    free = set(model.free)
    driven = {o.of[0] for o in model.outputs if o.drive}
    result = []
    mass = float(np.mean([d.mass for d in model.dofs if d.mass > 0] or [1.0]))
    given = units_of_force(model)
    for dof in model.dofs:
        if (dof.name in free or dof.name in driven) and dof.name not in given:
            key = f"dof.{dof.name}.{'inertia' if dof.rotational else 'mass'}"
            result.append(_near(key, dof.mass, known.get(key, dof.mass), MASS_PRIOR))
    for i, spring in enumerate(model.springs):
        key = f"spring[{i}].stiffness"
        natural = mass * bandwidth**2
        result.append(_elastic(key, spring.stiffness, known.get(key, 0.0), natural))
    for i, damper in enumerate(model.dampers):
        key = f"damper[{i}].damping"
        natural = 0.02 * mass * bandwidth
        result.append(_elastic(key, damper.damping, known.get(key, 0.0), natural))
    for item in model.inputs:
        if item.imposes is None and not _is_gauge(model, item.name):
            key = f"input.{item.name}.gain"
            result.append(_near(key, item.gain, known.get(key, item.gain), GAIN_PRIOR))
    for i, added in enumerate(model.effects):
        effect = Effect(added.kind, added.at, added.parameters)
        for parameter in effect.definition.parameters:
            asked = parameter.name in added.parameters
            if parameter.fitted and asked:
                result.append(_effect(i, effect, parameter.name))
    return result


def _is_gauge(model: MechanicalModel, name: str) -> bool:
    """Return whether a gain only scales masses and springs: the only input of its chain."""
    for group in connected(model):
        inputs = [i.name for i in model.inputs if i.imposes is None and i.on[0] in group]
        if name in inputs:
            return len(inputs) == 1
    return True


def _near(key: str, value: float, centre: float, share: float) -> FreeParameter:
    """Describe a number that is known rather well."""
    low, high = sorted((0.4 * centre, 2.5 * centre))
    prior = share * abs(centre)
    return FreeParameter(key, value, abs(centre) or 1.0, low, high, prior, centre)


def _elastic(key: str, value: float, centre: float, natural: float) -> FreeParameter:
    """Describe a stiffness or damping: it may be far off, and keeps its sign."""
    scale = abs(value) or natural
    if abs(centre) <= NOTHING * natural:  # as good as none: it may well be missing
        return FreeParameter(key, value, natural, 0.0, np.inf)
    low, high = (0.0, np.inf) if centre > 0 else (-np.inf, 0.0)
    share = SPRING_PRIOR if key.startswith("spring") else DAMPER_PRIOR
    prior = share * abs(centre)
    return FreeParameter(key, value, scale, low, high, prior, centre)


def _effect(i: int, effect: Effect, name: str) -> FreeParameter:
    parameter = effect.definition.parameter(name)
    value = effect.values[name]
    lower, upper = parameter.lower, parameter.upper
    if name == "gap" and lower < 0:
        lower, upper = (0.0, upper) if value >= 0 else (lower, 0.0)
    if name == "velocity" and value > 0:  # a corner much sharper than the data shows is none
        lower, upper = 0.2 * value, 6 * value
    if name == "static_force" and "force" in effect.values:
        lower = min(0.95 * effect.values["force"], value)
    scale = abs(value) or 1.0
    if parameter.dimension == "rad":
        scale = 1.0
    if name == "frequency":
        scale = 1e-3 * abs(value)
    return FreeParameter(f"effect[{i}].{name}", value, scale, lower, upper)


def unit_of(model: MechanicalModel, key: str) -> str:
    """Return the SI unit of a parameter of a model."""
    if key.startswith("dof."):
        return model.dof(key.removeprefix("dof.").rsplit(".", 1)[0]).unit
    if key.startswith("input."):
        return "1"
    index = int(key[key.index("[") + 1 : key.index("]")])
    name = key.rsplit(".", 1)[1]
    if key.startswith("effect"):
        return effect_unit(model, model.effects[index].kind, model.effects[index].at, name)
    parts = model.springs if key.startswith("spring") else model.dampers
    rotational = is_rotational(model, parts[index].between)
    plain = "N m/rad" if rotational else "N/m"
    return plain if key.startswith("spring") else ("N m s/rad" if rotational else "N s/m")


def is_rotational(model: MechanicalModel, at: tuple[str, ...]) -> bool:
    """Return whether a place is an angle."""
    return any(model.dof(name).rotational for name in at if name in model.dof_names)


def effect_unit(model: MechanicalModel, kind: str, at: tuple[str, ...], name: str) -> str:
    """Return the SI unit of an effect's parameter at a place of a model."""
    parameter = Effect(kind, at).definition.parameter(name)
    if parameter.dimension == "signal":
        output = next(o for o in model.outputs if o.name == at[0])
        return model.unit_of(output)
    return parameter.unit(is_rotational(model, at))
