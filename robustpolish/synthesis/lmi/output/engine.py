"""Output feedback by linear matrix inequalities: scale, solve, rebalance, back off, verify."""

from __future__ import annotations

import numpy as np

from robustpolish.budget import Budget
from robustpolish.synthesis.certificate.certificate import Norm
from robustpolish.synthesis.lmi.options import LmiOptions
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
from robustpolish.synthesis.lmi.semidefinite import SemidefiniteProgram
from robustpolish.synthesis.output_search.candidates import Findings, examine
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices, regularise
from robustpolish.synthesis.riccati.infimum import search_gamma
from robustpolish.synthesis.riccati.output_hinf import deeper_helps
from robustpolish.synthesis.riccati.two_riccati import normalise

_BACK_OFF = 1.006
_FAR_BACK = 1.02
_ROUNDS = 4
_AGREEMENT = 2e-3
# Where a round takes little time.
_SMALL = 6
_CLOSE_AGREEMENT = 1e-5
# Regularised less than this the inequalities are as hard as the original ones.
_EPSILONS = (0.0, 1e-5, 1e-4, 1e-3)
# An optimum so far below that of a hardly regularised plant is taken for zero.
_NOTHING = 0.1
_HARDLY = 1e-4


def solve_lmi(
    plant: PlantMatrices, norm: Norm, options: LmiOptions, regular: bool = True
) -> Findings:
    """Minimise a norm of the loop.

    Parameters
    ----------
    plant : PlantMatrices
        Scaled; without D11 for the H2 norm.
    norm : {"hinf", "h2"}
    options : LmiOptions
    regular : bool
        Whether D12 and D21 have full rank; otherwise no H2 optimum is claimed.

    Returns
    -------
    Findings
        The claims of its candidates are the backed-off bounds.
    """
    found = Findings("lmi", options.backend)
    if norm == "h2":
        _minimise_h2(plant, options, found)
        found.converged &= regular
    else:
        _minimise_hinf(plant, options, found)
    found.expired = options.deadline.expired
    return found


def _minimise_hinf(plant: PlantMatrices, options: LmiOptions, found: Findings) -> None:
    # Numbers of order one suit the solver; those below do no harm.
    hardly = _regular_optimum(plant, options)
    unit = max(1.0, hardly)
    frames: list[tuple[float, float, PlantMatrices]] = []
    for epsilon in _EPSILONS:
        regular = _in_unit(regularise(plant, epsilon), unit)
        best, frame = _balanced_optimum(regular, options, found, epsilon)
        if best is None or frame is None:
            continue
        frames.append((epsilon, best.gamma, frame))
        nothing = _NOTHING * hardly / unit
        falling = best.gamma < nothing
        bound = nothing if falling else _BACK_OFF * best.gamma
        if _back_off(plant, epsilon, frame, bound, unit, options, found):
            found.falling = falling
            # Neither agreement nor the solver's word proves an optimum; the Riccati equations
            # of a nearly singular plant may know better.
            lower = deeper_helps(plant, best.gamma * unit)
            found.converged = not falling and not lower and epsilon == 0
            if lower and not falling:
                found.remarks.append("Riccati equations promise a smaller norm.")
            return
    # A controller some way from the optimum is better than none.
    for epsilon, gamma, frame in frames:
        if _back_off(plant, epsilon, frame, _FAR_BACK * gamma, unit, options, found):
            return


def _back_off(
    plant: PlantMatrices,
    epsilon: float,
    frame: PlantMatrices,
    bound: float,
    unit: float,
    options: LmiOptions,
    found: Findings,
) -> bool:
    """Look for controllers below a bound; tell whether one keeps it."""

    def impose(program: SemidefiniteProgram, v: Unknowns) -> None:
        program.positive(-bounded_real(loop_terms(frame, v), bound))

    for K in conditioned(frame, "hinf", impose, options):
        _note(plant, K, bound * unit, f"lmi, epsilon {epsilon:.1e}", "hinf", found)
    return any(c.honest for c in found.candidates)


