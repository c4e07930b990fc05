"""Where effects can act, and the forces they would make along a known motion."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from robustpolish.arrays import Array
from robustpolish.effects import Effect, EffectKind, Motion, Shape, shapes_along
from robustpolish.identification.fit.parameters import connected
from robustpolish.identification.observer.kalman import force_sites
from robustpolish.identification.observer.missing_force import Smoothed, known_forces
from robustpolish.identification.record import Record
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.ports import motion_at, port_pairs, port_rows


@dataclass(frozen=True, eq=False)
class Columns:
    """Candidate columns: forces along rows, or additions to outputs."""

    kind: EffectKind
    at: tuple[str, ...]
    shape: Shape
    rows: Array | None
    pairs: list[tuple[str, ...]]
    values: Array


def places(model: MechanicalModel, kind: EffectKind) -> list[tuple[str, ...]]:
    """Return where a kind of effect can act in a model."""
    channels = model.channels
    free, all_names = model.free, [name for name in model.dof_names if name not in channels]
    if not set(dict(kind.channels)) <= set(model.imposed):
        return []
    if kind.domain == "input":
        return [(i.name,) for i in model.inputs if i.imposes is None]
    if kind.domain == "output":
        return [(o.name,) for o in model.outputs]
    if kind.domain == "dof":
        return [(name,) for name in free]
    if kind.domain == "axes":
        return _axes(model)
    _, sites = force_sites(model)
    found: list[tuple[str, ...]] = []
    for name in all_names:
        if name in free or (name, "ground") in sites:
            found.append((name, "ground"))
    found += [s.between for s in model.springs if "ground" not in s.between]
    found += [d.between for d in model.dampers if "ground" not in d.between]
    found += [s for s in sites if "ground" not in s]
    for i, a in enumerate(all_names):
        found += [(b, a) for b in all_names[i + 1 :] if a in free or b in free]
    unique: dict[frozenset[str], tuple[str, ...]] = {}
    turning = {dof.name: dof.rotational for dof in model.dofs}
    for pair in found:
        if turning.get(pair[0], turning.get(pair[1])) != turning.get(pair[1], turning.get(pair[0])):
            continue  # a displacement less an angle, which an inertia may couple, is no motion
        unique.setdefault(frozenset(pair), (pair[0], pair[1]))
    if "spring_stiffness" in kind.context:
        springs = {frozenset(s.between) for s in model.springs}
        return [pair for key, pair in unique.items() if key in springs or _slips(model, pair)]
    return list(unique.values())


def _axes(model: MechanicalModel) -> list[tuple[str, ...]]:
    """Return pairs of coordinates that can be two axes of one body: of different chains, if any."""
    groups = connected(model)
    free = model.free
    joined = {frozenset(p.between) for p in (*model.springs, *model.dampers)}
    pairs: list[tuple[str, ...]] = [(a, b) for i, a in enumerate(free) for b in free[i + 1 :]]
    pairs = [pair for pair in pairs if frozenset(pair) not in joined]
    if len(groups) > 1:
        pairs = [p for p in pairs if not any(set(p) <= group for group in groups)]
    return pairs


def columns_at(
    model: MechanicalModel,
    kind: EffectKind,
    at: tuple[str, ...],
    motion: Smoothed,
    record: Record,
) -> list[Columns]:
    """Return the candidate columns of a kind at a place, none if one of its family is there."""
    here = [e.definition for e in model.effects if set(e.at) == set(at)]
    if any(e.kind == kind.kind or rivals(e, kind) for e in here):
        return []
    if kind.domain in ("input", "output"):
        return _signal_columns(model, kind, at, motion, record.time)
    effect = Effect.of(kind, at)
    # along a known motion no step has to be resolved
    here = motion_at(model, effect, record.time, motion.q, motion.v)
    if not here.q.any():
        return []
    _, sites = force_sites(model)
    force = None
    if kind.domain == "dof" and (at[0], "ground") in sites:
        force = motion.force[sites.index((at[0], "ground"))][None]
    if "clearance" in dict(kind.gives) and _slips(model, at):
        return _clearances(model, kind, at, motion, record)
    rows, pairs = port_rows(model, effect), port_pairs(effect)
    return [
        Columns(kind, at, shape, rows, pairs, shape.columns)
        for shape in shapes_along(kind, replace(here, force=force))
    ]


def rivals(one: EffectKind, other: EffectKind) -> bool:
    """Return whether a place has at most one of two kinds."""
    return bool(one.family) and one.family == other.family and one.domain == other.domain


def _slips(model: MechanicalModel, at: tuple[str, ...]) -> bool:
    """Return whether an effect at a place asks for the clearance there."""
    return any("clearance" in e.definition.context and set(e.at) == set(at) for e in model.effects)


def _clearances(
    model: MechanicalModel,
    kind: EffectKind,
    at: tuple[str, ...],
    motion: Smoothed,
    record: Record,
) -> list[Columns]:
    """Return what clearances would change about the forces of the effects that are there."""
    along = (motion.q, motion.v, record.time, record.dt)
    base = known_forces(model, *along)
    amplitude = float(np.percentile(np.abs(port_rows(model, Effect.of(kind, at)) @ motion.q), 95))
    name, found = kind.parameters[0].name, []
    # with a clearance, the elastic part has to be stiffer than it seemed without
    for share, ratio in itertools.product((0.03, 0.07, 0.15, 0.3, 0.5), (1.0, 2.0)):
        gap = share * amplitude
        stiffer = _stiffer(model, at, ratio)
        moved = known_forces(stiffer.with_effect(kind.kind, at, {name: gap}), *along)
        if base is None or moved is None:
            return []
        change = moved.values.copy()
        change[: len(base.values)] -= base.values
        shape = Shape(change[None], lambda c, g=gap: {name: g}, (1,))
        found.append(Columns(kind, at, shape, moved.rows, moved.pairs, change[None]))
    return found


def _stiffer(model: MechanicalModel, at: tuple[str, ...], ratio: float) -> MechanicalModel:
    """Return the model with stiffer elements that ask for the clearance at a place."""
    changes = {
        f"effect[{i}].stiffness": ratio * e.values["stiffness"]
        for i, e in enumerate(model.effects)
        if "clearance" in e.definition.context and set(e.at) == set(at) and "stiffness" in e.values
    }
    return model.with_parameters(changes)


def _signal_columns(
    model: MechanicalModel, kind: EffectKind, at: tuple[str, ...], motion: Smoothed, time: Array
) -> list[Columns]:
    """Return the columns of an effect on an input or an output."""
    found = []
    if kind.domain == "input":
        m = model.matrices
        j = m.force_inputs.index(at[0])
        u = motion.inputs[:, j]
        du = CubicSpline(time, u)(time, 1)
        ends = [(name, "ground") for name in model.dof_names]
        for shape in shapes_along(kind, Motion(time, u[None], du[None])):
            forces = m.B[:, j][None, :, None] * shape.columns
            found.append(Columns(kind, at, shape, np.eye(len(m.B)), ends, forces))
        return found
    i = model.output_names.index(at[0])
    y = motion.outputs[:, i]
    for shape in shapes_along(kind, Motion(time, y[None], np.gradient(y, time)[None])):
        full = np.zeros((len(shape.columns), len(model.outputs), len(time)))
        full[:, i] = shape.columns[:, 0]
        found.append(Columns(kind, at, shape, None, [], full))
    return found
