"""Output feedback for a polytope of plants whose numbers are measured: a controller per vertex.

With one X and Y for all vertices the changed variables of the controller may differ, and where the
controls and the measurements see constant matrices everything is affine: the mixture of the
controllers belongs to the mixture of the plants (Apkarian, Gahinet and Becker 1995).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from robustpolish.synthesis.lmi.affine import Affine, symmetric_block
from robustpolish.synthesis.lmi.output.inequalities import (
    Unknowns,
    Variables,
    coupling,
    loop_terms,
    size_of,
)
from robustpolish.synthesis.lmi.output.reconstruction import reconstruct
from robustpolish.synthesis.lmi.semidefinite import ProgramSolver, SemidefiniteProgram
from robustpolish.synthesis.polytopes.policy import POLICY
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices

_ROOM = 1.5


def scheduled_controllers(
    plants: Sequence[PlantMatrices], solver: ProgramSolver
) -> Iterator[tuple[tuple[Controller, ...], float]]:
    """Yield a controller for each vertex and the bound claimed for them, small bounds first.

    Parameters
    ----------
    plants : sequence of PlantMatrices
        Scaled, continuous, without D22, with the same B2, C2, D12 and D21.
    solver : ProgramSolver
    """
    first = _solved(plants, solver, None, None)
    if first is None:
        return
    for back_off in POLICY.back_offs:
        limit = first[1] * (1 + back_off) ** 2
        small = _solved(plants, solver, limit, None)
        if small is None:
            continue
        size = max(float(np.linalg.norm(M, 2)) for v in small[0] for M in _parts(v))
        # Then I - XY is pushed away from singularity, with a little more size.
        apart = _solved(plants, solver, limit, _ROOM * size)
        for found in (apart, small):
            made = () if found is None else _reconstructed(plants, found[0])
            if made:
                yield made, float(np.sqrt(limit))


def _parts(v: Variables) -> tuple[np.ndarray, ...]:
    return v.X, v.Y, np.block([[v.A, v.B], [v.C, v.D]])


def _reconstructed(
    plants: Sequence[PlantMatrices], found: Sequence[Variables]
) -> tuple[Controller, ...]:
    made = [reconstruct(p, v) for p, v in zip(plants, found, strict=True)]
    return tuple(K for K in made if K is not None) if all(K is not None for K in made) else ()


def _solved(
    plants: Sequence[PlantMatrices],
    solver: ProgramSolver,
    limit: float | None,
    largest: float | None,
) -> tuple[list[Variables], float] | None:
    """Minimise the square of the bound; with a limit the size, with that the distance of XY."""
    program = SemidefiniteProgram()
    first = Unknowns.of(program, plants[0], "hinf")
    unknowns = [first]
    for _ in plants[1:]:
        own = [program.matrix(*part.shape) for part in first[2:]]
        unknowns.append(Unknowns(first.X, first.Y, *own))
    square = program.scalar() if limit is None else Affine.of(limit)
    for p, v in zip(plants, unknowns, strict=True):
        program.positive(-_bounded_real(p, v, square))
    if largest is None:
        coupling(program, first)
        program.minimise(square)
        if limit is not None:
            program.minimise(_largest_size(program, unknowns))
    else:
        beta = program.scalar()
        coupling(program, first, beta)
        program.nonnegative(largest - _largest_size(program, unknowns))
        program.minimise(-beta)
    solution = solver.solve(program)
    if solution.x is None:
        return None
    return [v.at(solution) for v in unknowns], float(solution.value(square).item())


def _largest_size(program: SemidefiniteProgram, unknowns: Sequence[Unknowns]) -> Affine:
    largest = program.scalar()
    for v in unknowns:
        program.nonnegative(largest - size_of(program, v))
    return largest


def _bounded_real(p: PlantMatrices, v: Unknowns, square: Affine) -> Affine:
    """Return the matrix that has to be negative, with the square of gamma on w."""
    loop = loop_terms(p, v)
    return symmetric_block(
        [
            [*loop.drift[0], loop.source[0], loop.output[0].T],
            [*loop.drift[1], loop.source[1], loop.output[1].T],
            [-square.times(np.eye(p.nw)), loop.direct.T],
            [-np.eye(p.nz)],
        ]
    )
