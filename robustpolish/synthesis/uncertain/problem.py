"""What robust synthesis works on: the plant in scaled units, with the blocks of Delta on it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import control
import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.models import GeneralizedPlant
from robustpolish.models.plant.blocks import named_system
from robustpolish.models.uncertain.system import UncertainSystem
from robustpolish.robust.coverage import Coverage, cover
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.scaled.scalings import Space
from robustpolish.robust.structure import DeltaBlock, Structure, structure_of
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices
from robustpolish.synthesis.problem.scaling import SolverPlant
from robustpolish.synthesis.problem.static_loop import StaticLoop, augmented, close_static


@dataclass(frozen=True, eq=False)
class RobustProblem:
    """The plant from (w of Delta, w) to (z of Delta, z), u to y, and the structure of Delta.

    Attributes
    ----------
    plant : GeneralizedPlant
        In its own units; z in units of `gamma`, so that a mu of 1 is what is asked for.
    structure : Structure
        The blocks, the last one for the performance.
    part : SolverPlant
        The plant in scaled units, continuous, without D22.
    """

    plant: GeneralizedPlant
    structure: Structure
    part: SolverPlant

    @classmethod
    def of(cls, system: UncertainSystem, ny: int, nu: int, gamma: float) -> RobustProblem:
        """State the problem of a system whose last signals are measured and driven."""
        whole = system.interconnection
        nz, nw = system.noutputs - ny, system.ninputs - nu
        rows = np.ones(whole.noutputs)
        rows[whole.noutputs - system.noutputs :][:nz] = 1 / gamma
        matrices = (whole.A, whole.B, rows[:, None] * whole.C, rows[:, None] * whole.D)
        names = (whole.input_labels, whole.output_labels, whole.state_labels)
        plant = GeneralizedPlant(named_system(matrices, whole.dt, *names), ny, nu)
        last = DeltaBlock("complex" if nz == nw == 1 else "full", 1, nw, nz, "performance")
        structure = Structure((*structure_of(system.blocks).blocks, last))
        return cls(plant, structure, SolverPlant.of(plant, mapped=True))

    @cached_property
    def matrices(self) -> PlantMatrices:
        """The plant in scaled units of time, states, u and y; levels are those of the plant."""
        m, gain = self.part.matrices, self.part.norm(1.0)
        return m.replace(C1=gain * m.C1, D11=gain * m.D11, D12=gain * m.D12)

    @property
    def scaled(self) -> GeneralizedPlant:
        """The same as a plant."""
        m = self.matrices
        return GeneralizedPlant.from_matrices(
            m.A, m.B1, m.B2, m.C1, m.C2, m.D11, m.D12, m.D21, m.D22
        )

    @cached_property
    def as_complex(self) -> Structure:
        """The structure with every copy of every number a complex number of its own.

        It holds more than the true one, and its scalings are positive numbers, one per copy.
        """
        found = []
        for block in self.structure.blocks:
            single = DeltaBlock("complex" if block.is_scalar else "full", 1, *_sizes(block))
            found += [single] * block.copies
        return Structure(tuple(found))

    def loop(self, K: Controller) -> StaticLoop | None:
        """Return the loop with a controller in scaled units; None if it is not well posed."""
        return close_static(augmented(self.matrices, len(K.A)), stacked(K))

    def cover(self, loop: StaticLoop, level: float) -> tuple[Coverage, LoopModel]:
        """Prove a level of a stable loop, raised as far as it has to be."""
        model = LoopModel.around((loop.A, loop.B, loop.C, loop.D), 0, self.structure)
        space = Space(self.structure, (False,) * len(self.structure.blocks))
        return cover(model, space, level / model.gain, model.seeds()), model

    def controller(self, K: Controller) -> control.StateSpace | None:
        """Return a controller in the plant's units; None if its loop is not well posed."""
        return self.part.controller(K)


def _sizes(block: DeltaBlock) -> tuple[int, int]:
    return block.rows, block.columns


def stacked(K: Controller) -> Matrix:
    """Return [[Ak, Bk], [Ck, Dk]]."""
    return np.block([[K.A, K.B], [K.C, K.D]])


def unstacked(K: Matrix, order: int) -> Controller:
    """Return the controller of [[Ak, Bk], [Ck, Dk]]."""
    k = order
    return Controller(K[:k, :k], K[:k, k:], K[k:, :k], K[k:, k:])
