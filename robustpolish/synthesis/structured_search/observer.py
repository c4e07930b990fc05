"""Observer-based controllers of one decoupled part: where to start, and the way back."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from robustpolish.budget import Budget
from robustpolish.errors import InfeasibleError
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.nonsmooth import ObserverGain
from robustpolish.synthesis.problem.fixed_modes import refuse_fixed_modes
from robustpolish.synthesis.problem.matrices import PlantMatrices, regularise
from robustpolish.synthesis.problem.scaling import ScaledPlant, scale_plant
from robustpolish.synthesis.problem.static_loop import augmented
from robustpolish.synthesis.riccati.infimum import search_gamma
from robustpolish.synthesis.riccati.two_riccati import central_controller, normalise
from robustpolish.synthesis.structured_search.observer_form import observer_form
from robustpolish.synthesis.structured_search.search import (
    CEILINGS,
    Norm,
    Setting,
    objective,
    with_performance,
)
from robustpolish.synthesis.structured_search.static import (
    bounded_loops,
    gain_requirement,
    unscaled_controller,
)

Matrix = NDArray[Any]
Vector = NDArray[Any]

# Regularisations of the scaled plant, and back-offs from the smallest gamma, to start from.
_EPSILONS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
_BACK_OFFS = (1.001, 1.005, 1.02, 1.2)
_MOST_PROPOSALS = 6


def observer_setting(plant: GeneralizedPlant, norm: Norm, gain_bound: float | None) -> Setting:
    """Scale a part and state the problem over F and L.

    Raises
    ------
    InfeasibleError
        If an unstable mode cannot be moved, or the H2 norm is infinite for every observer.
    """
    if norm == "h2" and not plant.is_discrete and plant.D11.any():
        raise InfeasibleError(
            "The H2 norm is infinite for every observer-based controller: D11 passes the "
            "disturbance straight to z. Filter the disturbance or the output, or use 'hinf'."
        )
    scaled = scale_plant(plant)
    inner = PlantMatrices.of(scaled.plant)
    everything = np.ones((plant.nu, plant.ny), bool)
    refuse_fixed_modes(inner, everything, plant.states, scaled.time, "observer-based controller")
    parametrisation = ObserverGain(inner.A, inner.B2, inner.C2, inner.D22)

    def starts(deadline: float, rng: np.random.Generator) -> Iterator[Vector]:
        return _starts(scaled.plant, norm, parametrisation, deadline, rng)

    return Setting(
        scaled=scaled,
        norm=norm,
        loop=augmented(inner, plant.nx),
        parametrisation=parametrisation,
        starts=starts,
        controller=lambda K: unscaled_controller(scaled, K, plant.nx),
        what="observer-based controller",
        requirements=gain_requirement(gain_bound, plant.nx, scaled),
        bound_named="" if gain_bound is None else f"the gain bound {gain_bound:g}",
        descents=14,
        # The H2 problem is smooth and its Riccati start optimal: few descents tell.
        fewest=3 if norm == "h2" else 9,
        also_stable=bounded_loops(gain_bound, plant.nx, scaled),
    )


def gains(scaled: ScaledPlant, point: Vector) -> tuple[Matrix, Matrix]:
    """Return F, shape (nu, nx), and L, shape (nx, ny), in the part's own units."""
    P = scaled.plant
    F, L = ObserverGain(P.A, P.B2, P.C2, P.D22).split(point)
    L = scaled.state[:, None] * L / scaled.measurement / scaled.time
    return scaled.state_gain(F), L


def _starts(
    plant: GeneralizedPlant,
    norm: Norm,
    parametrisation: ObserverGain,
    deadline: float,
    rng: np.random.Generator,
) -> Iterator[Vector]:
    """Propose Riccati designs, the best first, then random changes of them."""
    proposed = proposals(plant, norm, parametrisation, deadline)
    yield from proposed
    proposed = proposed or [np.zeros(parametrisation.size)]
    while True:
        size = 10 ** rng.uniform(-2, 0)
        base = proposed[int(rng.integers(len(proposed)))]
        yield base + size * (np.abs(base) + 0.1) * rng.normal(size=base.size)


