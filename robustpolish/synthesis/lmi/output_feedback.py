"""Inequalities of dynamic output feedback."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg

from robustpolish.base.arrays import EPS
from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.synthesis.certificate import Norm
from robustpolish.synthesis.lmi.program import (
    Affine,
    ProgramSolver,
    SemidefiniteProgram,
    SemidefiniteSolution,
    block_matrix,
    symmetric_block,
)
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices
from robustpolish.synthesis.riccati.gamma import normalise

# States in which the inequalities of output feedback have solutions of order one.
#
# Interior-point methods answer wrongly where R and S span many decades, as they do for weights
# with slow and fast poles. The two Riccati equations bound them: R <= gamma inv(X) and S <= gamma
# inv(Y), so that states in which X and Y are balanced suit R and S too. What the inequalities say
# is the same in all states.


# With more states the change of variables has too many unknowns.
LMI_STATES = 14


def balanced_states(
    plant: PlantMatrices, X: Matrix, Y: Matrix, gamma: float, least: tuple[float, float]
) -> PlantMatrices | None:
    """Return the plant in states in which X and Y are equal and diagonal, but for small ones.

    Parameters
    ----------
    plant : PlantMatrices
    X, Y : ndarray, shape (n, n)
        Semidefinite solutions of the Riccati equations at `gamma`.
    gamma : float
    least : (float, float)
        Smallest eigenvalue of X with a diagonal of ones that counts, relative, and the smallest one
        of XY over gamma squared: directions that no control moves or no disturbance reaches
        leave X and Y singular.

    Returns
    -------
    PlantMatrices or None
        None where the numbers do not allow it.
    """
    largest = float(np.diag(X).max(initial=0.0))
    if largest <= 0:
        return None
    unit = np.sqrt(np.maximum(np.diag(X), 1e-16 * largest))
    try:
        values, vectors = np.linalg.eigh(X / unit[:, None] / unit)
        values = np.maximum(values, 0) + least[0] * values.max()
        L = unit[:, None] * (vectors * np.sqrt(values))
        M = L.T @ Y @ L
        values, vectors = np.linalg.eigh((M + M.T) / 2)
        root = (np.maximum(values, 0) + least[1] * gamma**2) ** 0.25
        into, back = (vectors / root).T @ L.T, np.linalg.solve(L.T, vectors * root)
    except np.linalg.LinAlgError:
        return None
    return plant.in_states(into, back) if np.isfinite(into).all() else None


# The matrix inequalities of output feedback in the changed controller variables.
#
# Scherer, Gahinet, Chilali, IEEE Trans. Automatic Control 42 (1997) 896-911; thesis (10.20) to
# (10.24) for the H-infinity norm and (10.29) to (10.32) for the H2 norm.


class LmiVariables(NamedTuple):
    """X, Y and the changed controller variables: expressions of a program, or their values."""

    X: Any
    Y: Any
    A: Any
    B: Any
    C: Any
    D: Any

    @classmethod
    def of(cls, program: SemidefiniteProgram, plant: PlantMatrices, norm: Norm) -> LmiVariables:
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

    @classmethod
    def of_each(
        cls, program: SemidefiniteProgram, plants: Sequence[PlantMatrices], norm: Norm
    ) -> list[LmiVariables]:
        """Declare those of several plants, which share X and Y."""
        first = cls.of(program, plants[0], norm)
        others = ([program.matrix(*part.shape) for part in first[2:]] for _ in plants[1:])
        return [first, *(cls(first.X, first.Y, *own) for own in others)]

    def at(self, solution: SemidefiniteSolution) -> LmiVariables:
        """Return their values, unverified."""
        return LmiVariables(*(solution.value(M) for M in self))


class LoopTerms(NamedTuple):
    """The closed loop in the changed variables: affine, block by block.

    state, source, output and direct are its A, B, C and D.
    """

    state: list[list[Affine]]
    source: tuple[Affine, Affine]
    output: tuple[Affine, Affine]
    direct: Affine

    @property
    def drift(self) -> list[list[Affine]]:
        """The upper triangle of A + A'."""
        (AX, top), (below, YA) = self.state
        return [[AX + AX.T, below.T + top], [YA + YA.T]]


