"""The data of a mechanical model: its parts, checked, with names, units, matrices and numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple, TypeVar

import numpy as np

from robustpolish.base.arrays import Array
from robustpolish.base.checks import described, invalid
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.kind import GROUND, Motion
from robustpolish.machines.mechanical.parts import (
    CONNECTIONS,
    DISPLACEMENT,
    FORCE,
    UNITS,
    CoupledInertia,
    Damper,
    Dof,
    Input,
    MechanicalMatrices,
    Output,
    Spring,
    assemble,
    check_inertias,
    checked_fields,
    imposed_by,
    incidence,
    number,
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
    coupled_inertias: tuple[CoupledInertia, ...] = ()
    design: Mapping[str, Any] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        for name, value in checked_fields(vars(self)).items():
            object.__setattr__(self, name, value)

    @cached_property
    def matrices(self) -> MechanicalMatrices:
        """Mass, damping and stiffness matrices, and the rows of the outputs; no effects."""
        return assemble(
            self.dofs, self.springs, self.dampers, self.inputs, self.outputs, self.coupled_inertias
        )

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
    def channels(self) -> tuple[str, ...]:
        """Names of the coordinates that are no motion but a measured signal, which effects read.

        An input imposes them in a unit of its own, such as V, and nothing holds them.
        """
        held = {name for part in (*self.springs, *self.dampers) for name in part.between}
        held |= {name for output in self.outputs for name in output.of}
        return tuple(
            item.on[0]
            for item in self.inputs
            if item.imposes == DISPLACEMENT and item.on[0] not in held and item.gain == 1
            and item.unit not in (None, UNITS[self.is_rotational(item.on)][DISPLACEMENT])
        )  # fmt: skip

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


Model = TypeVar("Model", bound=MechanicalData)
Part = TypeVar("Part", Dof, Input)


def values(model: MechanicalData) -> dict[str, float]:
    """Every number of the model by its key."""
    result: dict[str, float] = {}
    for dof in model.dofs:
        result[".".join(dof.key)] = dof.mass
    for what, (_, name) in CONNECTIONS.items():
        for i, part in enumerate(getattr(model, f"{what}s")):
            result[f"{what}[{i}].{name}"] = getattr(part, name)
    for item in model.inputs:
        result[f"input.{item.name}.gain"] = item.gain
    for i, effect in enumerate(model.effects):
        for name, value in effect.values.items():
            result[f"effect[{i}].{name}"] = value
    return result


def with_parameter_values(model: Model, changes: Mapping[str, float]) -> Model:
    """Return `model` with the numbers of `changes` instead of its own."""
    known = values(model)
    for key in changes:
        if key not in known:
            remedy = described("Choose one of " + ", ".join(known) + ".")
            raise invalid("values", key, "a key of model.parameters", remedy)
    # fits ask thousands of times a second: what stays is neither made nor checked again
    new = {k: v for k, v in changes.items() if type(v) is not float or v != known[k]}
    found = copy(model)
    for name, part in {
        "dofs": tuple(_with(d, "mass", ".".join(d.key), new) for d in model.dofs),
        **{
            f"{what}s": _each_with(model, what, name, new)
            for what, (_, name) in CONNECTIONS.items()
        },
        "inputs": tuple(_with(i, "gain", f"input.{i.name}.gain", new) for i in model.inputs),
        "effects": tuple(
            _effect_with(e, f"effect[{i}].", new) for i, e in enumerate(model.effects)
        ),
        "design": dict(model.design),
    }.items():
        object.__setattr__(found, name, part)
    check_inertias(found.dofs, found.coupled_inertias, imposed_by(found.inputs))
    if "matrices" in vars(model) and all(key.startswith("effect") for key in new):
        vars(found)["matrices"] = model.matrices
    return found


def _with(part: Part, name: str, key: str, new: Mapping[str, float]) -> Part:
    """Return a part with its number, whose key is `key`, as it stands in `new`, if it does."""
    return replace(part, **{name: new[key]}) if key in new else part


def _each_with(
    model: MechanicalData, what: str, name: str, new: Mapping[str, float]
) -> tuple[Any, ...]:
    """Return parts with their numbers as they stand in `new`; these parts check none themselves."""
    found = list(getattr(model, f"{what}s"))
    for i, part in enumerate(found):
        if (key := f"{what}[{i}].{name}") in new:
            found[i] = replace(part, **{name: number((what, i, name), new[key])})
    return tuple(found)


def _effect_with(effect: Effect, prefix: str, new: Mapping[str, float]) -> Effect:
    own = {k.removeprefix(prefix): v for k, v in new.items() if k.startswith(prefix)}
    return effect.with_parameters(**own) if own else effect


# Least energy, as a share of that without couplings, that a fit leaves every motion.
_LEFT = 1e-3


def definite_coupling_share(model: MechanicalData, changes: Mapping[str, float]) -> float:
    """Return the share of all coupled inertias with which every motion has a kinetic energy.

    Parameters
    ----------
    model : MechanicalData
    changes : mapping of str to float
        Numbers instead of the model's own.

    Returns
    -------
    float
        1 if they can stay as they are.
    """
    new = {**values(model), **changes}
    free = {name: new[".".join(model.dof(name).key)] for name in model.free}
    names = list(free)
    N = np.zeros((len(names), len(names)))
    for k, coupled in enumerate(model.coupled_inertias):
        a, b = coupled.between
        if a in free and b in free:
            i, j = names.index(a), names.index(b)
            N[i, j] += new[f"coupled_inertia[{k}].value"] / np.sqrt(free[a] * free[b])
            N[j, i] = N[i, j]
    least = float(np.min(np.linalg.eigvalsh(N), initial=0.0))
    return min(1.0, (1 - _LEFT) / -least) if least < 0 else 1.0


def unit_of(model: MechanicalData, key: str) -> str:
    """Return the SI unit of the number with a key of :func:`values`."""
    if key.startswith("dof."):
        return model.dof(key.removeprefix("dof.").rsplit(".", 1)[0]).unit
    if key.startswith("input."):
        return "1"
    index, name = int(key[key.index("[") + 1 : key.index("]")]), key.rsplit(".", 1)[1]
    if key.startswith("effect"):
        return effect_unit(model, model.effects[index], name)
    if key.startswith("coupled"):
        turning = sum(model.dof(end).rotational for end in model.coupled_inertias[index].between)
        return ("kg", "kg m", "kg m^2")[turning]
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


# Where effects pull on a mechanical model, and what they need to know of it.

_Pair = tuple[str, ...]
_PortMatrices = tuple[Array, Array, tuple[Array, Array, Array, Array]]


def port_row(model: MechanicalData, at: tuple[str, ...]) -> Array:
    """Return the row that gives the relative displacement at a pair from all coordinates."""
    return incidence(model.dof_names, at)


def port_rows(model: MechanicalData, effect: Effect) -> Array:
    """Return one row per port of an effect, read-only."""
    return _rows(model.dof_names, tuple(port_pairs(effect)))


@lru_cache(maxsize=256)
def _rows(names: tuple[str, ...], pairs: tuple[_Pair, ...]) -> Array:
    ends = (pair[:1] if pair[-1] == GROUND else pair for pair in pairs)
    found = np.array([incidence(names, pair) for pair in ends])
    found.flags.writeable = False
    return found


def port_pairs(effect: Effect) -> list[_Pair]:
    """Return the two ends of each port of an effect."""
    definition = effect.definition
    channels = [(name, GROUND) for name, _ in definition.channels]
    if definition.domain == "pair":
        return [effect.at, *channels]
    return [*((name, GROUND) for name in effect.at), *channels]


def port_matrices(model: MechanicalData, rows: Array, pairs: Sequence[_Pair]) -> _PortMatrices:
    """Return G, H and the motion map of forces along `rows` of the coordinates.

    `pairs` names the ends of each row; a force output between the same ends measures the
    force there.
    """
    return _port_matrices(model.matrices, model.outputs, rows, pairs)


def _port_matrices(
    m: MechanicalMatrices, outputs: Sequence[Output], rows: Array, pairs: Sequence[_Pair]
) -> _PortMatrices:
    Lq, Lv, Rq, Rv = m.motion_map
    nf = len(m.free)
    acceleration = m.inverse_mass @ rows.T[m.free]
    G = np.vstack([np.zeros((nf, len(rows))), acceleration])
    H = m.Sa[:, m.free] @ acceleration
    for i, output in enumerate(outputs):
        if output.quantity != FORCE:
            continue
        if output.drive:
            H[i] -= rows[:, m.coordinates.index(output.of[0])]
            continue
        here = incidence(m.coordinates, output.of)
        for j, pair in enumerate(pairs):
            if set(pair) == set(output.of):
                H[i, j] -= np.sign(here @ rows[j])
    return G, H, (rows @ Lq, rows @ Rq, rows @ Lv, rows @ Rv)


class EffectPorts(NamedTuple):
    """The effects of a model that make forces, and where.

    Attributes
    ----------
    effects : list of Effect
    rows : list of ndarray
        Of each effect one row per port: relative displacements from all coordinates.
    G, H, motion
        See :func:`port_matrices`, for the ports of all effects together.
    """

    effects: list[Effect]
    rows: list[Array]
    G: Array
    H: Array
    motion: tuple[Array, Array, Array, Array]


def effect_ports(model: MechanicalData) -> EffectPorts:
    """Return the effects that make forces with their ports."""
    effects = [effect for _, effect in dynamic_effects(model)]
    pairs = tuple(tuple(port_pairs(effect)) for effect in effects)
    rows, (G, H, motion) = _ports_at(model.matrices, model.outputs, pairs)
    return EffectPorts(effects, list(rows), G, H, motion)


@lru_cache(maxsize=32)
def _ports_at(
    matrices: MechanicalMatrices, outputs: tuple[Output, ...], pairs: tuple[tuple[_Pair, ...], ...]
) -> tuple[tuple[Array, ...], _PortMatrices]:
    """Return the rows and matrices of effects at these places; fits vary their numbers only."""
    rows = tuple(_rows(matrices.coordinates, each) for each in pairs)
    stacked = np.vstack([np.zeros((0, len(matrices.coordinates))), *rows])
    ends = [pair for each in pairs for pair in each]
    return rows, _port_matrices(matrices, outputs, stacked, ends)


def dynamic_effects(model: MechanicalData) -> list[tuple[int, Effect]]:
    """Return the effects that make forces, with their positions in the model."""
    return [(i, e) for i, e in enumerate(model.effects) if e.definition.law is not None]


def context_values(model: MechanicalData, effect: Effect, step: float) -> list[float]:
    """Return what an effect's law needs to know of the model, in the order it asked for."""
    if not effect.definition.context:
        return []
    found = context_of(model, effect.at, step)
    return [found[name] for name in effect.definition.context]