def proposals(
    plant: GeneralizedPlant, norm: Norm, parametrisation: ObserverGain, deadline: float
) -> list[Vector]:
    """Return the best few Riccati designs of a scaled plant, as F and L, the best first."""
    found: list[Vector] = []
    if norm == "hinf" and not plant.is_discrete:
        found.extend(_central(plant, parametrisation, deadline))
    for epsilon in _EPSILONS:
        if found and time.monotonic() > deadline:
            break
        gains = _quadratic(PlantMatrices.of(plant).without_d22(), epsilon, plant.is_discrete)
        if gains is not None:
            found.append(parametrisation.join(*gains))
    measure = objective(with_performance(augmented(PlantMatrices.of(plant), plant.nx)), norm)

    def achieved(point: Vector) -> float:
        K = parametrisation.gain(point)
        if np.abs(K).max(initial=0.0) > 0.3 * CEILINGS[0]:
            return np.inf
        pieces = measure.pieces(K, 0.0, ())
        return pieces[0].value if pieces else np.inf

    found.sort(key=achieved)
    return found[:_MOST_PROPOSALS]


def _quadratic(
    plant: PlantMatrices, epsilon: float, discrete: bool
) -> tuple[Matrix, Matrix] | None:
    """Return F and L of the H2 (LQG) design for the plant regularised by `epsilon`."""
    P = regularise(plant, epsilon)
    F = _regulator(P.A, P.B2, P.C1, P.D12, discrete)
    L = _regulator(P.A.T, P.C2.T, P.B1.T, P.D21.T, discrete)
    return None if F is None or L is None else (F, -L.T)


def _regulator(A: Matrix, B: Matrix, C: Matrix, D: Matrix, discrete: bool) -> Matrix | None:
    """Return the F that minimises the H2 norm of C + D F over A + B F."""
    solve = linalg.solve_discrete_are if discrete else linalg.solve_continuous_are
    R, S = D.T @ D, C.T @ D
    try:
        with warnings.catch_warnings():
            # SciPy's balancing warns about extreme scales; what it returns is only a start.
            warnings.simplefilter("ignore", RuntimeWarning)
            X = solve(A, B, C.T @ C, R, s=S)
        if discrete:
            F = -np.linalg.solve(R + B.T @ X @ B, B.T @ X @ A + S.T)
        else:
            F = -np.linalg.solve(R, B.T @ X + S.T)
    except (np.linalg.LinAlgError, ValueError):
        return None
    return F if np.isfinite(F).all() else None


def _central(
    plant: GeneralizedPlant, parametrisation: ObserverGain, deadline: float
) -> Iterator[Vector]:
    """Propose central H-infinity controllers of regularised plants in observer form."""
    gamma = 1.0
    # A third of the time is enough for starts; the rest belongs to the descents.
    deadline = time.monotonic() + 0.3 * (deadline - time.monotonic())
    for epsilon in _EPSILONS:
        if time.monotonic() > deadline:
            return
        normal = normalise(regularise(PlantMatrices.of(plant).without_d22(), epsilon))
        budget = Budget(seconds=deadline - time.monotonic())
        bracket = search_gamma(normal.halves, gamma, 1e-3, budget)
        if bracket is None:
            continue
        gamma = bracket.upper
        for back_off in _BACK_OFFS:
            found = normal.halves.attempt(gamma * back_off)
            if not found.feasible or found.X is None or found.Y is None:
                continue
            K = central_controller(normal, gamma * back_off, found.X, found.Y)
            # Dk vanishes with D11; D22 is left out of the formulas and put back by the observer.
            form = observer_form(plant.A, plant.B2, plant.C2, 0 * plant.D22, K.A, K.B, K.C)
            if form is not None:
                yield parametrisation.join(form.F, form.L)