def loop_terms(plant: PlantMatrices, v: LmiVariables) -> LoopTerms:
    """Return the closed loop in the changed variables."""
    P = plant
    return LoopTerms(
        [[P.A @ v.X + P.B2 @ v.C, P.A + P.B2 @ v.D @ P.C2], [v.A, v.Y @ P.A + v.B @ P.C2]],
        (P.B1 + P.B2 @ v.D @ P.D21, v.Y @ P.B1 + v.B @ P.D21),
        (P.C1 @ v.X + P.D12 @ v.C, P.C1 + P.D12 @ v.D @ P.C2),
        P.D11 + P.D12 @ v.D @ P.D21,
    )


def bounded_real(loop: LoopTerms, square: Affine) -> Affine:
    """Return the matrix that has to be negative for a squared norm below `square`."""
    nz, nw = loop.direct.shape
    return symmetric_block(
        [
            [*loop.drift[0], loop.source[0], loop.output[0].T],
            [*loop.drift[1], loop.source[1], loop.output[1].T],
            [-square.times(np.eye(nw)), loop.direct.T],
            [-np.eye(nz)],
        ]
    )


def impose_h2(program: SemidefiniteProgram, loop: LoopTerms, v: LmiVariables) -> Affine:
    """Impose the inequalities of the H2 norm; return the bound on its square."""
    (nz, nw), (first, second) = loop.direct.shape, loop.drift
    energy = program.symmetric(nz)
    rows = [[*first, loop.source[0]], [*second, loop.source[1]], [-np.eye(nw)]]
    program.positive(-symmetric_block(rows))
    one, (left, right) = np.eye(v.X.shape[0]), loop.output
    program.positive(symmetric_block([[v.X, one, left.T], [v.Y, right.T], [energy]]))
    return energy.trace


def bound_variables(program: SemidefiniteProgram, v: LmiVariables, size: Affine) -> None:
    """Require X, Y and the norm of the controller variables to be below a scalar."""
    for M in (v.X, v.Y):
        program.positive(size.times(np.eye(M.shape[0])) - M)
    K = block_matrix([[v.A, v.B], [v.C, v.D]])
    rows, columns = (size.times(np.eye(count)) for count in K.shape)
    program.positive(symmetric_block([[rows, K], [columns]]))


def coupling(program: SemidefiniteProgram, v: LmiVariables, beta: Affine | None = None) -> None:
    """Require [X, beta I; beta I, Y] >= 0, with beta = 1 if it is not given."""
    identity = np.eye(v.X.shape[0])
    corner = identity if beta is None else beta.times(identity)
    program.positive(symmetric_block([[v.X, corner], [v.Y]]))


# The projected inequalities of H-infinity output feedback, which have no controller variables.
#
# Gahinet and Apkarian, "A linear matrix inequality approach to H-infinity control", Int. J. Robust
# Nonlinear Control 4 (1994) 421-448.

# R and S may be so many times larger than they need be, so that R S stays away from I.
_ROOM = 5.0
# So many times may they grow where gamma falls by a step.
_GROWTH = 3.0
# Directions of a known point with less slack than this share of the largest are not stretched
# further: their slack is rounding.
_SLACK = 1e-2


class ProjectedSolution(NamedTuple):
    """R and S of the projected inequalities for a norm below gamma, unverified."""

    R: Matrix
    S: Matrix
    gamma: float


def solve_projected(
    plant: PlantMatrices, gamma: float, solver: ProgramSolver, near: ProjectedSolution | None = None
) -> ProjectedSolution | None:
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
    identity, halves = np.eye(plant.nx), []
    *sizes, level = near or (identity, identity, gamma)
    for half, size in zip((plant, plant.dual), sizes, strict=True):
        free = linalg.null_space(np.hstack([half.B2.T, half.D12.T]))
        basis: Matrix = np.asarray(linalg.block_diag(free, np.eye(half.nw)))
        known = _projected(half, Affine.of(size), level).at(np.zeros(0))
        stretch = _row_balanced if near is None else _slack_normalised
        halves.append((half, stretch(basis, known)))

    def solved(largest: float | None) -> tuple[ProjectedSolution, float] | None:
        """Make the larger of R and S small; or, up to a size, hold R S away from I."""
        program = SemidefiniteProgram(prescaled=True)
        R, S = program.symmetric(plant.nx), program.symmetric(plant.nx)
        scalar = program.scalar()
        for (half, basis), M in zip(halves, (R, S), strict=True):
            program.positive(-(basis.T @ _projected(half, M, gamma) @ basis))
        corner = identity if largest is None else scalar.times(identity)
        program.positive(symmetric_block([[R, corner], [S]]))
        most = scalar.times(identity) if largest is None else largest * identity
        for M in (R, S):
            program.positive(most - M)
        program.minimise(scalar if largest is None else -scalar)
        found = solver.solve(program)
        value = float(found.value(scalar).item())
        if found.x is None or (largest is not None and value < 1):
            return None
        return ProjectedSolution(found.value(R), found.value(S), gamma), value

    if near is not None:
        # R and S grow but little from one gamma to the next.
        found = solved(_GROWTH * max(float(np.linalg.norm(M, 2)) for M in near[:2]))
        if found is not None:
            return found[0]
    smallest = solved(None)
    return smallest and (solved(_ROOM * smallest[1]) or smallest)[0]


