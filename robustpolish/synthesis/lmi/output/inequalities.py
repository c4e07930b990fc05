"""The matrix inequalities of output feedback in the changed controller variables.

Scherer, Gahinet, Chilali, IEEE Trans. Automatic Control 42 (1997) 896-911; thesis (10.20) to
(10.24) for the H-infinity norm and (10.29) to (10.32) for the H2 norm.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.synthesis.certificate.certificate import Norm
from robustpolish.synthesis.lmi.affine import Affine, symmetric_block
from robustpolish.synthesis.lmi.semidefinite import SemidefiniteProgram, SemidefiniteSolution
from robustpolish.synthesis.problem.matrices import PlantMatrices


class Unknowns(NamedTuple):
    """X, Y and the changed controller variables as unknowns of a program."""

    X: Affine
    Y: Affine
    A: Affine
    B: Affine
    C: Affine
    D: Affine

    @classmethod
    def of(cls, program: SemidefiniteProgram, plant: PlantMatrices, norm: Norm) -> Unknowns:
        """Declare them; for the H2 norm without entries of D that would let w through to z."""
        unpriced, exact = np.all(plant.D12 == 0, axis=0), np.all(plant.D21 == 0, axis=1)
        hidden = np.logical_or.outer(unpriced, exact)
        n, nu, ny = plant.A.shape[0], plant.B2.shape[1], plant.C2.shape[0]
        return cls(
            program.symmetric(n),
            program.symmetric(n),
            program.matrix(n, n),
            program.matrix(n, ny),
            program.matrix(nu, n),
            program.matrix(nu, ny, hidden if norm == "h2" else None),
        )

    def at(self, solution: SemidefiniteSolution) -> Variables:
        """Return their values."""
        return Variables(*(solution.value(M) for M in self))


class Variables(NamedTuple):
    """Values of the unknowns, unverified."""

    X: Matrix
    Y: Matrix
    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix


class LoopTerms(NamedTuple):
    """The closed loop in the changed variables: affine, block by block.

    drift is the symmetric part of the state's block, [[AX + .., A^ ..], [.., YA + ..]]; source,
    output and direct are its B, C and D.
    """

    drift: list[list[Affine]]
    source: tuple[Affine, Affine]
    output: tuple[Affine, Affine]
    direct: Affine


def loop_terms(plant: PlantMatrices, v: Unknowns) -> LoopTerms:
    """Return the closed loop in the changed variables."""
    P = plant
    AX, YA = P.A @ v.X + P.B2 @ v.C, v.Y @ P.A + v.B @ P.C2
    return LoopTerms(
        [[AX + AX.T, v.A.T + (P.A + P.B2 @ v.D @ P.C2)], [YA + YA.T]],
        (P.B1 + P.B2 @ v.D @ P.D21, v.Y @ P.B1 + v.B @ P.D21),
        (P.C1 @ v.X + P.D12 @ v.C, P.C1 + P.D12 @ v.D @ P.C2),
        P.D11 + P.D12 @ v.D @ P.D21,
    )


def bounded_real(loop: LoopTerms, gamma: float) -> Affine:
    """Return the matrix that has to be negative for a norm below gamma."""
    nz, nw = loop.direct.shape
    return symmetric_block(
        [
            [*loop.drift[0], loop.source[0], loop.output[0].T],
            [*loop.drift[1], loop.source[1], loop.output[1].T],
            [-gamma * np.eye(nw), loop.direct.T],
            [-gamma * np.eye(nz)],
        ]
    )


def impose_h2(program: SemidefiniteProgram, loop: LoopTerms, v: Unknowns) -> Affine:
    """Impose the inequalities of the H2 norm; return the bound on its square."""
    nz, nw = loop.direct.shape
    n = v.X.shape[0]
    energy = program.symmetric(nz)
    program.positive(
        -symmetric_block(
            [
                [*loop.drift[0], loop.source[0]],
                [*loop.drift[1], loop.source[1]],
                [-np.eye(nw)],
            ]
        )
    )
    program.positive(
        symmetric_block([[v.X, np.eye(n), loop.output[0].T], [v.Y, loop.output[1].T], [energy]])
    )
    return energy.trace


def size_of(program: SemidefiniteProgram, v: Unknowns) -> Affine:
    """Return a scalar that bounds X, Y and the norm of the controller variables."""
    size = program.scalar()
    for M in (v.X, v.Y):
        program.positive(size.times(np.eye(M.shape[0])) - M)
    K = stacked([[v.A, v.B], [v.C, v.D]])
    rows, columns = K.shape
    program.positive(
        symmetric_block([[size.times(np.eye(rows)), K], [size.times(np.eye(columns))]])
    )
    return size


def coupling(program: SemidefiniteProgram, v: Unknowns, beta: Affine | None = None) -> None:
    """Require [X, beta I; beta I, Y] >= 0, with beta = 1 if it is not given."""
    identity = np.eye(v.X.shape[0])
    corner = identity if beta is None else beta.times(identity)
    program.positive(symmetric_block([[v.X, corner], [v.Y]]))


def stacked(blocks: list[list[Affine]]) -> Affine:
    """Assemble a matrix of blocks by products with constant selections."""
    rows, columns = sum(row[0].shape[0] for row in blocks), sum(b.shape[1] for b in blocks[0])
    total, top = Affine.of(np.zeros((rows, columns))), 0
    for row in blocks:
        left = 0
        for part in row:
            height, width = part.shape
            total = (
                total
                + np.eye(rows)[:, top : top + height] @ part @ np.eye(columns)[left : left + width]
            )
            left += width
        top += row[0].shape[0]
    return total
