"""State feedback for the vertices of a polytope: one gain for all, or one that is scheduled.

A program in P, V and L = F V gives a first gain for each tilt of the slack. One gain for all is
then improved in turns: with the gain held the slack is free, with the slack held the gain is, and
each program contains the last answer.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.synthesis.lmi.affine import Affine, symmetric_block
from robustpolish.synthesis.lmi.semidefinite import ProgramSolver, SemidefiniteProgram
from robustpolish.synthesis.lmi.state.coordinates import Coordinates
from robustpolish.synthesis.lmi.state.inequalities import gain_inequality
from robustpolish.synthesis.polytopes.family import LyapunovFamily, combined
from robustpolish.synthesis.polytopes.inequalities import (
    Question,
    Terms,
    extreme_rates,
    impose,
    mean,
    tied_weights,
    with_gain,
    with_slack,
)
from robustpolish.synthesis.polytopes.policy import POLICY
from robustpolish.synthesis.polytopes.proof import Found, analysed
from robustpolish.synthesis.problem.full_state import state_gain_norm
from robustpolish.synthesis.problem.matrices import PlantMatrices


@dataclass(frozen=True, eq=False)
class GainProblem:
    """What is asked for, in scaled units.

    Attributes
    ----------
    plants : tuple of PlantMatrices
        At the vertices.
    question : Question
    scheduled : bool
        A gain for each vertex, mixed as the plants are, instead of one for all.
    """

    plants: tuple[PlantMatrices, ...]
    question: Question
    scheduled: bool = False


@dataclass(frozen=True, eq=False)
class GainFound:
    """Gains, one for each vertex, and the bound that a program claims for them."""

    gains: tuple[Matrix, ...]
    claimed: float


@dataclass(frozen=True, eq=False)
class _Solved:
    """An answer, and coordinates in which the next program is easy."""

    found: GainFound
    easy: Coordinates


def candidates(problem: GainProblem, solver: ProgramSolver) -> Iterator[GainFound]:
    """Yield gains of a small bound, then smaller gains with larger bounds.

    Near the smallest bound gains often grow without limit, until a proof fails.

    Parameters
    ----------
    problem : GainProblem
    solver : ProgramSolver
    """
    best, tilt = _best_tilt(problem, solver)
    if best is None:
        return
    for _ in range(POLICY.rounds):
        again = _program(problem, best.easy, tilt, solver)
        if again is None or again.found.claimed >= best.found.claimed:
            break
        again = _eased(problem, again, best.easy, tilt, solver)
        if again is None:
            break
        best = again
    one_of_many = not (problem.scheduled or problem.question.tied)
    for back_off in POLICY.back_offs:
        limit = best.found.claimed * (1 + back_off)
        smaller = _program(problem, best.easy, tilt, solver, limit)
        for _ in range(POLICY.rounds):
            again = smaller and _program(problem, smaller.easy, tilt, solver, limit, True)
            if again is None or not _is_kept(problem, again.found):
                break
            smaller = again
        if smaller is not None:
            yield _in_turns(problem, smaller, back_off, solver) if one_of_many else smaller.found


def _is_kept(problem: GainProblem, found: GainFound) -> bool:
    """Tell whether the loops of the vertices keep the bound, which rounding may break."""
    norms = (
        state_gain_norm(p, F, problem.question.norm)
        for p, F in zip(problem.plants, found.gains, strict=True)
    )
    return max(norms) <= found.claimed * (1 + POLICY.broken)


def _best_tilt(problem: GainProblem, solver: ProgramSolver) -> tuple[_Solved | None, float]:
    """Return the best first answer, and the weight of the slack on the derivative for it."""
    start = Coordinates.plain(problem.plants[0], 1.0)
    family = LyapunovFamily.common(len(problem.plants))
    common = replace(problem, question=replace(problem.question, family=family))
    plain = _program(common, start, 0.0, solver)
    plain = plain and _eased(common, plain, start, 0.0, solver)
    if problem.question.tied:
        return plain, 0.0
    if plain is not None:
        start = plain.easy
    best, chosen = None, POLICY.tilts[0]
    # In discrete time the inequality has one form that is best where there is but one vertex.
    for tilt in (0.0,) if problem.question.discrete else POLICY.tilts:
        solved = _program(problem, start, tilt, solver)
        if solved is not None and (best is None or solved.found.claimed < best.found.claimed):
            best, chosen = solved, tilt
    return best and _eased(problem, best, start, chosen, solver), chosen


def _eased(
    problem: GainProblem, solved: _Solved, c: Coordinates, tilt: float, solver: ProgramSolver
) -> _Solved:
    """Return an answer with coordinates of one that is well inside its inequalities."""
    inside = _program(problem, c, tilt, solver, solved.found.claimed * (1 + POLICY.room))
    if inside is None:
        return solved
    return replace(solved, easy=replace(inside.easy, unit=solved.found.claimed))


def _program(
    problem: GainProblem,
    c: Coordinates,
    tilt: float,
    solver: ProgramSolver,
    limit: float | None = None,
    gains_themselves: bool = False,
) -> _Solved | None:
    """Minimise the bound; or, with a limit on it, the gains, by their effort or themselves."""
    if solver.budget.over:
        return None  # to put a program together that is not solved takes longer than a limit allows
    program = SemidefiniteProgram()
    plants = [c.apply(p) for p in problem.plants]
    n, nu = plants[0].nx, plants[0].nu
    question = problem.question
    matrices = [program.symmetric(n) for _ in range(question.family.size)]
    rates = extreme_rates(program, question.family, matrices)
    tied = question.tied
    V = matrices[0] if tied else program.matrix(n, n)
    count = len(plants) if problem.scheduled else 1
    gains = [program.matrix(nu, n) for _ in range(count)]
    a, b = tied_weights(question.discrete)
    weights = (a, b) if question.discrete or tied else (tilt, 1.0)
    square = program.scalar() if limit is None else Affine.of((limit / c.unit) ** 2)
    for i, p in enumerate(plants):
        L = gains[i % count]
        AV, CV = p.A @ V + p.B2 @ L, p.C1 @ V + p.D12 @ L
        seen = CV if question.norm == "hinf" else Affine.of(np.zeros((0, n)))
        terms = Terms(with_gain(V, AV, seen, *weights), CV, V, p.B1, p.D11)
        impose(program, question, i, matrices, terms, square, rates=rates)
    if limit is None:
        program.minimise(square)
    elif gains_themselves:
        size, right = program.scalar(), np.linalg.inv(c.T).astype(float)
        for L in gains:
            gain_inequality(program, V, L, size, c.V, right)
        program.minimise(size)
    else:
        program.minimise(_effort(program, gains, V))
    solution = solver.solve(program)
    if solution.x is None:
        return None
    claimed = c.unit * math.sqrt(max(solution.value(square).item(), 0.0))
    v, P = solution.value(V), [solution.value(M) for M in matrices]
    try:
        found = tuple(c.gain(v.T, solution.value(L)) for L in gains)
        middle = mean([combined(row, P) for row in question.family.shares])
        sizes = np.sqrt(mean([solution.value(L) ** 2 for L in gains]))
        following = c.next(plants[0], middle, sizes, even_out=False)
    except np.linalg.LinAlgError:
        return None
    if not (math.isfinite(claimed) and claimed > 0 and all(np.isfinite(F).all() for F in found)):
        return None
    return _Solved(
        GainFound(tuple(found[i % count] for i in range(len(plants))), claimed),
        replace(following, unit=claimed),
    )


def _effort(program: SemidefiniteProgram, gains: list[Affine], V: Affine) -> Affine:
    """Return what is to be small: F V F' of each gain, summed."""
    total = Affine.of(0.0)
    for L in gains:
        W = program.symmetric(L.shape[0])
        program.positive(symmetric_block([[W, L], [(V + V.T) / 2]]))
        total = total + W.trace
    return total


