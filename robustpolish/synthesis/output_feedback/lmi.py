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
from itertools import islice
from typing import NamedTuple

import numpy as np

from robustpolish.base.budget import Budget, step_cost
from robustpolish.synthesis.backends.slycot_backend import synthesise
from robustpolish.synthesis.engine import (
    AS_GOOD_AS_ZERO,
    EPSILONS,
    FALLING,
    SHIFTS,
    Engine,
    Settings,
    Task,
)
from robustpolish.synthesis.lmi.output_feedback import (
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

# Inequalities for more states take longer than a call of "auto" is expected to.
LMI_STATES = 14
# By how much the axis is moved where there are a price and a noise too.
_SHIFTS = (0.0, 1e-5, 1e-7)
# What counts as small in X and XY (:func:`balanced_states`), one choice after the other: no single
# one suits weights with poles over six decades and AC6.
_LEAST = ((1e-2, 1e-2), (1e-1, 1e-2), (1e-4, 1e-4), (1.0, 1.0))
# How far above its optimum a regularised plant is asked for where no lower bound tells.
_ABOVE_OPTIMUM = 1.01


class _RegularisedSolution(NamedTuple):
    """A regularised plant with solutions of its Riccati equations at a gamma."""

    epsilon: float
    shift: float
    plant: PlantMatrices
    gamma: float
    solution: Attempt


class _LmiEngine(Engine):
    """Engines that solve semidefinite programs."""

    method = "lmi"

    def __init__(self, settings: Settings, problem: Task, budget: Budget) -> None:
        super().__init__(settings, problem, budget)
        self.backend = settings.backend
        self.solver = ProgramSolver(settings.backend, settings.solver, budget)


class LmiHinf(_LmiEngine):
    """Projected inequalities; the claims of the candidates are the gammas they were solved for."""

    @staticmethod
    def is_useful(problem: Task, earlier: Sequence[Engine]) -> bool:
        """Tell whether a small plant is left for which no limit of the gain explains the norm."""
        small = problem.plant.nx <= LMI_STATES
        return not earlier or (small and not any(engine.falling for engine in earlier))

    def search(self) -> None:
        """Minimise the H-infinity norm of the loop."""
        if not (self.problem.goal > 0 and self._at_goal()):
            self._downwards()

    def _at_goal(self) -> bool:
        """Aim at the goal on the plants that are regularised the most; tell whether it is met."""
        problem = self.problem
        bound = 0.0 if problem.bound is None else problem.bound.value
        # Share of the tolerance above the lower bound at which the equations of a regularised plant
        # have to have a solution; the inequalities are posed nearer to the tolerance.
        level = max(bound * (1 + 0.7 * problem.tolerance), problem.asked * (1 - 1e-3))
        # Regularisations that are tried where a controller is missed.
        for rung in islice(_feasible(problem.plant, level, self.budget), 2):
            for least in _LEAST:
                self._descend(rung, problem.goal, least)
                if self.best <= problem.goal:
                    return True
        return bool(self.candidates)

    def _downwards(self) -> None:
        """Follow plants that are regularised less and less where no goal is known or reached."""
        start, failures = 1.0, 0
        norms: list[float] = []
        # Programs take long, so that decades have to do.
        for epsilon in EPSILONS[::2]:
            if failures == 2 or self.budget.over:
                break
            rung = _optimal(self.problem.plant, epsilon, start, self.budget)
            if rung is None:
                failures += 1
                continue
            start, before = rung.gamma, self.best
            for least in _LEAST[:2]:
                self._descend(rung, rung.gamma, least)
                if self.best < before:
                    break
            failures = 0 if self.best < before else failures + 1
            norms.append(self.best)
            if self.best <= AS_GOOD_AS_ZERO * norms[0] or self.best <= self.problem.near:
                break
        falls = len(norms) > 2 and norms[-1] < FALLING * norms[-3]
        self.falling = self.best > self.problem.goal and falls

    def _descend(self, rung: _RegularisedSolution, goal: float, least: tuple[float, float]) -> None:
        """Look for controllers with a norm below `goal`, at once or by gammas that fall."""
        solution = rung.solution
        if solution.X is None or solution.Y is None or self.budget.over:
            return
        P = balanced_states(rung.plant, solution.X, solution.Y, rung.gamma, least)
        if P is None:
            return
        # Numbers of order one suit the solver: the norm is divided by the goal, half of it at w and
        # half at z.
        root = np.sqrt(goal)
        P = P.replace(
            B1=P.B1 / root, D21=P.D21 / root, C1=P.C1 / root, D12=P.D12 / root, D11=P.D11 / goal
        )
        if self._solved(P, None, 1.0, goal, rung) is not None:
            return
        # How far above the lower bound gamma starts where the goal itself is not reached.
        gamma, failures = 1.03, 0
        known, reached = (P, None), np.inf
        # The most programs of one descent, of which three may find nothing.
        for _ in range(9):
            after = self._solved(*known, gamma, goal, rung)
            if after is None:
                failures += 1
                if failures > 3 or self.budget.over:
                    return
                # Growth of a first gamma that is not reached either.
                gamma = (gamma + reached) / 2 if np.isfinite(reached) else gamma * 1.02
                continue
            known, reached = after, gamma
            if gamma <= 1.0:
                return
            # What is nearly there is asked for at once.
            # Three tenths of the distance are left after one step.
            lower = 1 + 0.3 * (gamma - 1)
            gamma = lower if lower > 1 + 1e-3 else 1.0

    def _solved(
        self,
        plant: PlantMatrices,
        near: ProjectedSolution | None,
        gamma: float,
        goal: float,
        rung: _RegularisedSolution,
    ) -> tuple[PlantMatrices, ProjectedSolution] | None:
        """Solve at a gamma, in units of `goal`, beside a known solution, if there is one.

        Returns the plant and the solution in better states; None unless the controller keeps gamma.
        """
        point = solve_projected(plant, gamma, self.solver, near)
        after = None if point is None else rebalanced(plant, point.R, point.S)
        K = None if after is None else explicit_controller(after[0], gamma, after[1])
        claim = gamma * goal
        note = {"epsilon": rung.epsilon, "gamma": claim, "achieved": np.nan, "gain": np.nan}
        if rung.shift:
            note["shift"] = rung.shift
        self.history.append(note)
        if K is None or after is None:
            return None
        origin = f"lmi, epsilon {rung.epsilon:.1e}"
        candidate = self.checked(K.shifted_back(rung.shift), claim, origin)
        if candidate is None:
            return None
        note["achieved"], note["gain"] = candidate.achieved, candidate.gain
        self.candidates.append(candidate)
        if not candidate.keeps_claim:
            return None
        sizes = np.diag(after[1])
        return after[0], ProjectedSolution(sizes, sizes, gamma)


def _feasible(plant: PlantMatrices, gamma: float, budget: Budget) -> Iterator[_RegularisedSolution]:
    """Yield regularised plants whose equations have solutions at a gamma, the strongest first."""
    pairs = [(epsilon, shift) for epsilon in EPSILONS for shift in _SHIFTS]
    if has_full_rank(plant):
        pairs = [(0.0, shift) for shift in (0.0, *SHIFTS)] + pairs
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


class LmiH2(_LmiEngine):
    """Inequalities (10.29) to (10.32)."""

    def search(self) -> None:
        """Minimise the H2 norm of the loop."""
        optimum, frame = np.inf, self.problem.plant
        for _ in range(_ROUNDS):
            program = SemidefiniteProgram()
            v = LmiVariables.of(program, frame, "h2")
            energy = impose_h2(program, loop_terms(frame, v), v)
            coupling(program, v)
            program.minimise(energy)
            solution = self.solver.solve(program)
            square = float(solution.value(energy).item())
            if not square > 0:
                break
            values = v.at(solution)
            self.history.append({"claim": np.sqrt(square)})
            self._keep(reconstruct(frame, values), np.sqrt(square) * (1 + 1e-4))
            settled = square > optimum * (1 - _AGREEMENT)
            optimum = min(optimum, square)
            after = rebalanced(frame, values.X, values.Y)
            if after is None:
                break
            frame = after[0]
            if settled:
                break
        if not np.isfinite(optimum):
            return
        for factor in _BACK_OFFS:
            bound = factor * np.sqrt(optimum)

            def impose(program: SemidefiniteProgram, v: LmiVariables, bound: float = bound) -> None:
                program.nonnegative(bound**2 - impose_h2(program, loop_terms(frame, v), v))

            for K in well_conditioned_controllers(frame, "h2", impose, self.solver):
                self._keep(K, bound)

    def _keep(self, K: Controller | None, bound: float) -> None:
        candidate = None if K is None else self.checked(K, bound, "lmi")
        if candidate is not None:
            self.candidates.append(candidate)


# SLICOT's routines as an engine, for comparison: their claims are remarks, not results.

# Regularisation for SLICOT's routines, which refuse plants whose D12 or D21 lacks rank.
SLYCOT_EPSILON = 1e-4


class Slycot(Engine):
    """SB10AD for the H-infinity norm or SB10HD for the H2 norm.

    They find at most one controller, whose claim may be false; a remark says so.
    """

    method = backend = "slycot"

    def search(self) -> None:
        """Run the routine in a process of its own, which the safety net ends."""
        problem = self.problem
        P = regularise(problem.plant, 0.0 if problem.regular else SLYCOT_EPSILON)
        whole = (
            P.A,
            np.hstack([P.B1, P.B2]),
            np.vstack([P.C1, P.C2]),
            np.block([[P.D11, P.D12], [P.D21, np.zeros((P.ny, P.nu))]]),
        )
        routine = "SB10AD" if problem.norm == "hinf" else "SB10HD"
        answer = synthesise(routine, (P.nx, P.nu, P.ny), whole, self.budget.seconds_left)
        self.budget.update_late()
        if answer.controller is None:
            self.remarks.append(f"{answer.message}.")
            return
        claimed = np.inf if answer.gamma is None else answer.gamma
        self.history.append({"gamma": claimed, "regularised": not problem.regular})
        candidate = self.checked(Controller(*answer.controller), claimed, routine)
        if candidate is None:
            self.remarks.append(f"The controller of {routine} does not stabilise the plant.")
            return
        self.candidates.append(candidate)
        if not candidate.keeps_claim:
            self.remarks.append(
                f"{routine} claimed a norm {candidate.achieved / claimed:.4g} times smaller than "
                "that of its loop."
            )
