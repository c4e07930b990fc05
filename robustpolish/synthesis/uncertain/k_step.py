"""The K step: an H-infinity controller of full order for a plant with scalings around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robustpolish.errors import SolverError
from robustpolish.exact.realisation import state_scales
from robustpolish.long_calls import Budget, step_cost
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices, regularise
from robustpolish.synthesis.problem.static_loop import augmented, close_static
from robustpolish.synthesis.riccati.infimum import search_gamma
from robustpolish.synthesis.riccati.two_riccati import (
    NormalisedPlant,
    central_controller,
    has_full_rank,
    normalise,
)
from robustpolish.synthesis.uncertain.levels import grid
from robustpolish.synthesis.uncertain.problem import stacked
from robustpolish.synthesis.uncertain.responses import LoopResponses


@dataclass(frozen=True)
class KStepPolicy:
    """How a K step goes.

    Attributes
    ----------
    tolerance : float
        How near the infimum the search for gamma ends, relative.
    back_offs : tuple of float
        How far above it the controller is made: far enough for the equations to be well
        conditioned. Gains fall fast with it.
    honest : float
        By how much the loop's norm may exceed the gamma that the equations promise.
    epsilons : tuple of float
        Prices on u and noises on y, where the plant has not enough of its own; the smallest
        norm of the loop decides.
    """

    tolerance: float = 1e-3
    back_offs: tuple[float, ...] = (1.01, 1.03, 1.1)
    honest: float = 1.02
    epsilons: tuple[float, ...] = (1e-2, 1e-3, 1e-4, 1e-5)


POLICY = KStepPolicy()


def k_step(plant: PlantMatrices, unit: float, budget: Budget) -> Controller:
    """Return a controller of full order whose norm is near the infimum.

    Full order matters: a shorter controller may reach the same norm, but is worse where the scaled
    gain is below its peak, and there the next scalings would have nothing to gain.

    Parameters
    ----------
    plant : PlantMatrices
        Continuous, without D22.
    unit : float
        A norm that is expected.
    budget : Budget

    Raises
    ------
    SolverError
        If no equation has a solution that stabilises.
    """
    even = _even(plant, unit)
    found: list[tuple[float, Controller]] = []
    epsilons = (0.0,) if has_full_rank(even) else ()
    for epsilon in (*epsilons, *POLICY.epsilons):
        normal = normalise(regularise(even, epsilon) if epsilon else even)
        own = _central(even, normal, budget)
        if own is not None:
            found.append(own)
            if not epsilon or (len(found) > 1 and found[-1][0] > 0.99 * found[-2][0]):
                break
        if budget.over:
            break
    if not found:
        raise SolverError("The Riccati equations of the scaled plant have no solution in doubles.")
    return min(found, key=lambda pair: pair[0])[1]


def _central(
    plant: PlantMatrices, normal: NormalisedPlant, budget: Budget
) -> tuple[float, Controller] | None:
    """Return the norm and the controller a little above the smallest gamma."""
    bracket = search_gamma(normal.halves, 2.0, POLICY.tolerance, budget)
    if bracket is None:
        return None
    best: tuple[float, Controller] | None = None
    for factor in POLICY.back_offs:
        gamma = bracket.upper * factor
        budget.spend(2 * step_cost(plant.nx))
        solution = normal.halves.attempt(gamma)
        if not solution.feasible or solution.X is None or solution.Y is None:
            continue
        try:
            K = central_controller(normal, gamma, solution.X, solution.Y)
        except np.linalg.LinAlgError:
            continue
        norm = _norm(plant, K)
        if best is None or norm < best[0]:
            best = norm, K
        if norm <= gamma * POLICY.honest:
            break
    return best if best is not None and np.isfinite(best[0]) else None


def _norm(plant: PlantMatrices, K: Controller) -> float:
    """Return the norm of a loop on a grid; infinite if it is not stable."""
    if not all(np.isfinite(M).all() for M in K):
        return float(np.inf)
    loop = close_static(augmented(plant, len(K.A)), stacked(K))
    if loop is None or not loop.stable:
        return float(np.inf)
    M = LoopResponses.of(loop, grid([loop.poles])).M
    return float(np.linalg.norm(M, 2, axis=(1, 2)).max())


def _even(plant: PlantMatrices, unit: float) -> PlantMatrices:
    """Balance the states by powers of two, and give z the expected norm as its unit.

    In the units of the search for one norm, the feedthrough of weights with a slow pole is next to
    nothing, and rounding decides.
    """
    B, C = np.hstack([plant.B1, plant.B2]), np.vstack([plant.C1 / unit, plant.C2])
    scales, _ = state_scales(plant.A, B, C)
    return plant.replace(
        A=plant.A * scales / scales[:, None],
        B1=plant.B1 / scales[:, None],
        B2=plant.B2 / scales[:, None],
        C1=plant.C1 * scales / unit,
        C2=plant.C2 * scales,
        D11=plant.D11 / unit,
        D12=plant.D12 / unit,
    )
