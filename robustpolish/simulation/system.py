"""A mechanical model with its effects as a linear system with nonlinear ports."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robustpolish.arrays import Array
from robustpolish.effects import Effect, compiled_law
from robustpolish.models.mechanical.data import MechanicalData
from robustpolish.models.mechanical.ports import (
    context_values,
    dynamic_effects,
    effect_ports,
    port_rows,
)
from robustpolish.simulation.step import Ahead, ahead, step_matrices

_MOST_SUBSTEPS = 32
_FADING = 4.0


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
    def laws(self) -> tuple[Any, ...]:
        """The compiled laws; their addresses hold as long as they are kept here."""
        return tuple(compiled_law(effect.definition) for effect in self.effects)

    @cached_property
    def addresses(self) -> NDArray[np.int64]:
        """Where the compiled laws are in memory."""
        return np.array([law.address for law in self.laws], dtype=np.int64)

    @property
    def states(self) -> int:
        """Number of states without the internal ones."""
        return self.A.shape[0]

    def steps(self, step: float) -> Ahead:
        """Return the matrices of a substep."""
        matrices = (self.A, self.B, self.G, *self.motion)
        parts = tuple((part.shape, part.tobytes()) for part in matrices)
        return _known_steps(parts, step)


@lru_cache(maxsize=64)
def _known_steps(parts: tuple[tuple[tuple[int, ...], bytes], ...], step: float) -> Ahead:
    """Return the matrices of a substep; fits ask again and again, with other forces only."""
    A, B, G, *motion = (np.frombuffer(data).reshape(shape) for shape, data in parts)
    return ahead(step_matrices(A, B, G, step), motion)


def build_system(model: MechanicalData, step: float) -> NonlinearSystem:
    """Build the system of a model, for substeps of `step` seconds."""
    effects, _, G, H, motion = effect_ports(model)
    layout, values = [], []
    port = state = parameter = 0
    for effect in effects:
        kind, known = effect.definition, effect.values
        context = context_values(model, effect, step)
        dry = kind.turns_over != "" and _too_sharp(effect, context)
        if dry:
            known = {**known, kind.turns_over: 0.0}
            context = [0.0] * len(context)
        p = [*known.values(), *context]
        layout.append((port, kind.ports, state, kind.states, parameter, len(p), dry))
        values += p
        port, state, parameter = port + kind.ports, state + kind.states, parameter + len(p)
    A, B, C, D = (np.ascontiguousarray(M) for M in model.matrices.first_order())
    return NonlinearSystem(
        A=A,
        B=B,
        C=C,
        D=D,
        G=np.ascontiguousarray(G),
        H=np.ascontiguousarray(H),
        motion=tuple(np.ascontiguousarray(part) for part in motion),  # type: ignore[arg-type]
        effects=tuple(effects),
        layout=np.array(layout, dtype=np.int64).reshape(-1, 7),
        values=np.array(values, dtype=float),
        internal=state,
    )


def _too_sharp(effect: Effect, context: list[float]) -> bool:
    """Return whether a step cannot resolve how a dry friction turns over: then it is ideal."""
    kind = effect.definition
    forces = [abs(effect.values[p.name]) for p in kind.parameters if p.dimension == "F"]
    resolved = max(forces) * context[kind.context.index("mobility")]
    return effect.values[kind.turns_over] < resolved


def needed_substeps(model: MechanicalData, dt: float, amplitude: float) -> int:
    """Return steps per sample that resolve the effects' own stiffness and damping.

    Parameters
    ----------
    model : MechanicalData
    dt : float
        Sampling step in s.
    amplitude : float
        Displacement amplitude in m or rad.
    """
    if not model.effects:
        return 1
    fastest, least = 0.0, 1
    m = model.matrices
    omega = np.sqrt(max(np.max(np.abs(np.diag(m.K) / np.maximum(np.diag(m.M), 1e-300))), 0.0))
    for _, effect in dynamic_effects(model):
        with np.errstate(over="ignore"):  # a rate beyond doubles is as fast as any
            stiffness, damping, rate = effect.definition.steepness(
                effect.values, amplitude, min(omega, 1 / dt) * amplitude
            )
        rows = port_rows(model, effect)[:, m.free]
        inverse = np.trace(rows @ m.inverse_mass @ rows.T)
        # laws see to it that no memory fades faster than a step; a few are enough for its rate
        fading = min(0.3 * rate, (_FADING if model.free else _MOST_SUBSTEPS) / dt)
        fastest = max(fastest, np.sqrt(abs(stiffness) * inverse), abs(damping) * inverse, fading)
        least = max(least, 4 if effect.definition.sharp else 2)
    return int(np.clip(np.ceil(2.0 * dt * fastest), least, _MOST_SUBSTEPS))
