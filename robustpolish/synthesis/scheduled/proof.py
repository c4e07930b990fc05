"""Proofs of a bound for all loops of a polytope: matrices found by a program, checked in balls."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import flint
import numpy as np

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.linear.arithmetic import balls
from robustpolish.linear.arithmetic.balls import Ball
from robustpolish.linear.proofs.bounded_real import BallSystem
from robustpolish.linear.proofs.definite import is_definite
from robustpolish.plants.uncertain.system import UncertainSystem
from robustpolish.synthesis.lmi.program import Affine, ProgramSolver, SemidefiniteProgram
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices
from robustpolish.synthesis.scheduled.polytope import (
    POLICY,
    PolytopeSpecification,
    Slack,
    Terms,
    extreme_rates,
    impose,
    mean,
    tied_weights,
    weighted_sum,
    with_slack,
)

BITS = 240
"""Precision of the balls in which loops are connected and proofs are checked."""


def _turned(loop: BallSystem, T: Matrix, unit: float) -> BallSystem:
    """Return the loop in states x = T x_new, with its gain over a power of four."""
    into, root = balls.ball(T), flint.arb(math.sqrt(unit))
    A, B, C, D = loop.transformed(into.inv(), into)
    return BallSystem(A, B * (1 / root), C * (1 / root), D * (1 / flint.arb(unit)))


@dataclass(frozen=True, eq=False)
class PolytopeProof:
    """Matrices that prove stability and a bound on the norm for a whole polytope.

    Attributes
    ----------
    bound : float
        Of the norm, in the units of the loops.
    P : tuple of ndarray
        The Lyapunov matrices of the family, in the states of `transformation`.
    X : tuple of ndarray
        The slack on the derivative, the state and w; empty where it is made of P.
    transformation : ndarray
        T of x = T x_new.
    """

    bound: float
    P: tuple[Matrix, ...]
    X: tuple[Matrix, ...]
    transformation: Matrix


@dataclass(frozen=True, eq=False)
class ProgramResult:
    """What a program gave: doubles, not verified."""

    square: float
    P: list[Matrix]
    X: Slack | None
    V: Matrix | None
    Z: list[Matrix]


def prove(
    loops: Sequence[BallSystem],
    specification: PolytopeSpecification,
    solver: ProgramSolver,
    guess: float,
) -> PolytopeProof | None:
    """Prove that all mixtures of loops are stable, and find the smallest bound that is proven.

    Parameters
    ----------
    loops : sequence of BallSystem
        At the vertices, in scaled units.
    question : PolytopeSpecification
        Of what changes with time the H-infinity norm is the largest ratio of energies of z and w.
    solver : ProgramSolver
    guess : float
        About how large the norm is.

    Returns
    -------
    PolytopeProof or None
        None if there is none, or none was found.
    """
    unit = _power_of_four(guess)
    T = np.eye(loops[0].A.nrows())
    # Where all loops have the same C no slack is needed beside it.
    first: ProgramResult | None = None
    same = all(loop.C == loops[0].C for loop in loops)
    with balls.precision(BITS):
        for _ in range(2):
            inside = [_turned(loop, T, unit) for loop in loops]
            first = lyapunov_analysis([x.doubles for x in inside], specification, solver, same)
            if first is None:
                return None
            better = _square_root(
                mean([weighted_sum(row, first.P) for row in specification.family.shares])
            )
            if better is None:
                break
            T = T @ better
        inside = [_turned(loop, T, unit) for loop in loops]
        least = math.inf if first is None else first.square
        for slack in POLICY.slacks:
            if solver.budget.over:
                return None
            doubles = [x.doubles for x in inside]
            limit = least * (1 + slack) ** 2
            found = lyapunov_analysis(doubles, specification, solver, same, limit)
            if found is None:
                continue
            gamma = math.sqrt(limit)
            bound = _checked(inside, specification, found, gamma)
            if bound is not None:
                X = () if found.X is None else tuple(found.X)
                up = math.nextafter(bound * unit, math.inf)
                return PolytopeProof(up, tuple(found.P), X, T)
    return None


def lyapunov_analysis(
    loops: Sequence[tuple[Matrix, Matrix, Matrix, Matrix]],
    specification: PolytopeSpecification,
    solver: ProgramSolver,
    same: bool,
    limit: float | None = None,
) -> ProgramResult | None:
    """Return matrices for the smallest norm; with a limit on its square, the most strict ones.

    `same` says whether all loops have the same C.
    """
    n, nz = len(loops[0][0]), len(loops[0][3])
    program = SemidefiniteProgram()
    matrices = [program.symmetric(n) for _ in range(specification.family.size)]
    hinf = specification.norm == "hinf"
    X = None
    if not specification.tied:
        X = Slack(*(program.matrix(rows, n) for rows in (n, n, nz if hinf else 0)))
    V = None if same or specification.tied or hinf else program.matrix(n, n)
    square = program.scalar() if limit is None else Affine.of(limit)
    margin = None if limit is None else program.scalar()
    rates = extreme_rates(program, specification.family, matrices)
    energies = []
    a, b = tied_weights(specification.discrete)
    for i, (A, B, C, D) in enumerate(loops):
        P = weighted_sum(specification.family.shares[i], matrices)
        seen = specification.seen(C)
        slack = X or Slack(P * a, P * b, Affine.of(np.zeros((len(seen), n))))
        terms = Terms(with_slack(slack, A, seen), C @ (P if V is None else V), V, B, D)
        energies.append(impose(program, specification, i, matrices, terms, square, margin, rates))
    program.minimise(square if margin is None else -margin)
    solution = solver.solve(program)
    if solution.x is None:
        return None
    values = [solution.value(M) for M in matrices]
    return ProgramResult(
        solution.value(square).item(),
        [(M + M.T) / 2 for M in values],
        None if X is None else Slack(*(solution.value(M) for M in X)),
        None if V is None else solution.value(V),
        [(M + M.T) / 2 for M in (solution.value(Z) for Z in energies if Z is not None)],
    )


def _checked(
    loops: Sequence[BallSystem],
    specification: PolytopeSpecification,
    found: ProgramResult,
    gamma: float,
) -> float | None:
    """Return the bound that the matrices prove in ball arithmetic; None if they prove none."""
    hinf, family = specification.norm == "hinf", specification.family
    matrices = [balls.ball(M) for M in found.P]
    largest = flint.arb(0)
    for i, loop in enumerate(loops):
        P = weighted_sum(family.shares[i], matrices)
        if not is_definite(P):
            return None
        for drift in family.drifts:
            rate = weighted_sum(drift, matrices) if drift.any() else P * 0
            M = _dissipation(P, rate, found.X, loop, gamma if hinf else None, specification)
            if not is_definite(-M):
                return None
        if not hinf:
            Z = balls.ball(found.Z[i])
            if not is_definite(_energy(Z, loop, found.V, P)):
                return None
            trace = sum((Z[k, k] for k in range(Z.nrows())), flint.arb(0))
            largest = max(largest, flint.arb(trace.upper()), key=lambda x: float(x.upper()))
    if hinf:
        return gamma
    return math.nextafter(math.sqrt(math.nextafter(float(largest.upper()), math.inf)), math.inf)


def _dissipation(
    P: Ball,
    rate: Ball,
    slack: Slack | None,
    loop: BallSystem,
    gamma: float | None,
    specification: PolytopeSpecification,
) -> Ball:
    """Return the matrix of :func:`inequalities.dissipation` in balls."""
    n, nw = P.nrows(), loop.B.ncols()
    # For the H2 norm nothing is seen, which leaves w and its rows out.
    C = loop.C if gamma is not None else balls.zeros(0, n)
    D = loop.D if gamma is not None else balls.zeros(0, nw)
    nz = C.nrows()
    if slack is None:
        a, b = tied_weights(specification.discrete)
        X = balls.block([[P * a], [P * b], [balls.zeros(nz, n)]])
    else:
        X = balls.block([[balls.ball(M)] for M in slack])
    none, side, low = balls.zeros(n, n), balls.zeros(n, nz), balls.zeros(nz, n)
    Q = [[P, none], [none, -P]] if specification.discrete else [[none, P], [P, -rate]]
    level = balls.identity(nz) * (flint.arb(gamma or 0.0) ** 2)
    whole = balls.block([[*Q[0], side], [*Q[1], side], [low, low, -level]])
    S = X * balls.block([[-balls.identity(n), loop.A.transpose(), C.transpose()]])
    whole = whole + S + S.transpose()
    source = balls.block([[balls.zeros(n, nw)], [loop.B], [D]])
    M = balls.block([[whole, source], [source.transpose(), -balls.identity(nw)]])
    if specification.tied and not specification.discrete:
        return balls.part(M, slice(n, None), slice(n, None))
    return M


def _energy(Z: Ball, loop: BallSystem, V: Matrix | None, P: Ball) -> Ball:
    """Return the matrix of :func:`inequalities.energy` in balls."""
    slack = P if V is None else balls.ball(V)
    CV = loop.C * slack
    between = P if V is None else slack + slack.transpose() - P
    none = balls.zeros(P.nrows(), loop.D.ncols())
    return balls.block(
        [
            [Z, CV, loop.D],
            [CV.transpose(), between, none],
            [loop.D.transpose(), none.transpose(), balls.identity(loop.D.ncols())],
        ]
    )


def _power_of_four(size: float) -> float:
    if not 0 < size < math.inf:
        return 1.0
    return float(4.0 ** round(math.log(size, 4)))


def _square_root(P: Matrix) -> Matrix | None:
    values, vectors = np.linalg.eigh((P + P.T) / 2)
    if not (np.isfinite(values).all() and values[-1] > 0):
        return None
    return vectors * np.sqrt(np.maximum(values, 1e-10 * values[-1]))


# Loops at the vertices, connected without rounding, and the loop of an uncertain system.


def state_loop(p: PlantMatrices, F: Matrix) -> BallSystem:
    """Return the loop of u = F x in balls."""
    n = p.nx
    seen = replace(p, C2=np.eye(n), D21=np.zeros((n, p.nw)), D22=np.zeros((n, p.nu)))
    none = np.zeros((0, 0)), np.zeros((0, n)), np.zeros((p.nu, 0))
    return output_loop(seen, Controller(*none, F))


def output_loop(p: PlantMatrices, K: Controller) -> BallSystem:
    """Return the loop of a dynamic controller in balls, for a plant without D22."""
    with balls.precision(BITS):
        return BallSystem.closed_loop(p, K)


def uncertain_loop(system: UncertainSystem, nz: int, F: Matrix) -> UncertainSystem:
    """Return an uncertain system, its last inputs closed by u = F x, with its first outputs."""
    one = system.matrices
    n, inside = len(one.states), one.F.shape[1]
    seen = replace(
        one,
        H=np.vstack([one.H[:nz], np.eye(n, inside)]),
        J=np.vstack([one.J[:nz], np.zeros((n, one.J.shape[1]))]),
        outputs=(*system.output_labels[:nz], *(f"measured_{name}" for name in one.states)),
    )
    return UncertainSystem(seen).lft(F)
