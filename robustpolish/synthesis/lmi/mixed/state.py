"""Multi-objective state feedback with one Lyapunov matrix for all specifications.

With Y and M = F Y, the thesis's (10.18), (10.19), (10.27), (10.28) and the pole regions of Chilali
and Gahinet are linear at once if all share Y. The answer is a start for descents on true norms.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from robustpolish.synthesis.lmi.affine import Affine, symmetric_block
from robustpolish.synthesis.lmi.mixed.output import Specification
from robustpolish.synthesis.lmi.semidefinite import ProgramSolver, SemidefiniteProgram
from robustpolish.synthesis.lmi.state.inequalities import (
    h2_inequality,
    hinf_inequality,
    region_inequalities,
)
from robustpolish.synthesis.problem.matrices import Matrix, PlantMatrices
from robustpolish.synthesis.problem.pole_regions import PoleRegion

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
