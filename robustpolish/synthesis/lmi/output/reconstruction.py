"""Controllers from the solutions of matrix inequalities, kept well conditioned near the optimum."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from robustpolish.synthesis.certificate.certificate import Norm
from robustpolish.synthesis.lmi.affine import Affine
from robustpolish.synthesis.lmi.output.inequalities import (
    Unknowns,
    Variables,
    coupling,
    size_of,
)
from robustpolish.synthesis.lmi.semidefinite import ProgramSolver, SemidefiniteProgram
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices

_ROOM = 1.5


def conditioned(
    plant: PlantMatrices,
    norm: Norm,
    impose: Callable[[SemidefiniteProgram, Unknowns], None],
    solver: ProgramSolver,
) -> Iterator[Controller]:
    """Yield controllers for a bound that has been backed off from the optimum.

    First the size of all variables is minimised. Then I - XY is pushed away from singularity by
    maximising beta in [X beta I; beta I Y] >= 0, with a little more size. The second
    controller is as a rule the better one by orders of magnitude of gain.

    Parameters
    ----------
    plant : PlantMatrices
        In states in which X and Y are balanced.
    norm : {"hinf", "h2"}
    impose : callable
        (program, unknowns): adds the inequalities of the norm.
    solver : ProgramSolver
    """
    small = _solve(plant, norm, impose, solver, None)
    if small is None:
        return
    parts = (small.X, small.Y, np.block([[small.A, small.B], [small.C, small.D]]))
    size = max(float(np.linalg.norm(M, 2)) for M in parts)
    apart = _solve(plant, norm, impose, solver, _ROOM * size)
    for found in (apart, small):
        K = None if found is None else reconstruct(plant, found)
        if K is not None:
            yield K


def _solve(
    plant: PlantMatrices,
    norm: Norm,
    impose: Callable[[SemidefiniteProgram, Unknowns], None],
    solver: ProgramSolver,
    largest: float | None,
) -> Variables | None:
    program = SemidefiniteProgram()
    v = Unknowns.of(program, plant, norm)
    impose(program, v)
    size = size_of(program, v)
    if largest is None:
        coupling(program, v)
        program.minimise(size)
    else:
        beta: Affine = program.scalar()
        coupling(program, v, beta)
        program.nonnegative(largest - size)
        program.minimise(-beta)
    found = solver.solve(program)
    return None if found.x is None else v.at(found)


def reconstruct(plant: PlantMatrices, found: Variables) -> Controller | None:
    """Undo the change of variables, with a balanced factorisation M N' = I - XY."""
    P, (X, Y, Ah, Bh, Ch, D) = plant, found
    U, s, Vt = np.linalg.svd(np.eye(len(X)) - X @ Y)
    if s[-1] <= np.finfo(float).eps * s[0]:
        return None
    root = np.sqrt(s)
    M, N = U * root, Vt.T * root
    try:
        C = np.linalg.solve(M, (Ch - D @ P.C2 @ X).T).T
        B = np.linalg.solve(N, Bh - Y @ P.B2 @ D)
        inner = Ah - N @ B @ P.C2 @ X - Y @ P.B2 @ C @ M.T - Y @ (P.A + P.B2 @ D @ P.C2) @ X
        A = np.linalg.solve(M, np.linalg.solve(N, inner).T).T
    except np.linalg.LinAlgError:
        return None
    return Controller(A, B, C, D)