def _in_unit(plant: PlantMatrices, unit: float) -> PlantMatrices:
    """Divide the norm by `unit`, half of it at w and half at z."""
    P, root = plant, np.sqrt(unit)
    return P.replace(
        B1=P.B1 / root, D21=P.D21 / root, C1=P.C1 / root, D12=P.D12 / root, D11=P.D11 / unit
    )


def _balanced_optimum(
    plant: PlantMatrices, options: LmiOptions, found: Findings, epsilon: float
) -> tuple[Projected | None, PlantMatrices | None]:
    """Alternate between solving and rebalancing until gamma no longer falls."""
    frame: PlantMatrices | None = plant
    best: tuple[Projected | None, PlantMatrices | None] = (None, None)
    agreement = _AGREEMENT if len(plant.A) > _SMALL else _CLOSE_AGREEMENT
    for _ in range(_ROUNDS):
        solution = None if frame is None else solve_projected(frame, options)
        if frame is None or solution is None or not solution.gamma > 0:
            break
        found.history.append(
            {"epsilon": epsilon, "gamma": solution.gamma, "status": solution.status}
        )
        after = rebalanced(frame, solution.R, solution.S)
        before = best[0]
        if before is None or solution.gamma < before.gamma:
            best = solution, after or frame
        if before is not None and solution.gamma > before.gamma * (1 - agreement):
            break
        frame = after
    return best


def _regular_optimum(plant: PlantMatrices, options: LmiOptions) -> float:
    """Return the optimum of a hardly regularised plant, to tell what is as good as zero."""
    budget = Budget(seconds=options.deadline.remaining)
    bracket = search_gamma(normalise(regularise(plant, _HARDLY)).halves, 1.0, 0.1, budget)
    return 0.0 if bracket is None else bracket.upper


def _minimise_h2(plant: PlantMatrices, options: LmiOptions, found: Findings) -> None:
    optimum, frame = np.inf, plant
    trial: PlantMatrices | None = plant
    for _ in range(_ROUNDS):
        solution = None if trial is None else _h2_optimum(trial, options)
        if trial is None or solution is None:
            break
        square, values = solution
        found.history.append({"claim": np.sqrt(square)})
        direct = reconstruct(trial, values)
        if direct is not None:
            _note(plant, direct, np.sqrt(square) * (1 + 1e-4), "lmi", "h2", found)
        settled = square > optimum * (1 - _AGREEMENT)
        optimum = min(optimum, square)
        frame, trial = trial, rebalanced(trial, values.X, values.Y)
        if settled:
            break
    if not np.isfinite(optimum):
        return
    frame = frame if trial is None else trial
    for factor in (1.00005, 1.003):
        bound = factor * np.sqrt(optimum)

        def impose(program: SemidefiniteProgram, v: Unknowns, bound: float = bound) -> None:
            program.nonnegative(bound**2 - impose_h2(program, loop_terms(frame, v), v))

        for K in conditioned(frame, "h2", impose, options):
            _note(plant, K, bound, "lmi", "h2", found)
    # At the optimum the bound is attained; a loose one means that the solver stopped early.
    found.converged = any(c.honest and c.achieved > 0.99 * c.claimed for c in found.candidates)


def _h2_optimum(plant: PlantMatrices, options: LmiOptions) -> tuple[float, Variables] | None:
    program = SemidefiniteProgram()
    v = Unknowns.of(program, plant, "h2")
    square = impose_h2(program, loop_terms(plant, v), v)
    coupling(program, v)
    program.minimise(square)
    solution = options.solve(program)
    if solution.x is None:
        return None
    value = float(solution.value(square).item())
    return (value, v.at(solution)) if value > 0 else None


def _note(
    plant: PlantMatrices, K: Controller, bound: float, origin: str, norm: Norm, found: Findings
) -> None:
    candidate = examine(plant, K, bound, origin, norm)
    if candidate is not None:
        found.candidates.append(candidate)
