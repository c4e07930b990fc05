"""One Lyapunov matrix for several specifications."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.lmi.output_feedback import LmiVariables, assemble_blocks, reconstruct
from robustpolish.synthesis.lmi.program import (
    Affine,
    ProgramSolver,
    SemidefiniteProgram,
    SemidefiniteSolution,
    symmetric_block,
)
from robustpolish.synthesis.problem.matrices import PlantMatrices, absorb_d22
from robustpolish.synthesis.problem.pole_regions import PoleRegion
from robustpolish.synthesis.state_feedback.lmi import (
    h2_inequality,
    hinf_inequality,
    region_inequalities,
    region_matrix,
)

# Multi-objective output feedback with one Lyapunov matrix for all specifications.
#
# Scherer, Gahinet and Chilali, "Multiobjective output-feedback control via LMI optimization", IEEE
# TAC 42 (1997): the change of variables of the thesis's (10.20) to (10.24) makes every
# specification affine, at the price of a Lyapunov matrix that they share. The answer is a start for
# descents on the true norms, which have no such price.


class Specification(NamedTuple):
    """A norm of a channel: minimised if `bound` is None.

    Attributes
    ----------
    plant : GeneralizedPlant
        The channel, scaled, continuous.
    norm : {"hinf", "h2"}
    bound : float or None
    """

    plant: GeneralizedPlant
    norm: str
    bound: float | None


def mixed_start(
    specifications: Sequence[Specification],
    regions: Sequence[PoleRegion],
    solver: ProgramSolver,
    back_off: float,
) -> Matrix | None:
    """Return [[Ak, Bk], [Ck, Dk]] that meets the inequalities, as far as a solver can tell.

    Parameters
    ----------
    specifications : sequence of Specification
        All on the same A, B2, C2 and D22; exactly one is minimised.
    regions : sequence of PoleRegion
        In the unit of time of the scaled plant.
    solver : ProgramSolver
    back_off : float
        How far the norm backs off from its optimum before the controller is made small.

    Returns
    -------
    ndarray or None
        None if the inequalities have no solution or the solver found none.
    """
    P = specifications[0].plant

    program, variables, level = mixed_program(specifications, regions, None)
    program.minimise(level)
    first = solver.solve(program)
    if first.x is None:
        return None
    best = float(first.value(level).item())
    # First the smallest variables at a norm a little worse, then I - XY far from singular.
    program, variables, _ = mixed_program(specifications, regions, max(best, 0.0) * back_off**2)
    size = _size(program, variables)
    program.minimise(size)
    second = solver.solve(program)
    if second.x is None:
        return None
    smallest = float(second.value(size).item())
    program, variables, _ = mixed_program(specifications, regions, max(best, 0.0) * back_off**2)
    size, beta = _size(program, variables), program.scalar()
    program.nonnegative(1.5 * smallest - size)
    eye = beta.times(np.eye(P.nx))
    program.positive(symmetric_block([[variables.Y, eye], [variables.X]]))
    program.minimise(-beta)
    third = solver.solve(program)
    return None if third.x is None else reconstructed(P, variables, third)


def _size(program: SemidefiniteProgram, v: LmiVariables) -> Affine:
    """Bound the largest singular value of all variables by a scalar."""
    size = program.scalar()
    whole = assemble_blocks([[v.A, v.B], [v.C, v.D]])
    rows, columns = (size.times(np.eye(n)) for n in whole.shape)
    program.positive(symmetric_block([[rows, whole], [columns]]))
    for M in (v.X, v.Y):
        program.positive(size.times(np.eye(M.shape[0])) - M)
    return size


def mixed_program(
    specifications: Sequence[Specification], regions: Sequence[PoleRegion], level: float | None
) -> tuple[SemidefiniteProgram, LmiVariables, Affine]:
    """State the inequalities; `level` fixes the square of the norm that is minimised."""
    P = specifications[0].plant
    program = SemidefiniteProgram()
    v = LmiVariables.of(program, PlantMatrices.of(P), "hinf")
    square = program.scalar() if level is None else Affine.of(level)
    lyapunov = symmetric_block([[v.Y, np.eye(P.nx)], [v.X]])
    program.positive(lyapunov)
    A = assemble_blocks(
        [[P.A @ v.Y + P.B2 @ v.C, P.B2 @ v.D @ P.C2 + P.A], [v.A, v.X @ P.A + v.B @ P.C2]]
    )
    for s in specifications:
        target = square if s.bound is None else Affine.of(s.bound**2)
        _add_norm(program, s, v, lyapunov, A, target)
    for region in regions:
        program.positive(region_matrix(region.L, region.M, lyapunov, A))
    return program, v, square


def _add_norm(
    program: SemidefiniteProgram,
    s: Specification,
    v: LmiVariables,
    lyapunov: Affine,
    A: Affine,
    square: Affine,
) -> None:
    P = s.plant
    B = assemble_blocks([[P.B2 @ v.D @ P.D21 + P.B1], [v.X @ P.B1 + v.B @ P.D21]])
    C = assemble_blocks([[P.C1 @ v.Y + P.D12 @ v.C, P.D12 @ v.D @ P.C2 + P.C1]])
    D = P.D12 @ v.D @ P.D21 + P.D11
    decay = -(A + A.T)
    if s.norm == "hinf":
        # With the square of the norm as variable: the other identity stays constant.
        rows = [[decay, -B, -C.T], [square.times(np.eye(P.nw)), -D.T], [np.eye(P.nz)]]
        program.positive(symmetric_block(rows))
        return
    Q = program.symmetric(P.nz)
    program.positive(symmetric_block([[decay, -B], [np.eye(P.nw)]]))
    program.positive(symmetric_block([[lyapunov, C.T], [Q]]))
    program.nonnegative(square - Q.trace)
    program.zero(D)


def reconstructed(
    P: GeneralizedPlant, variables: LmiVariables, solution: SemidefiniteSolution
) -> Matrix | None:
    """Undo the change of variables, (10.23) and (10.24)."""
    v = variables.at(solution)
    inner = reconstruct(PlantMatrices.of(P).without_d22(), v._replace(X=v.Y, Y=v.X))
    K = None if inner is None else absorb_d22(inner, P.D22)
    if K is None or not all(np.isfinite(M).all() for M in K):
        return None
    return np.block([[K.A, K.B], [K.C, K.D]])


# Multi-objective state feedback with one Lyapunov matrix for all specifications.
#
# With Y and M = F Y, the thesis's (10.18), (10.19), (10.27), (10.28) and the pole regions of
# Chilali and Gahinet are linear at once if all share Y. The answer is a start for descents on true
# norms.

# The norm is not known before; a second time it is solved in its own unit.
_ROUNDS = 2


def mixed_state_start(
    specifications: Sequence[Specification],
    regions: Sequence[PoleRegion],
    solver: ProgramSolver,
    back_off: float,
) -> Matrix | None:
    """Return F of u = F x that meets the inequalities, as far as a solver can tell.

    Parameters
    ----------
    specifications : sequence of Specification
        All on the same A and B2; exactly one is minimised.
    regions : sequence of PoleRegion
        In the unit of time of the scaled plant.
    solver : ProgramSolver
    back_off : float
        How far the norm backs off from its optimum before the controller is made small.

    Returns
    -------
    ndarray, shape (nu, nx), or None
        None if the inequalities have no solution or the solver found none.
    """
    unit, F = 1.0, None
    for _ in range(_ROUNDS):
        program, _, _, square = _program(specifications, regions, unit, None)
        program.minimise(square)
        first = solver.solve(program)
        if first.x is None:
            return F
        unit *= math.sqrt(max(float(first.value(square).item()), 1e-16))
        program, Y, M, _ = _program(specifications, regions, unit, back_off**2)
        effort = program.symmetric(M.shape[0])
        program.positive(symmetric_block([[effort, M], [Y]]))
        program.minimise(effort.trace)
        second = solver.solve(program)
        if second.x is None:
            return F
        try:
            F = np.linalg.solve(second.value(Y), second.value(M).T).T
        except np.linalg.LinAlgError:
            return None
    return F


def _program(
    specifications: Sequence[Specification],
    regions: Sequence[PoleRegion],
    unit: float,
    level: float | None,
) -> tuple[SemidefiniteProgram, Affine, Affine, Affine]:
    """State the inequalities; `level` fixes the square of the minimised norm over `unit`."""
    problems = [PlantMatrices.of(s.plant) for s in specifications]
    program = SemidefiniteProgram()
    n, eye = problems[0].nx, np.eye(problems[0].nx)
    Y, M = program.symmetric(n), program.matrix(problems[0].nu, n)
    program.positive(Y)
    square = program.scalar() if level is None else Affine.of(level)
    for s, p in zip(specifications, problems, strict=True):
        size = unit if s.bound is None else s.bound
        target = square if s.bound is None else Affine.of(1.0)
        own = p.replace(C1=p.C1 / size, D11=p.D11 / size, D12=p.D12 / size)
        if s.norm == "hinf":
            hinf_inequality(program, own, Y, M, target, eye)
        else:
            program.nonnegative(target - h2_inequality(program, own, Y, M, eye))
    region_inequalities(program, problems[0], Y, M, regions)
    return program, Y, M, square
