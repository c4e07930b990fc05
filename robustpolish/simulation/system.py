"""A mechanical model with its effects as a linear system with nonlinear ports."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numba
import numpy as np
from numba.typed import List as TypedList
from numpy.typing import NDArray

from robustpolish.effects import Effect, compiled_law
from robustpolish.effects.kind import law_signature
from robustpolish.models.mechanical import MechanicalModel
from robustpolish.models.mechanical.ports import context_of as context_of
from robustpolish.models.mechanical.ports import context_values as context_values
from robustpolish.models.mechanical.ports import dynamic_effects as dynamic_effects
from robustpolish.models.mechanical.ports import port_matrices as port_matrices
from robustpolish.models.mechanical.ports import port_pairs as port_pairs
from robustpolish.models.mechanical.ports import port_row as port_row
from robustpolish.models.mechanical.ports import port_rows as port_rows
from robustpolish.simulation.step import StepMatrices, step_matrices

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
    nw = len(model.matrices.signals)  # python-control keeps a column where there is no input
    A, B, C, D = (np.asarray(getattr(system, name), dtype=float) for name in "ABCD")
    return NonlinearSystem(
        A=np.ascontiguousarray(A.reshape(len(A), len(A))),
        B=np.ascontiguousarray(B[:, :nw].reshape(len(A), nw)),
        C=np.ascontiguousarray(C[:, : len(A)]),
        D=np.ascontiguousarray(D[:, :nw]),
        G=np.ascontiguousarray(G),
        H=np.ascontiguousarray(H),
        motion=tuple(np.ascontiguousarray(part) for part in motion),  # type: ignore[arg-type]
        effects=tuple(effects),
        layout=np.array(layout, dtype=np.int64).reshape(-1, 6),
        values=np.array(values, dtype=float),
        internal=state,
    )
