"""The projected inequalities of H-infinity output feedback, which have no controller variables.

Gahinet and Apkarian, "A linear matrix inequality approach to H-infinity control", Int. J. Robust
Nonlinear Control 4 (1994) 421-448.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import linalg

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.synthesis.lmi.affine import Affine, symmetric_block
from robustpolish.synthesis.lmi.semidefinite import ProgramSolver, SemidefiniteProgram
from robustpolish.synthesis.problem.matrices import PlantMatrices

# R and S may be so many times larger than they need be, so that R S stays away from I.
_ROOM = 5.0
# So many times may they grow where gamma falls by a step.
_GROWTH = 3.0
# Directions of a known point with less slack than this share of the largest are not stretched
# further: their slack is rounding.
_SLACK = 1e-2


class Point(NamedTuple):
    """R and S of the projected inequalities for a norm below gamma, unverified."""

    R: Matrix
    S: Matrix
    gamma: float


def solve_projected(
    plant: PlantMatrices, gamma: float, solver: ProgramSolver, near: Point | None = None
) -> Point | None:
    """Find R and S for a norm below gamma that are small and whose product stays away from I.

    First the larger of R and S is made small, then beta is maximised in [R, beta I; beta I, S] >= 0
    with a little more size, which holds I - RS away from singularity.

    Parameters
    ----------
    plant : PlantMatrices
    gamma : float
    solver : ProgramSolver
    near : Point, optional
        A point that satisfies the inequalities for this or a larger gamma. The inequalities are
        stretched so that its slack is the identity: interior-point methods stop short of the
        optimum where fast and slow states stand in one matrix.

    Returns
    -------
    Point or None
        None if there is none, or none was found.
    """
    inequalities = _Inequalities(plant, gamma, near)
    if near is not None:
        # R and S grow but little from one gamma to the next.
        largest = _GROWTH * max(float(np.linalg.norm(M, 2)) for M in near[:2])
        found = inequalities.apart(largest, solver)
        if found is not None:
            return found
    smallest = inequalities.smallest(solver)
    if smallest is None:
        return None
    point, size = smallest
    return inequalities.apart(_ROOM * size, solver) or point


class _Inequalities:
    """Both inequalities at one gamma, stretched to even sizes."""

    def __init__(self, plant: PlantMatrices, gamma: float, near: Point | None) -> None:
        P = plant
        self.plant, self.gamma = P, gamma
        n, nw, nz = P.nx, P.nw, P.nz
        left = _with_identity(linalg.null_space(np.hstack([P.B2.T, P.D12.T])), nw)
        right = _with_identity(linalg.null_space(np.hstack([P.C2, P.D21])), nz)
        stretch = _evened if near is None else _stretched
        R, S, level = near or Point(np.eye(n), np.eye(n), gamma)
        self.control = stretch(left, _control(P, Affine.of(R), level).at(np.zeros(0)))
        self.estimate = stretch(right, _estimate(P, Affine.of(S), level).at(np.zeros(0)))

    def smallest(self, solver: ProgramSolver) -> tuple[Point, float] | None:
        """Make the larger of R and S small; return both, and its size."""
        program, R, S, size = self._program()
        identity = np.eye(self.plant.nx)
        program.positive(symmetric_block([[R, identity], [S]]))
        for M in (R, S):
            program.positive(size.times(identity) - M)
        program.minimise(size)
        found = solver.solve(program)
        if found.x is None:
            return None
        point = Point(found.value(R), found.value(S), self.gamma)
        return point, float(found.value(size).item())

    def apart(self, largest: float, solver: ProgramSolver) -> Point | None:
        """Hold R S away from I with R and S up to a size."""
        program, R, S, beta = self._program()
        identity = np.eye(self.plant.nx)
        program.positive(symmetric_block([[R, beta.times(identity)], [S]]))
        for M in (R, S):
            program.positive(largest * identity - M)
        program.minimise(-beta)
        found = solver.solve(program)
        if found.x is None or found.value(beta).item() < 1:
            return None
        return Point(found.value(R), found.value(S), self.gamma)

    def _program(self) -> tuple[SemidefiniteProgram, Affine, Affine, Affine]:
        """Begin a program with R, S and a scalar."""
        program = SemidefiniteProgram(prescaled=True)
        n = self.plant.nx
        R, S, scalar = program.symmetric(n), program.symmetric(n), program.scalar()
        left, right = self.control, self.estimate
        program.positive(-(left.T @ _control(self.plant, R, self.gamma) @ left))
        program.positive(-(right.T @ _estimate(self.plant, S, self.gamma) @ right))
        return program, R, S, scalar


def _with_identity(basis: Matrix, size: int) -> Matrix:
    return np.asarray(linalg.block_diag(basis, np.eye(size)))


def _control(plant: PlantMatrices, R: Affine, gamma: float) -> Affine:
    P = plant
    return symmetric_block(
        [
            [P.A @ R + R @ P.A.T, R @ P.C1.T, P.B1],
            [-gamma * np.eye(P.nz), P.D11],
            [-gamma * np.eye(P.nw)],
        ]
    )


def _estimate(plant: PlantMatrices, S: Affine, gamma: float) -> Affine:
    P = plant
    return symmetric_block(
        [
            [S @ P.A + P.A.T @ S, S @ P.B1, P.C1.T],
            [-gamma * np.eye(P.nw), P.D11.T],
            [-gamma * np.eye(P.nz)],
        ]
    )


def _evened(basis: Matrix, blocks: Matrix) -> Matrix:
    """Return a basis in which the sizes of rows are alike."""
    size = np.abs(blocks).sum(axis=1)
    size = np.maximum(size, 1e-12 * size.max(initial=0.0))
    L = np.linalg.cholesky(basis.T @ (size[:, None] * basis))
    return np.linalg.solve(L, basis.T).T


def _stretched(basis: Matrix, blocks: Matrix) -> Matrix:
    """Return a basis in which the slack of a point is the identity, where it has any."""
    slack = -basis.T @ blocks @ basis
    slack = (slack + slack.T) / 2
    unit = np.sqrt(np.maximum(np.abs(np.diag(slack)), 1e-14 * np.abs(slack).max(initial=0.0)))
    values, vectors = np.linalg.eigh(slack / unit[:, None] / unit)
    values = np.maximum(values, _SLACK * values.max(initial=0.0))
    return basis @ ((vectors / np.sqrt(values)) / unit[:, None])


def rebalanced(plant: PlantMatrices, R: Matrix, S: Matrix) -> tuple[PlantMatrices, Matrix] | None:
    """Return the plant in states in which R and S are equal and diagonal, if they are definite.

    Returns
    -------
    plant : PlantMatrices
    sizes : ndarray
        The diagonal, the largest entry first.
    """
    try:
        left, right = np.linalg.cholesky(R), np.linalg.cholesky(S)
    except np.linalg.LinAlgError:
        return None
    U, s, Vt = np.linalg.svd(right.T @ left)
    if s[-1] <= 0:
        return None
    into = (U / np.sqrt(s)).T @ right.T  # x_new = into x
    back = left @ (Vt.T / np.sqrt(s))
    return plant.in_states(into, back), s