def _projected(P: PlantMatrices, R: Affine, gamma: float) -> Affine:
    top = [P.A @ R + R @ P.A.T, R @ P.C1.T, P.B1]
    return symmetric_block([top, [-gamma * np.eye(P.nz), P.D11], [-gamma * np.eye(P.nw)]])


def _row_balanced(basis: Matrix, blocks: Matrix) -> Matrix:
    """Return a basis in which the sizes of rows are alike."""
    size = np.abs(blocks).sum(axis=1)
    size = np.maximum(size, 1e-12 * size.max(initial=0.0))
    L = np.linalg.cholesky(basis.T @ (size[:, None] * basis))
    return np.linalg.solve(L, basis.T).T


def _slack_normalised(basis: Matrix, blocks: Matrix) -> Matrix:
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


# Controllers from the solutions of matrix inequalities, kept well conditioned near the optimum.

_RECONSTRUCTION_ROOM = 1.5


def well_conditioned_controllers(
    plants: Sequence[PlantMatrices],
    norm: Norm,
    impose: Callable[[SemidefiniteProgram, Sequence[LmiVariables]], None],
    solver: ProgramSolver,
) -> Iterator[list[Controller]]:
    """Yield a controller for each plant, for a bound that has been backed off from the optimum.

    First the size of all variables is minimised. Then I - XY is pushed away from singularity by
    maximising beta in [X beta I; beta I Y] >= 0, with a little more size. The second
    controller is as a rule the better one by orders of magnitude of gain.

    Parameters
    ----------
    plants : sequence of PlantMatrices
        In states in which X and Y are balanced; several share them.
    norm : {"hinf", "h2"}
    impose : callable
        (program, unknowns of each plant): adds the inequalities of the norm.
    solver : ProgramSolver
    """

    def solved(largest: float | None) -> list[LmiVariables] | None:
        program = SemidefiniteProgram()
        unknowns = LmiVariables.of_each(program, plants, norm)
        impose(program, unknowns)
        size: Affine = program.scalar()
        for v in unknowns:
            bound_variables(program, v, size)
        if largest is None:
            coupling(program, unknowns[0])
            program.minimise(size)
        else:
            beta: Affine = program.scalar()
            coupling(program, unknowns[0], beta)
            program.nonnegative(largest - size)
            program.minimise(-beta)
        found = solver.solve(program)
        return None if found.x is None else [v.at(found) for v in unknowns]

    small = solved(None)
    if small is None:
        return
    parts = [M for v in small for M in (v.X, v.Y, np.block([[v.A, v.B], [v.C, v.D]]))]
    size = max(float(np.linalg.norm(M, 2)) for M in parts)
    for found in (solved(_RECONSTRUCTION_ROOM * size), small):
        made = map(reconstruct, plants, found or ())
        controllers = [K for K in made if K is not None]
        if len(controllers) == len(plants):
            yield controllers