def context_of(model: MechanicalData, at: tuple[str, ...], step: float) -> Mapping[str, float]:
    """Return what effects at a place may ask of their model, see `EffectKind.context`."""
    ends = {*at, "ground"} if len(at) == 1 else set(at)
    stiffness = sum(s.stiffness for s in model.springs if set(s.between) == ends)
    # how easily the place gives way to equal forces on its ends
    pushed = np.abs([float(name in at) for name in model.free])
    inverse_mass = float(np.diag(model.matrices.inverse_mass) @ pushed)
    found = {
        "clearance": 0.0,
        "spring_stiffness": float(stiffness),
        "spin_frequency": 2 * np.pi * (model.spin_frequency or 0.0),
        "mobility": step * inverse_mass,
        "step": step,
    }
    for effect in model.effects:
        if set(effect.at) == ends:
            for name, parameter in effect.definition.gives:
                found[name] = found.get(name, 0.0) + effect.values[parameter]
    return found


def motion_at(
    model: MechanicalData, effect: Effect, time: Array, q: Array, v: Array, step: float = 0.0
) -> Motion:
    """Return what an effect sees of a motion at its place.

    Parameters
    ----------
    model : MechanicalData
    effect : Effect
    time : ndarray, shape (samples,)
    q, v : ndarray, shape (coordinates, samples)
        Displacements and velocities of all coordinates.
    step : float, optional
        Time step that a law has to resolve; along a known motion it is none.
    """
    rows = port_rows(model, effect)
    return Motion(time, rows @ q, rows @ v, context_of(model, effect.at, step))
