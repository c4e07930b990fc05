"""Static and fixed-order controllers of one decoupled part."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from robustpolish.errors import InfeasibleError
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.lmi.stabilising_gain import stabilising_gain
from robustpolish.synthesis.nonsmooth import (
    AffineGain,
    GainMeasure,
    HinfMeasure,
    MaskedGain,
    Requirement,
)
from robustpolish.synthesis.problem.decoupling import named_controller
from robustpolish.synthesis.problem.fixed_modes import refuse_fixed_modes
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.scaling import ScaledPlant, scale_plant
from robustpolish.synthesis.problem.static_loop import augmented, controller_loop
from robustpolish.synthesis.structured_search.search import Matrix, Norm, Setting, Vector
from robustpolish.validation import described, invalid

# Semidefinite programs with more states take longer than the descents that they would start.
_LARGEST_FOR_INEQUALITIES = 40


@dataclass(frozen=True, eq=False)
class StaticTask:
    """What is asked for one part.

    Attributes
    ----------
    plant : GeneralizedPlant
    norm : {"hinf", "h2"}
    mask : ndarray of bool, shape (order + nu, order + ny)
        Free entries of [[Ak, Bk], [Ck, Dk]].
    order : int
        States of the controller.
    gain_bound : float or None
        Bound of the controller's largest singular value over frequency, in plant units.
    initial : control.StateSpace or None
        Where to start first.
    """

    plant: GeneralizedPlant
    norm: Norm
    mask: NDArray[np.bool_]
    order: int = 0
    gain_bound: float | None = None
    initial: control.StateSpace | None = None


def static_setting(task: StaticTask) -> Setting:
    """Scale the part and state its problem.

    Raises
    ------
    InfeasibleError
        If an unstable mode is fixed, or no gain makes the H2 norm finite.
    """
    scaled = scale_plant(task.plant)
    inner = PlantMatrices.of(scaled.plant)
    loop = augmented(inner, task.order)
    what = "static gain" if task.order == 0 else f"controller of order {task.order}"
    # Whatever the pattern of a dynamic controller, it moves no mode that no gain moves.
    reach = task.mask if task.order == 0 else np.ones((task.plant.nu, task.plant.ny), bool)
    refuse_fixed_modes(inner, reach, task.plant.states, scaled.time, what)
    hinf = task.norm == "hinf"
    parametrisation = MaskedGain(task.mask) if hinf else free_gain(task.mask, loop)

    def starts(deadline: float, rng: np.random.Generator) -> Iterator[Vector]:
        return _starts(task, scaled, loop, parametrisation, deadline, rng)

    return Setting(
        scaled=scaled,
        norm=task.norm,
        loop=loop,
        parametrisation=parametrisation,
        starts=starts,
        controller=lambda K: unscaled_controller(scaled, K, task.order),
        what=what,
        also_stable=bounded_loops(task.gain_bound, task.order, scaled),
        requirements=gain_requirement(task.gain_bound, task.order, scaled),
        bound_named="" if task.gain_bound is None else f"the gain bound {task.gain_bound:g}",
    )


def free_gain(mask: NDArray[np.bool_], loop: PlantMatrices) -> AffineGain | MaskedGain:
    """Free the marked entries, as far as the feedthrough of a continuous loop stays zero.

    Raises
    ------
    InfeasibleError
        If no gain of the pattern cancels D11.
    """
    free = MaskedGain(mask)
    if loop.discrete or not loop.D11.size:
        return free
    if not (loop.D11.any() or (loop.D12.any() and loop.D21.any())):
        return free
    if loop.has_d22:
        raise invalid(
            "plant",
            described("a D22 together with D11 or with D12 and D21"),
            "D22 = 0 for the H2 norm of such a plant",
            "Absorb D22 into the controller, K = K0 (I + D22 K0)^-1, and design K0.",
        )
    restricted = free.restricted(loop.D12, loop.D21, -loop.D11)
    if restricted is None:
        raise InfeasibleError(
            "The H2 norm is infinite for every controller of this structure: none cancels the "
            "feedthrough D11 from w to z. Filter the disturbance or the output, or use 'hinf'."
        )
    return restricted


def gain_requirement(
    bound: float | None, order: int, scaled: ScaledPlant
) -> tuple[Requirement, ...]:
    """Bound the largest singular value of a controller, over frequency if it is dynamic."""
    if bound is None:
        return ()
    left, right = np.diag(scaled.control), np.diag(1 / scaled.measurement)
    if order == 0:
        return (Requirement(GainMeasure(left, right), bound),)
    return (Requirement(HinfMeasure(own_loop(order, scaled)), bound),)


def bounded_loops(
    bound: float | None, order: int, scaled: ScaledPlant
) -> tuple[PlantMatrices, ...]:
    """Return the loops that have to be stable for a bound on the gain to be meant."""
    return () if bound is None or order == 0 else (own_loop(order, scaled),)


def own_loop(order: int, scaled: ScaledPlant) -> PlantMatrices:
    """Return the loop that is the controller itself, from y to u in plant units."""
    left, right = np.diag(scaled.control), np.diag(1 / scaled.measurement)
    return controller_loop(order, left, right, scaled.original.is_discrete)


def _starts(
    task: StaticTask,
    scaled: ScaledPlant,
    loop: PlantMatrices,
    parametrisation: AffineGain | MaskedGain,
    deadline: float,
    rng: np.random.Generator,
) -> Iterator[NDArray[np.float64]]:
    """Propose gains: the user's, none, two from theory, then random ones."""
    if task.initial is not None:
        yield parametrisation.coordinates(scaled_matrix(task.initial, scaled))
    rest = np.zeros(task.mask.shape)
    rest[: task.order, : task.order] = -np.eye(task.order) * (0.0 if loop.discrete else 1.0)
    yield parametrisation.coordinates(rest)
    gain = None
    if len(loop.A) <= _LARGEST_FOR_INEQUALITIES:
        gain = stabilising_gain(loop, task.mask, deadline)
    if gain is not None:
        yield parametrisation.coordinates(gain)
    projected = projected_regulator(loop)
    if projected is not None:
        yield parametrisation.coordinates(np.where(task.mask, projected, 0.0))
    while True:
        size = 10 ** rng.uniform(-1.5, 1.5)
        K = rest + size * rng.normal(size=task.mask.shape)
        yield parametrisation.coordinates(np.where(task.mask, K, 0.0))


