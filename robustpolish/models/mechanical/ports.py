"""Where effects pull on a mechanical model, and what they need to know of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from robustpolish.arrays import Array
from robustpolish.effects import GROUND, Effect, Motion
from robustpolish.models.mechanical.data import MechanicalData
from robustpolish.models.mechanical.matrices import MechanicalMatrices, incidence
from robustpolish.models.mechanical.parts import FORCE, Output

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
    matrices: MechanicalMatrices,
    outputs: tuple[Output, ...],
    pairs: tuple[tuple[_Pair, ...], ...],
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