def controllers_near_optimum(
    plants: Sequence[PlantMatrices],
    impose: Callable[[SemidefiniteProgram, Sequence[LmiVariables], Affine], None],
    solver: ProgramSolver,
    back_offs: Iterable[float],
) -> Iterator[tuple[list[Controller], float]]:
    """Minimise an H-infinity norm, back off from it, and yield controllers with the norm claimed.

    Parameters
    ----------
    plants : sequence of PlantMatrices
        They share X and Y; each gets a controller.
    impose : callable
        (program, unknowns of each plant, square of the norm): adds the inequalities.
    solver : ProgramSolver
    back_offs : iterable of float
        Relative distances from the smallest norm, one after the other.
    """
    program = SemidefiniteProgram()
    unknowns, square = LmiVariables.of_each(program, plants, "hinf"), program.scalar()
    impose(program, unknowns, square)
    coupling(program, unknowns[0])
    program.minimise(square)
    solution = solver.solve(program)
    if solution.x is None:
        return
    least = math.sqrt(max(float(solution.value(square).item()), 0.0))
    for limit in (least * (1 + back_off) for back_off in back_offs):

        def bounded(
            program: SemidefiniteProgram,
            unknowns: Sequence[LmiVariables],
            square: float = limit**2,
        ) -> None:
            impose(program, unknowns, Affine.of(square))

        for controllers in well_conditioned_controllers(plants, "hinf", bounded, solver):
            yield controllers, limit


def reconstruct(plant: PlantMatrices, found: LmiVariables) -> Controller | None:
    """Undo the change of variables, with a balanced factorisation M N' = I - XY."""
    P, (X, Y, Ah, Bh, Ch, D) = plant, found
    U, s, Vt = np.linalg.svd(np.eye(len(X)) - X @ Y)
    if s[-1] <= EPS * s[0]:
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


# A controller from R and S of the projected inequalities, by formulas.
#
# Gahinet, "Explicit controller formulas for LMI-based H-infinity synthesis", Automatica 32 (1996)
# 1007-1014: with R and S given, the inequality in the changed controller variables is solved by
# least squares, one half after the other.

# A feedthrough above this share of gamma has to be lowered by that of the controller.
_CLOSE = 0.999
# R S = I would need a controller with a state less; so close to it, it is moved away.
_LEAST = 1 + 1e-9


def explicit_controller(plant: PlantMatrices, gamma: float, sizes: Matrix) -> Controller | None:
    """Return a controller with a norm below gamma.

    Parameters
    ----------
    plant : PlantMatrices
        D12 and D21 of full rank, in states in which R = S = diag(sizes).
    gamma : float
    sizes : ndarray, shape (n,)

    Returns
    -------
    Controller or None
        None where the numbers do not allow it.
    """
    P, nw, nz = plant, plant.nw, plant.nz
    try:
        D = _direct(P, gamma)
        through = P.D11 + P.D12 @ D @ P.D21
        X = np.diag(np.maximum(sizes, _LEAST))
        W = np.linalg.inv(
            np.block([[gamma * np.eye(nw), -through.T], [-through, gamma * np.eye(nz)]])
        )
        price = np.hstack([np.zeros((P.nu, nw)), P.D12.T])
        noise = np.hstack([P.D21, np.zeros((P.ny, nz))])
        A = P.A + P.B2 @ D @ P.C2
        known = np.hstack([P.B1 + P.B2 @ D @ P.D21, (P.C1 @ X).T])
        seen = np.hstack([X @ P.B1, (P.C1 + P.D12 @ D @ P.C2).T])
        C = -np.linalg.solve(price @ W @ price.T, P.B2.T + price @ W @ known.T)
        B = -np.linalg.solve(noise @ W @ noise.T, P.C2 + noise @ W @ seen.T).T
        inner = -(A + (known + C.T @ price) @ W @ (seen + B @ noise).T).T
        return reconstruct(P, LmiVariables(X, X, inner, B, C, D))
    except np.linalg.LinAlgError:
        return None


def _direct(plant: PlantMatrices, gamma: float) -> Matrix:
    """Return the controller's feedthrough: none, unless the norm of D11 asks for some."""
    P = plant
    if not P.D11.size or np.linalg.norm(P.D11, 2) < _CLOSE * gamma:
        return np.zeros((P.nu, P.ny))
    normal = normalise(P)
    D, free, seen = normal.plant.D11, P.nz - P.nu, P.nw - P.ny
    corner = D[:free, :seen]
    left = gamma**2 * np.eye(free) - corner @ corner.T
    centre = -D[free:, :seen] @ corner.T @ np.linalg.solve(left, D[:free, seen:]) - D[free:, seen:]
    return normal.control @ centre @ normal.measurement
