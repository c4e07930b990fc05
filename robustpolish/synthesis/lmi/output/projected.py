"""The projected inequalities of H-infinity output feedback, which have no controller variables.

Gahinet and Apkarian, "A linear matrix inequality approach to H-infinity control", Int. J. Robust
Nonlinear Control 4 (1994) 421-448.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import linalg

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.synthesis.lmi.affine import symmetric_block
from robustpolish.synthesis.lmi.semidefinite import ProgramSolver, SemidefiniteProgram
from robustpolish.synthesis.problem.matrices import PlantMatrices


class Projected(NamedTuple):
    """R, S and gamma of the projected inequalities, unverified."""

    R: Matrix
    S: Matrix
    gamma: float
    status: str


def solve_projected(plant: PlantMatrices, solver: ProgramSolver) -> Projected | None:
    """Minimise gamma over R and S."""
    P = plant
    n, nw, nz = P.A.shape[0], P.B1.shape[1], P.C1.shape[0]
    program = SemidefiniteProgram()
    R, S, gamma = program.symmetric(n), program.symmetric(n), program.scalar()
    left = _with_identity(linalg.null_space(np.hstack([P.B2.T, P.D12.T])), nw)
    right = _with_identity(linalg.null_space(np.hstack([P.C2, P.D21])), nz)
    control = symmetric_block(
        [
            [P.A @ R + R @ P.A.T, R @ P.C1.T, P.B1],
            [-gamma.times(np.eye(nz)), P.D11],
            [-gamma.times(np.eye(nw))],
        ]
    )
    estimate = symmetric_block(
        [
            [S @ P.A + P.A.T @ S, S @ P.B1, P.C1.T],
            [-gamma.times(np.eye(nw)), P.D11.T],
            [-gamma.times(np.eye(nz))],
        ]
    )
    program.positive(-(left.T @ control @ left))
    program.positive(-(right.T @ estimate @ right))
    program.positive(symmetric_block([[R, np.eye(n)], [S]]))
    program.minimise(gamma)
    found = solver.solve(program)
    if found.x is None:
        return None
    return Projected(found.value(R), found.value(S), float(found.value(gamma).item()), found.status)


def _with_identity(basis: Matrix, size: int) -> Matrix:
    return np.asarray(linalg.block_diag(basis, np.eye(size)))


def rebalanced(plant: PlantMatrices, R: Matrix, S: Matrix) -> PlantMatrices | None:
    """Return the plant in states in which R and S are equal and diagonal, if they are definite."""
    try:
        left, right = np.linalg.cholesky(R), np.linalg.cholesky(S)
    except np.linalg.LinAlgError:
        return None
    U, s, Vt = np.linalg.svd(right.T @ left)
    if s[-1] <= 0:
        return None
    into = (U / np.sqrt(s)).T @ right.T  # x_new = into x
    back = left @ (Vt.T / np.sqrt(s))
    P = plant
    return P.replace(
        A=into @ P.A @ back, B1=into @ P.B1, B2=into @ P.B2, C1=P.C1 @ back, C2=P.C2 @ back
    )
