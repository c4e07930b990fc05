"""A mechanical model with its effects as a linear system with nonlinear ports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numba
import numpy as np
from numba.typed import List as TypedList
from numpy.typing import NDArray

from robustpolish.effects import Effect, compiled_law
from robustpolish.effects.base import law_signature
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical_parts import FORCE
from robustpolish.simulation.nonlinear_step import StepMatrices, step_matrices

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class NonlinearSystem:
    """``s' = A s + B w + G f``, ``y = C s + D w + H f`` with port forces f of the effects.

    States s are the free displacements, then their velocities; signals w are those of
    `MechanicalMatrices.signals`; ``motion`` = (Qs, Qw, Vs, Vw) gives the relative
    displacements ``Qs s + Qw w`` and velocities ``Vs s + Vw w`` at the ports.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    G: Array
    H: Array
    motion: tuple[Array, Array, Array, Array]
    effects: tuple[Effect, ...]
    layout: NDArray[np.int64]
    values: Array
    internal: int

    @cached_property
    def laws(self) -> Any:
        """The compiled laws, as a Numba list."""
        laws = TypedList.empty_list(numba.types.FunctionType(law_signature()))
        for effect in self.effects:
            laws.append(compiled_law(effect.definition))
        return laws

    @property
    def states(self) -> int:
        """Number of states without the internal ones."""
        return self.A.shape[0]

    def steps(self, step: float) -> StepMatrices:
        """Return the transition matrices of a substep."""
        return step_matrices(self.A, self.B, self.G, step)


def port_row(model: MechanicalModel, at: tuple[str, ...]) -> Array:
    """Return the row that gives the relative displacement at a pair from all coordinates."""
    names = model.dof_names
    row = np.zeros(len(names))
    for name, sign in zip(at, (1.0, -1.0), strict=False):
        if name in names:
            row[names.index(name)] += sign
    return row


def port_rows(model: MechanicalModel, effect: Effect) -> Array:
    """Return one row per port of an effect."""
    if effect.definition.domain == "axes":
        return np.array([port_row(model, (name,)) for name in effect.at])
    return port_row(model, effect.at)[None]


def port_pairs(effect: Effect) -> list[tuple[str, ...]]:
    """Return the two ends of each port of an effect."""
    if effect.definition.domain == "pair":
        return [effect.at]
    return [(name, "ground") for name in effect.at]


def port_matrices(
    model: MechanicalModel, rows: Array, pairs: list[tuple[str, ...]]
) -> tuple[Array, Array, tuple[Array, Array, Array, Array]]:
    """Return G, H and the motion map of forces along `rows` of the coordinates.

    `pairs` names the ends of each row; a force output between the same ends measures the
    force there.
    """
    m = model.matrices
    Lq, Lv, Rq, Rv = m.motion_map()
    nf = len(m.free)
    minv = 1 / np.diag(m.M)[m.free]
    acceleration = minv[:, None] * rows.T[m.free]
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


def dynamic_effects(model: MechanicalModel) -> list[tuple[int, Effect]]:
    """Return the effects that make forces, with their positions in the model."""
    placed = [(i, Effect(e.kind, e.at, e.parameters)) for i, e in enumerate(model.effects)]
    return [(i, e) for i, e in placed if e.definition.law is not None]


def build_system(model: MechanicalModel, step: float) -> NonlinearSystem:
    """Build the system of a model, for substeps of `step` seconds."""
    system = model.state_space()
    effects = [effect for _, effect in dynamic_effects(model)]
    rows, pairs, layout, values = [], [], [], []
    port = state = parameter = 0
    for effect in effects:
        kind = effect.definition
        here = port_rows(model, effect)
        p = [*effect.values.values(), *context_values(model, effect, step)]
        rows.append(here)
        pairs += port_pairs(effect)
        layout.append((port, kind.ports, state, kind.states, parameter, len(p)))
        values += p
        port, state, parameter = port + kind.ports, state + kind.states, parameter + len(p)
    stacked = np.vstack(rows) if rows else np.zeros((0, len(model.dofs)))
    G, H, motion = port_matrices(model, stacked, pairs)
    return NonlinearSystem(
        *(np.ascontiguousarray(getattr(system, name), dtype=float) for name in "ABCD"),
        G=np.ascontiguousarray(G),
        H=np.ascontiguousarray(H),
        motion=tuple(np.ascontiguousarray(part) for part in motion),  # type: ignore[arg-type]
        effects=tuple(effects),
        layout=np.array(layout, dtype=np.int64).reshape(-1, 6),
        values=np.array(values, dtype=float),
        internal=state,
    )


def context_values(model: MechanicalModel, effect: Effect, step: float) -> list[float]:
    """Return what an effect's law needs to know of the model, in the order it asked for."""
    found = context_of(model, effect.at, step)
    return [found[name] for name in effect.definition.context]


def context_of(model: MechanicalModel, at: tuple[str, ...], step: float) -> Mapping[str, float]:
    """Return spring stiffness, spin frequency (rad/s) and mobility (s/kg) at a place."""
    ends = {*at, "ground"} if len(at) == 1 else set(at)
    stiffness = sum(s.stiffness for s in model.springs if set(s.between) == ends)
    free = set(model.free)
    inverse_mass = sum(1 / model.dof(name).mass for name in at if name in free)
    return {
        "spring_stiffness": float(stiffness),
        "spin_frequency": 2 * np.pi * (model.spin_frequency or 0.0),
        "mobility": step * inverse_mass,
    }