def projected_regulator(loop: PlantMatrices) -> Matrix | None:
    """Return the output gain nearest to a linear-quadratic state feedback."""
    solve = linalg.solve_discrete_are if loop.discrete else linalg.solve_continuous_are
    A, B, eye = loop.A, loop.B2, np.eye(loop.B2.shape[1])
    try:
        with warnings.catch_warnings():
            # SciPy's balancing warns about extreme scales; what it returns is only a start.
            warnings.simplefilter("ignore", RuntimeWarning)
            X = solve(A, B, np.eye(len(A)), eye)
        F = -np.linalg.solve(eye + B.T @ X @ B, B.T @ X @ A) if loop.discrete else -B.T @ X
    except (np.linalg.LinAlgError, ValueError):
        return None
    K = F @ np.linalg.pinv(loop.C2)
    return K if np.isfinite(K).all() else None


def scaled_matrix(controller: control.StateSpace, scaled: ScaledPlant) -> Matrix:
    """Return [[Ak, Bk], [Ck, Dk]] of a controller in the units of the scaled plant."""
    u, y = scaled.control[:, None], scaled.measurement
    A, B, C, D = (np.asarray(M) for M in (controller.A, controller.B, controller.C, controller.D))
    return np.block([[A * scaled.time, B * scaled.time * y], [C / u, D * y / u]])


def unscaled_controller(scaled: ScaledPlant, K: Matrix, order: int) -> control.StateSpace:
    """Return K = [[Ak, Bk], [Ck, Dk]] of the scaled plant as a controller in plant units."""
    # Entries that only rounding left in place of a zero are zeros.
    K = np.where(np.abs(K) < 1e-13 * np.abs(K).max(initial=0.0), 0.0, K)
    k, plant = order, scaled.original
    own = control.StateSpace(
        K[:k, :k], K[:k, k:], K[k:, :k], K[k:, k:], plant.dt, remove_useless_states=False
    )
    back = scaled.controller(own)
    return named_controller(plant, *(np.array(M) for M in (back.A, back.B, back.C, back.D)))
