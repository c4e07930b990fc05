"""Output feedback by linear matrix inequalities: scale, solve, rebalance, back off, verify."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robustpolish.long_calls import Budget
from robustpolish.synthesis.lmi.output.inequalities import (
    Unknowns,
    Variables,
    bounded_real,
    coupling,
    impose_h2,
    loop_terms,
)
from robustpolish.synthesis.lmi.output.projected import Projected, rebalanced, solve_projected
from robustpolish.synthesis.lmi.output.reconstruction import conditioned, reconstruct
from robustpolish.synthesis.lmi.semidefinite import ProgramSolver, SemidefiniteProgram
from robustpolish.synthesis.output_search.engine import Engine, Found, Task, examine
from robustpolish.synthesis.output_search.policy import POLICY
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices, regularise
from robustpolish.synthesis.riccati.infimum import search_gamma
from robustpolish.synthesis.riccati.two_riccati import normalise


@dataclass(frozen=True)
class LmiPolicy:
    """Thresholds of the inequalities.

    Attributes
    ----------
    back_off, far_back : float
        How far above the optimum controllers are asked for, and where none is found nearer.
    h2_back_off : tuple of float
        The same for the H2 norm.
    rounds : int
        Solutions in states that are rebalanced by the last one.
    fine_agreement, coarse_agreement, small_states : float, float, int
        A relative fall of gamma that ends the rounds: a finer one up to so many states, where
        a round takes little time.
    epsilons : tuple of float
        Regularisations; with less the inequalities are as hard as the original ones.
    nothing, hardly : float
        An optimum below this share of that of a hardly regularised plant is taken for zero.
    """

    back_off: float = 1.006
    far_back: float = 1.02
    h2_back_off: tuple[float, ...] = (1.00005, 1.003)
    rounds: int = 4
    coarse_agreement: float = 2e-3
    fine_agreement: float = 1e-5
    small_states: int = 6
    epsilons: tuple[float, ...] = (0.0, 1e-5, 1e-4, 1e-3)
    nothing: float = 0.1
    hardly: float = 1e-4

    def agreement(self, states: int) -> float:
        """Return the fall of gamma that ends the rounds."""
        return self.coarse_agreement if states > self.small_states else self.fine_agreement


_POLICY = LmiPolicy()


class LmiHinf(Engine):
    """Inequalities (10.20) to (10.24); the claims of the candidates are the backed-off bounds."""

    def adds(self, problem: Task, earlier: Sequence[Found]) -> bool:
        """Tell whether a small plant is left for which no limit of the gain explains the norm."""
        small = problem.plant.nx <= POLICY.lmi_states
        return not earlier or (small and not any(f.falling for f in earlier))

    def search(self, problem: Task, budget: Budget) -> Found:
        """Minimise the H-infinity norm of the loop."""
        plant, found = problem.plant, Found("lmi", self.settings.backend)
        solver = ProgramSolver(self.settings.backend, self.settings.solver, budget)
        # Numbers of order one suit the solver; those below do no harm.
        hardly = _hardly_regular_optimum(plant, budget)
        unit = max(1.0, hardly)
        frames: list[tuple[float, float, PlantMatrices]] = []

        def back_off(epsilon: float, frame: PlantMatrices, bound: float) -> bool:
            """Look for controllers below a bound; tell whether one keeps it."""

            def impose(program: SemidefiniteProgram, v: Unknowns) -> None:
                program.positive(-bounded_real(loop_terms(frame, v), bound))

            origin = f"lmi, epsilon {epsilon:.1e}"
            for K in conditioned(frame, "hinf", impose, solver):
                _note(problem, K, bound * unit, origin, found, budget)
            return any(c.honest for c in found.candidates)

        for epsilon in _POLICY.epsilons:
            regular = _in_unit(regularise(plant, epsilon), unit)
            best, frame = _balanced_optimum(regular, solver, found, epsilon, unit)
            if best is None or frame is None:
                continue
            frames.append((epsilon, best.gamma, frame))
            nothing = _POLICY.nothing * hardly / unit
            falling = best.gamma < nothing
            if back_off(epsilon, frame, nothing if falling else _POLICY.back_off * best.gamma):
                found.falling = falling
                return found
        # A controller some way from the optimum is better than none.
        for epsilon, gamma, frame in frames:
            if back_off(epsilon, frame, _POLICY.far_back * gamma):
                break
        return found


class LmiH2(Engine):
    """Inequalities (10.29) to (10.32)."""

    def search(self, problem: Task, budget: Budget) -> Found:
        """Minimise the H2 norm of the loop."""
        plant, found = problem.plant, Found("lmi", self.settings.backend)
        solver = ProgramSolver(self.settings.backend, self.settings.solver, budget)
        optimum, frame = np.inf, plant
        trial: PlantMatrices | None = plant
        for _ in range(_POLICY.rounds):
            solution = None if trial is None else _h2_optimum(trial, solver)
            if trial is None or solution is None:
                break
            square, values = solution
            found.history.append({"claim": np.sqrt(square)})
            direct = reconstruct(trial, values)
            if direct is not None:
                _note(problem, direct, np.sqrt(square) * (1 + 1e-4), "lmi", found, budget)
            settled = square > optimum * (1 - _POLICY.coarse_agreement)
            optimum = min(optimum, square)
            frame, trial = trial, rebalanced(trial, values.X, values.Y)
            if settled:
                break
        if not np.isfinite(optimum):
            return found
        frame = frame if trial is None else trial
        for factor in _POLICY.h2_back_off:
            bound = factor * np.sqrt(optimum)

            def impose(program: SemidefiniteProgram, v: Unknowns, bound: float = bound) -> None:
                program.nonnegative(bound**2 - impose_h2(program, loop_terms(frame, v), v))

            for K in conditioned(frame, "h2", impose, solver):
                _note(problem, K, bound, "lmi", found, budget)
        return found


def _in_unit(plant: PlantMatrices, unit: float) -> PlantMatrices:
    """Divide the norm by `unit`, half of it at w and half at z."""
    P, root = plant, np.sqrt(unit)
    return P.replace(
        B1=P.B1 / root, D21=P.D21 / root, C1=P.C1 / root, D12=P.D12 / root, D11=P.D11 / unit
    )


def _balanced_optimum(
    plant: PlantMatrices, solver: ProgramSolver, found: Found, epsilon: float, unit: float
) -> tuple[Projected | None, PlantMatrices | None]:
    """Alternate between solving and rebalancing until gamma, in `unit`, no longer falls."""
    frame: PlantMatrices | None = plant
    best: tuple[Projected | None, PlantMatrices | None] = (None, None)
    agreement = _POLICY.agreement(plant.nx)
    for _ in range(_POLICY.rounds):
        solution = None if frame is None else solve_projected(frame, solver)
        if frame is None or solution is None or not solution.gamma > 0:
            break
        found.history.append(
            {"epsilon": epsilon, "gamma": solution.gamma * unit, "status": solution.status}
        )
        after = rebalanced(frame, solution.R, solution.S)
        before = best[0]
        if before is None or solution.gamma < before.gamma:
            best = solution, after or frame
        if before is not None and solution.gamma > before.gamma * (1 - agreement):
            break
        frame = after
    return best


def _hardly_regular_optimum(plant: PlantMatrices, budget: Budget) -> float:
    """Return the optimum of a hardly regularised plant, to tell what is as good as zero."""
    halves = normalise(regularise(plant, _POLICY.hardly)).halves
    bracket = search_gamma(halves, 1.0, 0.1, budget)
    return 0.0 if bracket is None else bracket.upper


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
