"""A stabilising static gain by cone complementarity, for starts that descent does not find.

El Ghaoui, Oustry and AitRami, "A cone complementarity linearization algorithm for static
output-feedback and related problems", IEEE TAC 42 (1997): find P and Q with P Q = I such
that the two projected Lyapunov inequalities hold; trace(P Q) is minimised by solving a
sequence of semidefinite programs, and K follows from P by one more.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from robustpolish.synthesis.lmi.affine import symmetric_block
from robustpolish.synthesis.lmi.semidefinite import ProgramSolver, SemidefiniteProgram
from robustpolish.synthesis.problem.matrices import Matrix, PlantMatrices


def stabilising_gain(
    loop: PlantMatrices,
    mask: NDArray[np.bool_],
    solver: ProgramSolver,
    decay: float = 1e-3,
    iterations: int = 15,
) -> Matrix | None:
    """Look for a gain that stabilises a scaled plant.

    Parameters
    ----------
    loop : PlantMatrices
        Scaled.
    mask : ndarray of bool, shape (nu, ny)
        Entries of K that are free; the last program alone respects it.
    solver : ProgramSolver
    decay : float
        Decay rate asked for, relative to the unit of time; in discrete time the poles are
        asked into a disk of radius 1 - decay.
    iterations : int
        Largest number of linearisations.

    Returns
    -------
    ndarray of shape (nu, ny) or None
        The last gain that a program proposed, stabilising or not: a start for a
        descent. None if the programs failed.
    """
    A, B, C, D = _continuous(loop, decay)
    n = len(A)
    left, right = linalg.null_space(B.T), linalg.null_space(C)
    P0 = Q0 = np.eye(n)
    gain = None
    for _ in range(iterations):
        program = SemidefiniteProgram()
        P, Q = program.symmetric(n), program.symmetric(n)
        program.positive(symmetric_block([[P, np.eye(n)], [Q]]))
        if left.size:
            S = left.T @ (A @ Q) @ left
            program.positive(-(S + S.T) - np.eye(left.shape[1]) * 1e-3)
        if right.size:
            S = right.T @ (P @ A) @ right
            program.positive(-(S + S.T) - np.eye(right.shape[1]) * 1e-3)
        program.minimise((P @ Q0).trace + (Q @ P0).trace)
        solution = solver.solve(program)
        if solution.x is None:
            break
        P0, Q0 = solution.value(P), solution.value(Q)
        gain = _gain(A, B, C, P0, mask, solver)
        if gain is not None and np.linalg.eigvals(A + B @ gain @ C).real.max() < 0:
            break
    return None if gain is None else _behind(gain, D, mask)


def _gain(
    A: Matrix,
    B: Matrix,
    C: Matrix,
    P: Matrix,
    mask: NDArray[np.bool_],
    solver: ProgramSolver,
) -> Matrix | None:
    """Return the K that makes A'P + PA + PBKC + (PBKC)' as negative as it can be."""
    size = float(np.linalg.norm(P, 2))
    if not np.isfinite(size) or size == 0:
        return None
    P = P / size
    program = SemidefiniteProgram()
    K, t = program.matrix(*mask.shape, pattern=mask), program.scalar()
    S = (P @ B) @ K @ C + P @ A
    eye = np.eye(len(A))
    program.positive(t.times(eye) - (S + S.T))
    program.nonnegative(t + 1.0)
    # Keeps K finite where its direction is free.
    bound = program.scalar()
    rows, columns = mask.shape
    eyes = np.eye(rows), np.eye(columns)
    program.positive(symmetric_block([[bound.times(eyes[0]), K], [bound.times(eyes[1])]]))
    program.minimise(t + bound * 1e-4)
    solution = solver.solve(program)
    return None if solution.x is None else solution.value(K)


def _continuous(loop: PlantMatrices, decay: float) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Return A, B, C, D from u to y whose stability implies that of the loop with its decay.

    A discrete loop is mapped by z = (1 + s)/(1 - s), which leaves u and y as they are.
    """
    A, B, C, D = loop.A, loop.B2, loop.C2, loop.D22
    eye = np.eye(len(A))
    if not loop.discrete:
        size = float(np.linalg.norm(A, 2)) or 1.0
        return A + decay * size * eye, B, C, D
    A, B = A / (1 - decay), B / (1 - decay)
    shifted = A + eye
    moved = np.linalg.solve(shifted, B)
    seen = np.linalg.solve(shifted.T, C.T).T
    return np.linalg.solve(shifted, A - eye), np.sqrt(2) * moved, np.sqrt(2) * seen, D - C @ moved


def _behind(gain: Matrix, D: Matrix, mask: NDArray[np.bool_]) -> Matrix:
    """Return the gain that acts on y = y0 + D u as `gain` does on y0; a start only, with a mask."""
    if not D.any() or not mask.all():
        return gain
    inner = np.eye(len(gain)) + gain @ D
    return np.linalg.solve(inner, gain) if np.linalg.cond(inner) < 1e12 else gain
