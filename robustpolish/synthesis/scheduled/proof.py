"""Proofs of a bound for all loops of a polytope: matrices found by a program, checked in balls."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import flint
import numpy as np

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.linear.arithmetic import balls
from robustpolish.linear.arithmetic.balls import Ball, BallSystem, is_definite
from robustpolish.plants.uncertain.system import UncertainSystem
from robustpolish.synthesis.lmi.program import Affine, ProgramSolver
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices
from robustpolish.synthesis.scheduled.polytope import (
    PolytopeProgram,
    PolytopeSpecification,
    Slack,
    with_slack,
)

BITS = 240
"""Precision of the balls in which loops are connected and proofs are checked."""


# How far above the smallest bound proofs are tried: near it no strict inequality is left.
_SLACKS = (3e-4, 3e-3, 3e-2)


def _turned(loop: BallSystem, T: Matrix, unit: float) -> BallSystem:
    """Return the loop in states x = T x_new, with its gain over a power of four."""
    into, root = balls.ball(T), flint.arb(math.sqrt(unit))
    A, B, C, D = loop.transformed(into.inv(), into)
    return BallSystem(A, B * (1 / root), C * (1 / root), D * (1 / flint.arb(unit)))


class ProgramResult(NamedTuple):
    """What a program gave, in doubles that are not verified.

    Attributes
    ----------
    square : float
        Of the bound.
    P : list of ndarray
        The Lyapunov matrices of the family.
    X : Slack or None
        None where it is made of P.
    V : ndarray or None
        The slack of the H2 norm.
    Z : list of ndarray
    """

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
) -> float | None:
    """Prove that all mixtures of loops are stable, and return the smallest bound that is proven.

    Parameters
    ----------
    loops : sequence of BallSystem
        At the vertices, in scaled units.
    specification : PolytopeSpecification
        Of what changes with time the H-infinity norm is the largest ratio of energies of z and w.
    solver : ProgramSolver
    guess : float
        About how large the norm is.

    Returns
    -------
    float or None
        None if there is none, or none was found.
    """
    # A power of four has a root that is a power of two, and rounds nothing.
    unit = float(4.0 ** round(math.log(guess, 4))) if 0 < guess < math.inf else 1.0
    T = np.eye(loops[0].A.nrows())
    least, same = math.inf, all(loop.C == loops[0].C for loop in loops)
    with balls.precision(BITS):
        for _ in range(2):
            inside = [_turned(loop, T, unit) for loop in loops]
            first = lyapunov_analysis([x.doubles for x in inside], specification, solver, same)
            if first is None:
                return None
            least = first.square
            better = _square_root(specification.mean(first.P))
            if better is None:
                break
            T = T @ better
        inside = [_turned(loop, T, unit) for loop in loops]
        doubles = [x.doubles for x in inside]
        for slack in _SLACKS:
            if solver.budget.over:
                return None
            limit = least * (1 + slack) ** 2
            found = lyapunov_analysis(doubles, specification, solver, same, limit)
            bound = found and _checked(inside, specification, found, math.sqrt(limit))
            if bound is not None:
                return math.nextafter(bound * unit, math.inf)
    return None


def lyapunov_analysis(
    loops: Sequence[tuple[Matrix, Matrix, Matrix, Matrix]],
    specification: PolytopeSpecification,
    solver: ProgramSolver,
    same: bool,
    limit: float | None = None,
) -> ProgramResult | None:
    """Return matrices for the smallest norm; with a limit on its square, the most strict ones.

    `same` says whether all loops have the same C, beside which no slack is needed.
    """
    n, nz = len(loops[0][0]), len(loops[0][3])
    program = PolytopeProgram(specification, n)
    hinf, tied = specification.norm == "hinf", specification.tied
    rows = (n, n, nz if hinf else 0)
    X = None if tied else tuple(program.matrix(count, n) for count in rows)
    V = None if same or tied or hinf else program.matrix(n, n)
    square = program.scalar() if limit is None else Affine.of(limit)
    margin = None if limit is None else program.scalar()
    energies = []
    a, b = specification.tied_weights
    for i, (A, B, C, D) in enumerate(loops):
        P = specification.at(i, program.matrices)
        seen = specification.seen(C)
        S = with_slack(X or (P * a, P * b, Affine.of(np.zeros((len(seen), n)))), A, seen)
        CV = C @ (P if V is None else V)
        energies.append(program.impose(i, S, CV, V, (B, D), square, margin))
    program.minimise(square if margin is None else -margin)
    solution = solver.solve(program)
    if solution.x is None:
        return None

    def symmetric(unknowns: Iterable[Affine | None]) -> list[Matrix]:
        values = [solution.value(M) for M in unknowns if M is not None]
        return [(M + M.T) / 2 for M in values]

    return ProgramResult(
        solution.value(square).item(),
        symmetric(program.matrices),
        None if X is None else tuple(solution.value(M) for M in X),
        None if V is None else solution.value(V),
        symmetric(energies),
    )


def _checked(
    loops: Sequence[BallSystem],
    specification: PolytopeSpecification,
    found: ProgramResult,
    gamma: float,
) -> float | None:
    """Return the bound that the matrices prove in ball arithmetic; None if they prove none."""
    hinf = specification.norm == "hinf"
    matrices = [balls.ball(M) for M in found.P]
    largest = flint.arb(0)
    for i, loop in enumerate(loops):
        P = specification.at(i, matrices)
        if not is_definite(P):
            return None
        for rate in specification.rates(matrices):
            level = gamma if hinf else None
            rate = P * 0 if rate is None else rate
            M = _dissipation(P, rate, found.X, loop, level, specification)
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
    """Return the matrix that has to be negative definite."""
    n, nw = P.nrows(), loop.B.ncols()
    # For the H2 norm nothing is seen, which leaves w and its rows out.
    C = loop.C if gamma is not None else balls.zeros(0, n)
    D = loop.D if gamma is not None else balls.zeros(0, nw)
    nz = C.nrows()
    if slack is None:
        a, b = specification.tied_weights
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
    """Return the matrix that has to be positive for Z >= C P C' + D D'."""
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