def _in_turns(
    problem: GainProblem, start: _Solved, back_off: float, solver: ProgramSolver
) -> GainFound:
    """Improve one gain for all: with the gain held the slack is free, and the other way round."""
    c, best = start.easy, start.found
    plants = [c.apply(p) for p in problem.plants]
    # In these coordinates u = V F T x.
    F = np.linalg.solve(c.V, best.gains[0] @ c.T)
    rooms = list(POLICY.turn_rooms)
    held = _held(problem, plants, F, rooms[0], solver)
    for _ in range(POLICY.turns):
        if held is None or not rooms:
            break
        moved = _moved(problem, plants, held, solver, None)
        again = None if moved is None else _held(problem, plants, moved, rooms[0], solver)
        enough = (1 - POLICY.gain_of_turn) ** 2
        slow = again is None or again.square > enough * held.square
        if moved is not None and again is not None and again.square < held.square:
            F, held = moved, again
        if slow:
            rooms = rooms[1:]
            nearer = _held(problem, plants, F, rooms[0], solver) if rooms else None
            held = nearer or held
    if held is not None:
        level = math.sqrt(held.square) * c.unit
        if level < best.claimed:
            limit = held.square * (1 + back_off) ** 2
            smaller = _moved(problem, plants, held, solver, limit)
            if smaller is not None:
                F, level = smaller, level * (1 + back_off)
            gain: Matrix = c.V @ F @ np.linalg.inv(c.T)
            return GainFound((gain,) * len(plants), level)
    return best


