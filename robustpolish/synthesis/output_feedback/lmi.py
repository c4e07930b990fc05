"""H-infinity output feedback by linear matrix inequalities: balance, solve, tighten, verify.

The projected inequalities are feasibility problems at one gamma. Where gamma has to go is told by
the lower bound, and in which states and units to pose them by the Riccati equations of the
plant, regularised as much as that gamma allows: coordinates change no inequality, but
decide whether a solver in double precision can answer it. R and S, and the controller made of
them, are the inequalities' own. A gamma that is not reached at once is approached in steps,
the solution of one being the unit of the next.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from robustpolish.base.budget import Budget, step_cost
from robustpolish.synthesis.backends.slycot_backend import synthesise
from robustpolish.synthesis.engine import (
    POLICY,
    Candidate,
    Engine,
    EngineResult,
    Task,
    check_candidate,
)
from robustpolish.synthesis.lmi.output_feedback import (
    LmiValues,
    LmiVariables,
    ProjectedSolution,
    balanced_states,
    coupling,
    explicit_controller,
    impose_h2,
    loop_terms,
    rebalanced,
    reconstruct,
    solve_projected,
    well_conditioned_controllers,
)
from robustpolish.synthesis.lmi.program import ProgramSolver, SemidefiniteProgram
from robustpolish.synthesis.problem.matrices import (
    Controller,
    PlantMatrices,
    regularise,
    shifted,
    with_penalty_and_noise,
)
from robustpolish.synthesis.riccati.gamma import Attempt, has_full_rank, normalise, search_gamma

# By how much the axis is moved where there are a price and a noise too.
_SHIFTS = (0.0, 1e-5, 1e-7)
# What counts as small in X and XY (:func:`balanced_states`), one choice after the other: no single
# one suits weights with poles over six decades and AC6.
_LEAST = ((1e-2, 1e-2), (1e-1, 1e-2), (1e-4, 1e-4), (1.0, 1.0))
# How far above its optimum a regularised plant is asked for where no lower bound tells.
_ABOVE_OPTIMUM = 1.01


@dataclass(frozen=True, eq=False)
class _RegularisedSolution:
    """A regularised plant with solutions of its Riccati equations at a gamma."""

    epsilon: float
    shift: float
    plant: PlantMatrices
    gamma: float
    solution: Attempt


class LmiHinf(Engine):
    """Projected inequalities; the claims of the candidates are the gammas they were solved for."""

    def is_useful(self, problem: Task, earlier: Sequence[EngineResult]) -> bool:
        """Tell whether a small plant is left for which no limit of the gain explains the norm."""
        small = problem.plant.nx <= POLICY.lmi_states
        return not earlier or (small and not any(f.falling for f in earlier))

    def search(self, problem: Task, budget: Budget) -> EngineResult:
        """Minimise the H-infinity norm of the loop."""
        found = EngineResult("lmi", self.settings.backend)
        solver = ProgramSolver(self.settings.backend, self.settings.solver, budget)
        descent = _GammaDescent(problem, solver, found)
        reachable = problem.goal > 0 and self._at_goal(descent)
        if not reachable:
            self._downwards(descent)
        return found

    def _at_goal(self, descent: _GammaDescent) -> bool:
        """Aim at the goal on the plants that are regularised the most; tell whether it is met."""
        problem, found = descent.problem, descent.found
        bound = 0.0 if problem.bound is None else problem.bound.value
        # Share of the tolerance above the lower bound at which the equations of a regularised plant
        # have to have a solution; the inequalities are posed nearer to the tolerance.
        level = max(bound * (1 + 0.7 * problem.tolerance), problem.asked * (1 - 1e-3))
        rungs = _feasible(problem.plant, level, descent.budget)
        # Regularisations that are tried where a controller is missed.
        for rung in islice(rungs, 2):
            for least in _LEAST:
                descent.run(rung, problem.goal, least)
                if found.best <= problem.goal:
                    return True
        return bool(found.candidates)

    def _downwards(self, descent: _GammaDescent) -> None:
        """Follow plants that are regularised less and less where no goal is known or reached."""
        problem, found = descent.problem, descent.found
        start, failures = 1.0, 0
        norms: list[float] = []
        # Programs take long, so that decades have to do.
        for epsilon in POLICY.epsilons[::2]:
            if failures == 2 or descent.budget.over:
                break
            rung = _optimal(problem.plant, epsilon, start, descent.budget)
            if rung is None:
                failures += 1
                continue
            start = rung.gamma
            before = found.best
            for least in _LEAST[:2]:
                descent.run(rung, rung.gamma, least)
                if found.best < before:
                    break
            failures = 0 if found.best < before else failures + 1
            norms.append(found.best)
            if found.best <= POLICY.as_good_as_zero * norms[0] or found.best <= problem.near:
                break
        found.falling = (
            found.best > problem.goal and len(norms) > 2 and norms[-1] < POLICY.falling * norms[-3]
        )


class _GammaDescent:
    """Programs at gammas that fall, on one regularised plant in one set of states."""

    def __init__(self, problem: Task, solver: ProgramSolver, found: EngineResult) -> None:
        self.problem, self.solver, self.found = problem, solver, found
        self.budget = solver.budget

    def run(self, rung: _RegularisedSolution, goal: float, least: tuple[float, float]) -> None:
        """Look for controllers with a norm below `goal`, at once or step by step."""
        solution = rung.solution
        if solution.X is None or solution.Y is None or self.budget.over:
            return
        frame = balanced_states(rung.plant, solution.X, solution.Y, rung.gamma, least)
        if frame is None:
            return
        # Numbers of order one suit the solver.
        start = _KnownSolution(_in_unit(frame, goal), None)
        if self._solved(start, 1.0, goal, rung) is not None:
            return
        # How far above the lower bound gamma starts where the goal itself is not reached.
        gamma, failures = 1.03, 0
        known, reached = start, np.inf
        # The most programs of one descent, of which three may find nothing.
        for _ in range(9):
            after = self._solved(known, gamma, goal, rung)
            if after is None:
                failures += 1
                if failures > 3 or self.budget.over:
                    return
                # Growth of a first gamma that is not reached either.
                higher = gamma * 1.02
                gamma = (gamma + reached) / 2 if np.isfinite(reached) else higher
                continue
            known, reached = after, gamma
            if gamma <= 1.0:
                return
            # What is nearly there is asked for at once.
            # Three tenths of the distance are left after one step.
            lower = 1 + 0.3 * (gamma - 1)
            gamma = lower if lower > 1 + 1e-3 else 1.0

    def _solved(
        self, known: _KnownSolution, gamma: float, goal: float, rung: _RegularisedSolution
    ) -> _KnownSolution | None:
        """Solve at a gamma, in units of `goal`; None unless the controller keeps it."""
        point = solve_projected(known.plant, gamma, self.solver, known.point)
        after = None if point is None else rebalanced(known.plant, point.R, point.S)
        K = None if after is None else explicit_controller(after[0], gamma, after[1])
        claim = gamma * goal
        note = {"epsilon": rung.epsilon, "gamma": claim, "achieved": np.nan, "gain": np.nan}
        if rung.shift:
            note["shift"] = rung.shift
        self.found.history.append(note)
        candidate: Candidate | None = None
        if K is not None:
            origin = f"lmi, epsilon {rung.epsilon:.1e}"
            back = K.shifted_back(rung.shift)
            candidate = check_candidate(self.problem, back, claim, origin, self.budget)
        if candidate is None or after is None:
            return None
        note["achieved"], note["gain"] = candidate.achieved, candidate.gain
        self.found.candidates.append(candidate)
        if not candidate.keeps_claim:
            return None
        sizes = np.diag(after[1])
        return _KnownSolution(after[0], ProjectedSolution(sizes, sizes, gamma))


@dataclass(frozen=True, eq=False)
class _KnownSolution:
    """A plant in some states, and a solution of its inequalities, if one is known."""

    plant: PlantMatrices
    point: ProjectedSolution | None


def _in_unit(plant: PlantMatrices, unit: float) -> PlantMatrices:
    """Divide the norm by `unit`, half of it at w and half at z."""
    P, root = plant, np.sqrt(unit)
    return P.replace(
        B1=P.B1 / root, D21=P.D21 / root, C1=P.C1 / root, D12=P.D12 / root, D11=P.D11 / unit
    )


def _feasible(plant: PlantMatrices, gamma: float, budget: Budget) -> Iterator[_RegularisedSolution]:
    """Yield regularised plants whose equations have solutions at a gamma, the strongest first."""
    pairs = [(epsilon, shift) for epsilon in POLICY.epsilons for shift in _SHIFTS]
    if has_full_rank(plant):
        pairs = [(0.0, shift) for shift in (0.0, *POLICY.shifts)] + pairs
    for epsilon, shift in pairs:
        if budget.over:
            return
        regular = shifted(with_penalty_and_noise(plant, epsilon), shift)
        budget.spend(step_cost(plant.nx))
        solution = normalise(regular).halves.attempt(gamma)
        if solution.feasible:
            yield _RegularisedSolution(epsilon, shift, regular, gamma, solution)


def _optimal(
    plant: PlantMatrices, epsilon: float, start: float, budget: Budget
) -> _RegularisedSolution | None:
    """Return a regularised plant a little above the optimum of its equations.

    Of all shifts that with the smallest optimum: a smaller one leaves zeros too near the axis.
    """
    best: _RegularisedSolution | None = None
    for shift in _SHIFTS:
        regular = shifted(with_penalty_and_noise(plant, epsilon), shift)
        halves = normalise(regular).halves
        bracket = search_gamma(halves, start, _ABOVE_OPTIMUM - 1, budget)
        gamma = np.inf if bracket is None else bracket.upper * _ABOVE_OPTIMUM
        if best is None or gamma < best.gamma:
            solution = halves.attempt(gamma) if np.isfinite(gamma) else None
            if solution is not None and solution.feasible:
                best = _RegularisedSolution(epsilon, shift, regular, gamma, solution)
    return best


# H2 output feedback by linear matrix inequalities: solve, rebalance, back off, verify.

# Solutions in states that are rebalanced by the last one, and a relative fall that ends them.
_ROUNDS, _AGREEMENT = 4, 2e-3
# How far above the optimum controllers are asked for.
_BACK_OFFS = (1.00005, 1.003)


class LmiH2(Engine):
    """Inequalities (10.29) to (10.32)."""

    def search(self, problem: Task, budget: Budget) -> EngineResult:
        """Minimise the H2 norm of the loop."""
        plant, found = problem.plant, EngineResult("lmi", self.settings.backend)
        solver = ProgramSolver(self.settings.backend, self.settings.solver, budget)
        optimum, frame = np.inf, plant
        trial: PlantMatrices | None = plant
        for _ in range(_ROUNDS):
            solution = None if trial is None else _h2_optimum(trial, solver)
            if trial is None or solution is None:
                break
            square, values = solution
            found.history.append({"claim": np.sqrt(square)})
            direct = reconstruct(trial, values)
            if direct is not None:
                _note(problem, direct, np.sqrt(square) * (1 + 1e-4), "lmi", found, budget)
            settled = square > optimum * (1 - _AGREEMENT)
            optimum = min(optimum, square)
            after = rebalanced(trial, values.X, values.Y)
            frame, trial = trial, None if after is None else after[0]
            if settled:
                break
        if not np.isfinite(optimum):
            return found
        frame = frame if trial is None else trial
        for factor in _BACK_OFFS:
            bound = factor * np.sqrt(optimum)

            def impose(program: SemidefiniteProgram, v: LmiVariables, bound: float = bound) -> None:
                program.nonnegative(bound**2 - impose_h2(program, loop_terms(frame, v), v))

            for K in well_conditioned_controllers(frame, "h2", impose, solver):
                _note(problem, K, bound, "lmi", found, budget)
        return found


def _h2_optimum(plant: PlantMatrices, solver: ProgramSolver) -> tuple[float, LmiValues] | None:
    program = SemidefiniteProgram()
    v = LmiVariables.of(program, plant, "h2")
    square = impose_h2(program, loop_terms(plant, v), v)
    coupling(program, v)
    program.minimise(square)
    solution = solver.solve(program)
    if solution.x is None:
        return None
    value = float(solution.value(square).item())
    return (value, v.at(solution)) if value > 0 else None


def _note(
    problem: Task, K: Controller, bound: float, origin: str, found: EngineResult, budget: Budget
) -> None:
    candidate = check_candidate(problem, K, bound, origin, budget)
    if candidate is not None:
        found.candidates.append(candidate)


# SLICOT's routines as an engine, for comparison: their claims are remarks, not results.


class Slycot(Engine):
    """SB10AD for the H-infinity norm or SB10HD for the H2 norm.

    They find at most one controller, whose claim may be false; a remark says so.
    """

    def search(self, problem: Task, budget: Budget) -> EngineResult:
        """Run the routine in a process of its own, which the safety net ends."""
        found = EngineResult("slycot", "slycot")
        # The routines need D12 and D21 of full rank.
        P = regularise(problem.plant, 0.0 if problem.regular else POLICY.slycot_epsilon)
        whole = (
            P.A,
            np.hstack([P.B1, P.B2]),
            np.vstack([P.C1, P.C2]),
            np.block([[P.D11, P.D12], [P.D21, np.zeros((P.ny, P.nu))]]),
        )
        routine = "SB10AD" if problem.norm == "hinf" else "SB10HD"
        answer = synthesise(routine, (P.nx, P.nu, P.ny), whole, budget.seconds_left)
        budget.update_late()
        if answer.controller is None:
            found.remarks.append(f"{answer.message}.")
            return found
        claimed = np.inf if answer.gamma is None else answer.gamma
        found.history.append({"gamma": claimed, "regularised": not problem.regular})
        candidate = check_candidate(
            problem, Controller(*answer.controller), claimed, routine, budget
        )
        if candidate is None:
            found.remarks.append(f"The controller of {routine} does not stabilise the plant.")
            return found
        found.candidates.append(candidate)
        if not candidate.keeps_claim:
            found.remarks.append(
                f"{routine} claimed a norm {candidate.achieved / claimed:.4g} times smaller than "
                "that of its loop."
            )
        return found
