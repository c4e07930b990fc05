"""Where effects pull on a mechanical model, and what they need to know of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from robustpolish.arrays import Array
from robustpolish.effects import GROUND, Effect, Motion
from robustpolish.models.mechanical.data import MechanicalData
from robustpolish.models.mechanical.matrices import incidence
from robustpolish.models.mechanical.parts import FORCE


def port_row(model: MechanicalData, at: tuple[str, ...]) -> Array:
    """Return the row that gives the relative displacement at a pair from all coordinates."""
    return incidence(model.dof_names, at)


def port_rows(model: MechanicalData, effect: Effect) -> Array:
    """Return one row per port of an effect."""
    return np.array([port_row(model, ends[:1] if ends[-1] == GROUND else ends)
                     for ends in port_pairs(effect)])  # fmt: skip


def port_pairs(effect: Effect) -> list[tuple[str, ...]]:
    """Return the two ends of each port of an effect."""
    channels = [(name, GROUND) for name, _ in effect.definition.channels]
    if effect.definition.domain == "pair":
        return [effect.at, *channels]
    return [*((name, GROUND) for name in effect.at), *channels]


def port_matrices(
    model: MechanicalData, rows: Array, pairs: list[tuple[str, ...]]
) -> tuple[Array, Array, tuple[Array, Array, Array, Array]]:
    """Return G, H and the motion map of forces along `rows` of the coordinates.

    `pairs` names the ends of each row; a force output between the same ends measures the
    force there.
    """
    m = model.matrices
    Lq, Lv, Rq, Rv = m.motion_map()
    nf = len(m.free)
    acceleration = m.inverse_mass @ rows.T[m.free]
    G = np.vstack([np.zeros((nf, len(rows))), acceleration])
    H = m.Sa[:, m.free] @ acceleration
    for i, output in enumerate(model.outputs):
        if output.quantity != FORCE:
            continue
        if output.drive:
            H[i] -= rows[:, model.dof_names.index(output.of[0])]
            continue
        here = port_row(model, output.of)
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
    rows = [port_rows(model, effect) for effect in effects]
    pairs = [pair for effect in effects for pair in port_pairs(effect)]
    stacked = np.vstack([np.zeros((0, len(model.dofs))), *rows])
    return EffectPorts(effects, rows, *port_matrices(model, stacked, pairs))


def dynamic_effects(model: MechanicalData) -> list[tuple[int, Effect]]:
    """Return the effects that make forces, with their positions in the model."""
    return [(i, e) for i, e in enumerate(model.effects) if e.definition.law is not None]


def context_values(model: MechanicalData, effect: Effect, step: float) -> list[float]:
    """Return what an effect's law needs to know of the model, in the order it asked for."""
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