def _held(
    problem: GainProblem,
    plants: list[PlantMatrices],
    F: Matrix,
    room: float,
    solver: ProgramSolver,
) -> Found | None:
    """Return a slack well inside the inequalities for a gain, with the least square of the norm."""
    loops = [(p.A + p.B2 @ F, p.B1, p.C1 + p.D12 @ F, p.D11) for p in plants]
    same = all(np.array_equal(loop[2], loops[0][2]) for loop in loops)
    least = analysed(loops, problem.question, solver, same)
    if least is None or not least.square > 0:
        return None
    limit = least.square * (1 + room) ** 2
    inside = analysed(loops, problem.question, solver, same, limit)
    return None if inside is None else replace(inside, square=least.square)


def _moved(
    problem: GainProblem,
    plants: list[PlantMatrices],
    held: Found,
    solver: ProgramSolver,
    limit: float | None,
) -> Matrix | None:
    """Return the gain of the smallest bound with the slack held; with a limit, the smallest."""
    question = problem.question
    program = SemidefiniteProgram()
    n, nu = plants[0].nx, plants[0].nu
    matrices = [program.symmetric(n) for _ in range(question.family.size)]
    rates = extreme_rates(program, question.family, matrices)
    F = program.matrix(nu, n)
    square = program.scalar() if limit is None else Affine.of(limit)
    assert held.X is not None
    for i, p in enumerate(plants):
        A, C = p.A + p.B2 @ F, p.C1 + p.D12 @ F
        seen = C if question.norm == "hinf" else Affine.of(np.zeros((0, n)))
        V = held.V if held.V is not None else combined(question.family.shares[i], held.P)
        terms = Terms(with_slack(held.X, A, seen), C @ V, V, p.B1, p.D11)
        impose(program, question, i, matrices, terms, square, rates=rates)
    if limit is None:
        program.minimise(square)
    else:
        size, eyes = program.scalar(), (np.eye(nu), np.eye(n))
        program.positive(symmetric_block([[size.times(eyes[0]), F], [size.times(eyes[1])]]))
        program.minimise(size)
    solution = solver.solve(program)
    return None if solution.x is None else solution.value(F)
