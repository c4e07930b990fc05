"""H2 output feedback by linear matrix inequalities: solve, rebalance, back off, verify."""

from __future__ import annotations

import numpy as np

from robustpolish.long_calls import Budget
from robustpolish.synthesis.lmi.output.inequalities import (
    Unknowns,
    Variables,
    coupling,
    impose_h2,
    loop_terms,
)
from robustpolish.synthesis.lmi.output.projected import rebalanced
from robustpolish.synthesis.lmi.output.reconstruction import conditioned, reconstruct
from robustpolish.synthesis.lmi.semidefinite import ProgramSolver, SemidefiniteProgram
from robustpolish.synthesis.output_search.engine import Engine, Found, Task, examine
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices

# Solutions in states that are rebalanced by the last one, and a relative fall that ends them.
_ROUNDS, _AGREEMENT = 4, 2e-3
# How far above the optimum controllers are asked for.
_BACK_OFFS = (1.00005, 1.003)


class LmiH2(Engine):
    """Inequalities (10.29) to (10.32)."""

    def search(self, problem: Task, budget: Budget) -> Found:
        """Minimise the H2 norm of the loop."""
        plant, found = problem.plant, Found("lmi", self.settings.backend)
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

            def impose(program: SemidefiniteProgram, v: Unknowns, bound: float = bound) -> None:
                program.nonnegative(bound**2 - impose_h2(program, loop_terms(frame, v), v))

            for K in conditioned(frame, "h2", impose, solver):
                _note(problem, K, bound, "lmi", found, budget)
        return found


def _h2_optimum(plant: PlantMatrices, solver: ProgramSolver) -> tuple[float, Variables] | None:
    program = SemidefiniteProgram()
    v = Unknowns.of(program, plant, "h2")
    square = impose_h2(program, loop_terms(plant, v), v)
    coupling(program, v)
    program.minimise(square)
    solution = solver.solve(program)
    if solution.x is None:
        return None
    value = float(solution.value(square).item())
    return (value, v.at(solution)) if value > 0 else None


def _note(
    problem: Task, K: Controller, bound: float, origin: str, found: Found, budget: Budget
) -> None:
    candidate = examine(problem, K, bound, origin, budget)
    if candidate is not None:
        found.candidates.append(candidate)
