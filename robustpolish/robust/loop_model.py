"""The certain part of an uncertain loop, as the model that bounds and witnesses are sought for."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import flint
import numpy as np

from robustpolish.arrays import AnyMatrix, Matrix
from robustpolish.exact.balls import precision
from robustpolish.exact.realisation import Realisation, typical_rate
from robustpolish.models.uncertain.system import UncertainSystem
from robustpolish.robust.structure import DeltaBlock, Structure, structure_of
from robustpolish.robust.units.canonical import BITS, Balls, canonical

# Frequencies of this share of the typical rate are rest, but for rounding.
_AT_REST = 1e-7


@dataclass(frozen=True, eq=False)
class LoopModel:
    """M from w to z in scaled units, continuous, with the structure of Delta.

    Attributes
    ----------
    structure : Structure
    model : Realisation
        Continuous: a discrete loop is mapped by z = (1 + s)/(1 - s). In units of states, signals
        and time that follow from the loop, whatever those were that it came in; rounded.
    balls : tuple of arb_mat
        A, B, C and D of `model` as they are without rounding, enclosed.
    gain : float
        Gains of `model` times this are those of the loop.
    time : float
        Frequencies of `model` times this are in rad/s, of a continuous loop; those of the map of a
        discrete one.
    step : float
        Sampling time in s, 0 for a continuous loop.
    """

    structure: Structure
    model: Realisation
    balls: Balls
    gain: float
    time: float
    step: float

    @classmethod
    def of(cls, system: UncertainSystem, performance: DeltaBlock | None = None) -> LoopModel:
        """Return the loop around the blocks, with the performance as one more block if asked."""
        structure = structure_of(system.blocks)
        one, n = system.matrices, system.nstates
        A, B, C, D = one.F[:n, :n], one.F[:n, n:], one.F[n:, :n], one.F[n:, n:]
        if performance is not None:
            structure = Structure((*structure.blocks, performance))
            B, C = np.hstack([B, one.G[:n]]), np.vstack([C, one.H[:, :n]])
            D = np.block([[D, one.G[n:]], [one.H[:, n:], one.J]])
        return cls.around((A, B, C, D), system.dt, structure)

    @classmethod
    def around(
        cls, matrices: tuple[Matrix, Matrix, Matrix, Matrix], dt: Any, structure: Structure
    ) -> LoopModel:
        """Return the loop of the matrices A, B, C and D of M around the blocks."""
        A, B, C, D = matrices
        used = _used(A, B, C)
        A, B, C = A[used][:, used], B[used], C[:, used]
        step = 0.0 if not dt else 1.0 if dt is True else float(dt)
        w, z = (_copy_of(structure, side) for side in ("rows", "columns"))
        own = canonical((A, B, C, D), bool(dt), w, z)
        return cls(structure, own.model, own.balls, own.gain, own.time, step)

    def in_unit_of_gain(self, unit: float) -> LoopModel:
        """Return the loop with deltas of size 1, and the signals of the last block in a unit."""
        model, (A, B, C, D) = self.model, self.balls
        rows = np.full(model.C.shape[0], self.gain)
        last = np.arange(len(rows))[self.structure.inputs[-1]]
        rows[last] /= unit
        with precision(BITS):
            exact = flint.arb_mat(len(rows), len(rows))
            for i in range(len(rows)):
                exact[i, i] = flint.arb(self.gain) / (unit if i in last else 1)
            balls = A, B, exact * C, exact * D
        scaled = replace(model, C=model.C * rows[:, None], D=model.D * rows[:, None])
        return replace(self, model=scaled, balls=balls, gain=1.0)

    @cached_property
    def rate(self) -> float:
        """A typical frequency of the model, in its own units."""
        return typical_rate(self.model.A)

    def response(self, angle: float) -> tuple[AnyMatrix, AnyMatrix]:
        """Return M and its slope at the frequency ``rate * tan(angle)``.

        Raises
        ------
        numpy.linalg.LinAlgError
            If rounding sees a pole there.
        """
        A, B, C, D = (M.astype(complex) for M in self._matrices)
        if not self.model.states:
            return D, np.zeros_like(D)
        s, c, one = math.sin(angle), math.cos(angle), np.eye(len(A))
        inner = 1j * self.rate * s * one - c * A
        slope = 1j * self.rate * c * one + s * A
        states = np.linalg.solve(inner, B)
        turned = np.linalg.solve(inner, slope @ states)
        return D + c * C @ states, -s * C @ states - c * C @ turned

    @property
    def _matrices(self) -> tuple[Matrix, Matrix, Matrix, Matrix]:
        model = self.model
        return model.A, model.B, model.C, model.D

    def angle(self, x: float) -> float:
        """Return the angle of a frequency of the model."""
        return math.pi / 2 if math.isinf(x) else math.atan(x / self.rate)

    def start(self, x: float) -> tuple[float, bool]:
        """Return the angle where a search near a frequency begins, and whether it may move.

        What is at rest but for rounding stays there.
        """
        moves = x > _AT_REST * self.rate
        return (self.angle(x) if moves else 0.0), moves

    def frequency(self, angle: float) -> float:
        """Return the frequency of the model at an angle, positive."""
        turned = abs((angle + math.pi / 2) % math.pi - math.pi / 2)
        return math.inf if turned >= math.pi / 2 else self.rate * math.tan(turned)

    def at_positive(self, delta: AnyMatrix, angle: float) -> AnyMatrix:
        """Return what a Delta of an angle is at the positive frequency of the same mode."""
        turned = (angle + math.pi / 2) % math.pi - math.pi / 2 < 0
        return np.conj(delta) if turned else delta

    def omega(self, x: float) -> float:
        """Return a frequency of the model in rad/s."""
        if self.step:
            return 2 * math.atan(x * self.time) / self.step
        return x * self.time

    def in_rad_per_s(
        self, intervals: tuple[tuple[float, float], ...]
    ) -> tuple[tuple[float, float], ...]:
        """Return intervals of the model's frequency in rad/s."""
        return tuple((self.omega(low), self.omega(high)) for low, high in intervals)

    @property
    def acts_back(self) -> bool:
        """Whether any delta is in a loop with itself or others, by the pattern of zeros."""
        model, structure = self.model, self.structure
        n = model.states
        states = np.eye(n, dtype=bool)
        for _ in range(n):
            states = states | (states @ (model.A != 0))
        through = (model.C != 0) @ states @ (model.B != 0) if n else np.zeros(model.D.shape, bool)
        whole = through | (model.D != 0)
        blocks = len(structure.blocks)
        acts = np.zeros((blocks, blocks), dtype=bool)
        for i, z in enumerate(structure.inputs):
            for j, w in enumerate(structure.outputs):
                acts[i, j] = bool(whole[z, w].any())
        for _ in range(blocks):
            acts = acts | (acts @ acts)
        return bool(acts.diagonal().any())

    def seeds(self) -> list[float]:
        """Return frequencies that are likely to matter: those of the poles."""
        if not self.model.states:
            return []
        poles: Any = np.linalg.eigvals(self.model.A)
        return sorted({float(f"{abs(pole):.6g}") for pole in poles if abs(pole) > 0})


def _copy_of(structure: Structure, side: Literal["rows", "columns"]) -> list[int]:
    """Return of each signal the number of the copy that it belongs to."""
    copies = [getattr(block, side) for block in structure.blocks for _ in range(block.copies)]
    return [i for i, count in enumerate(copies) for _ in range(count)]


def _used(A: Matrix, B: Matrix, C: Matrix) -> list[int]:
    """Return the states that something moves and that something sees, by the pattern of zeros."""
    moved, seen = B.any(axis=1), C.any(axis=0)
    for _ in range(len(A)):
        moved = moved | (A[:, moved] != 0).any(axis=1)
        seen = seen | (A[seen] != 0).any(axis=0)
    return np.flatnonzero(moved & seen).tolist()
