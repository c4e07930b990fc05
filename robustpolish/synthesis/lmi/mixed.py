"""One Lyapunov matrix for several specifications."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.lmi.output_feedback import (
    LmiVariables,
    bounded_real,
    impose_h2,
    loop_terms,
    well_conditioned_controllers,
)
from robustpolish.synthesis.lmi.program import (
    Affine,
    ProgramSolver,
    SemidefiniteProgram,
    block_matrix,
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
    channels = [PlantMatrices.of(each.plant).without_d22() for each in specifications]

    def impose(program: SemidefiniteProgram, v: LmiVariables, square: Affine) -> None:
        lyapunov = symmetric_block([[v.X, np.eye(P.nx)], [v.Y]])
        program.positive(lyapunov)
        for s, channel in zip(specifications, channels, strict=True):
            loop = loop_terms(channel, v)
            target = square if s.bound is None else Affine.of(s.bound**2)
            if s.norm == "hinf":
                program.positive(-bounded_real(loop, target))
            else:
                program.nonnegative(target - impose_h2(program, loop, v))
                program.zero(loop.direct)
        A = block_matrix(loop_terms(channels[0], v).state)
        for region in regions:
            program.positive(region_matrix(region.L, region.M, lyapunov, A))

    program = SemidefiniteProgram()
    variables, level = LmiVariables.of(program, channels[0], "hinf"), program.scalar()
    impose(program, variables, level)
    program.minimise(level)
    first = solver.solve(program)
    if first.x is None:
        return None
    best = Affine.of(max(float(first.value(level).item()), 0.0) * back_off**2)
    found = well_conditioned_controllers(
        channels[0], "hinf", lambda program, v: impose(program, v, best), solver
    )
    inner = next(found, None)
    K = None if inner is None else absorb_d22(inner, P.D22)
    if K is None or not all(np.isfinite(M).all() for M in K):
        return None
    return np.block([[K.A, K.B], [K.C, K.D]])


# Multi-objective state feedback with one Lyapunov matrix for all specifications.
#
# With Y and M = F Y, the thesis's (10.18), (10.19), (10.27), (10.28) and the pole regions of
# Chilali and Gahinet are linear at once if all share Y. The answer is a start for descents on true
# norms.


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
    problems = [PlantMatrices.of(s.plant) for s in specifications]
    nx, nu = problems[0].nx, problems[0].nu

    def stated(level: float | None) -> tuple[SemidefiniteProgram, Affine, Affine, Affine]:
        """State the inequalities; `level` fixes the square of the minimised norm over the unit."""
        program = SemidefiniteProgram()
        Y, M = program.symmetric(nx), program.matrix(nu, nx)
        program.positive(Y)
        square = program.scalar() if level is None else Affine.of(level)
        for s, p in zip(specifications, problems, strict=True):
            size = unit if s.bound is None else s.bound
            target = square if s.bound is None else Affine.of(1.0)
            own = p.replace(C1=p.C1 / size, D11=p.D11 / size, D12=p.D12 / size)
            if s.norm == "hinf":
                hinf_inequality(program, own, Y, M, target, np.eye(nx))
            else:
                program.nonnegative(target - h2_inequality(program, own, Y, M, np.eye(nx)))
        region_inequalities(program, problems[0], Y, M, regions)
        return program, Y, M, square

    unit, F = 1.0, None
    # The norm is not known before; a second time it is solved in its own unit.
    for _ in range(2):
        program, Y, M, square = stated(None)
        program.minimise(square)
        first = solver.solve(program)
        if first.x is None:
            return F
        unit *= math.sqrt(max(float(first.value(square).item()), 1e-16))
        program, Y, M, _ = stated(back_off**2)
        effort = program.symmetric(nu)
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
