"""Design of one decoupled part with a structured controller: scale, start, descend, tidy."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import control
import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from robustpolish.errors import InfeasibleError, SolverError
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.decoupling import named_controller
from robustpolish.synthesis.fixed_modes import refuse_fixed_modes
from robustpolish.synthesis.lmi_iterations import stabilising_gain
from robustpolish.synthesis.nonsmooth import (
    AffineGain,
    GainMeasure,
    H2Measure,
    HinfMeasure,
    Loop,
    Measure,
    Problem,
    Requirement,
    SearchLimits,
    SearchResult,
    StabilityMeasure,
    augmented,
    controller_loop,
    minimax,
    search,
)
from robustpolish.synthesis.scaling import ScaledPlant, scale_plant
from robustpolish.validation import described, invalid

Matrix = NDArray[np.float64]
Norm = Literal["hinf", "h2"]

CEILING = 1e6
"""Largest entry of a controller in scaled units; an infimum beyond it counts as not attained."""

SLACK = 5e-5
"""Share of the norm that is given away for a smaller gain."""


@dataclass(frozen=True, eq=False)
class PartDesign:
    """The controller of one part.

    Attributes
    ----------
    controller : control.StateSpace
        In the part's own units.
    norm : float
        What the search achieved, in the part's units.
    reason : str
        Why the search stopped.
    agreeing, descents : int
        How many descents ended at the best norm, and how many there were.
    at_ceiling : bool
        Whether the gain grew until it was stopped.
    history : tuple of mapping
        One entry per descent.
    """

    controller: control.StateSpace
    norm: float
    reason: str
    agreeing: int
    descents: int
    at_ceiling: bool
    history: tuple[Mapping[str, Any], ...]


@dataclass(frozen=True, eq=False)
class StructuredTask:
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
    seed : int
    target : float
        A norm that is good enough.
    """

    plant: GeneralizedPlant
    norm: Norm
    mask: NDArray[np.bool_]
    order: int = 0
    gain_bound: float | None = None
    initial: control.StateSpace | None = None
    seed: int = 0
    target: float = 0.0


def design_part(task: StructuredTask, deadline: float) -> PartDesign:
    """Search for the best controller of the structure before `deadline`.

    Raises
    ------
    InfeasibleError
        If an unstable mode is fixed, or no gain makes the H2 norm finite.
    SolverError
        If no start led to a stable loop.
    """
    scaled = scale_plant(task.plant)
    inner = Loop.of(scaled.plant)
    loop = augmented(inner, task.order)
    static = task.mask[task.order :, task.order :]
    what = "static gain" if task.order == 0 else f"controller of order {task.order}"
    reach = task.mask if task.order == 0 else np.ones_like(static)
    refuse_fixed_modes(inner, reach, task.plant.states, scaled.time, what)
    parametrisation = _parametrisation(task, loop)
    problem = Problem(
        parametrisation,
        objective(_with_performance(loop), task.norm),
        _gain_requirement(task, scaled),
        CEILING,
    )
    limits = SearchLimits(
        deadline=time.monotonic() + 0.85 * (deadline - time.monotonic()),
        target=np.log(scaled.scaled_norm(task.target, task.norm)) if task.target > 0 else -np.inf,
    )
    rng = np.random.default_rng(task.seed)
    stability = StabilityMeasure.of(loop, float(np.linalg.norm(loop.A, 2)) or 1.0)
    starts = _starts(task, scaled, loop, parametrisation, limits.deadline, rng)
    result = search(problem, stability, starts, limits, rng)
    if result.point is None or not np.isfinite(result.value):
        raise SolverError(_failure(what, result, task.gain_bound, scaled.time))
    point, value = _smaller_gain(problem, result, deadline)
    K = parametrisation.gain(point)
    values = [entry.get("value", np.inf) for entry in result.history]
    best = float(np.exp(result.value))
    return PartDesign(
        controller=_unscaled(task, scaled, K),
        norm=scaled.norm(float(np.exp(value)), task.norm),
        reason=result.reason,
        agreeing=sum(v <= best * 1.0001 for v in values),
        descents=len(values),
        at_ceiling=bool(np.abs(K).max(initial=0.0) > 0.03 * CEILING),
        history=tuple(
            {**entry, "value": scaled.norm(entry["value"], task.norm)}
            if "value" in entry
            else entry
            for entry in result.history
        ),
    )


def objective(loop: Loop, norm: Norm) -> Measure:
    """Return the measure of a norm."""
    return HinfMeasure(loop) if norm == "hinf" else H2Measure(loop)


def _with_performance(loop: Loop) -> Loop:
    """Disturb and watch the states where no disturbance reaches any performance output."""
    if loop.B1.shape[1] and loop.C1.shape[0]:
        return loop
    n, nu, ny = len(loop.A), loop.B2.shape[1], loop.C2.shape[0]
    zeros = np.zeros
    return Loop(
        loop.A,
        np.eye(n),
        loop.B2,
        np.eye(n),
        loop.C2,
        zeros((n, n)),
        zeros((n, nu)),
        zeros((ny, n)),
        loop.D22,
        loop.discrete,
    )


def _parametrisation(task: StructuredTask, loop: Loop) -> AffineGain:
    """Free the marked entries; for the H2 norm only as far as the feedthrough stays zero."""
    free = AffineGain.masked(task.mask)
    watched = loop.D11.size > 0
    if task.norm == "hinf" or loop.discrete or not watched:
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


def _gain_requirement(task: StructuredTask, scaled: ScaledPlant) -> tuple[Requirement, ...]:
    if task.gain_bound is None:
        return ()
    left, right = np.diag(scaled.control), np.diag(1 / scaled.measurement)
    if task.order == 0:
        return (Requirement(GainMeasure(left, right), task.gain_bound),)
    own = controller_loop(task.order, left, right, task.plant.is_discrete)
    return (Requirement(HinfMeasure(own), task.gain_bound),)


def _starts(
    task: StructuredTask,
    scaled: ScaledPlant,
    loop: Loop,
    parametrisation: AffineGain,
    deadline: float,
    rng: np.random.Generator,
) -> Iterator[NDArray[np.float64]]:
    """Propose gains: the user's, none, two from theory, then random ones."""
    if task.initial is not None:
        yield parametrisation.coordinates(scaled_matrix(task.initial, scaled))
    rest = np.zeros(task.mask.shape)
    rest[: task.order, : task.order] = -np.eye(task.order) * (0.0 if loop.discrete else 1.0)
    yield parametrisation.coordinates(rest)
    gain = stabilising_gain(loop, task.mask, deadline)
    if gain is not None:
        yield parametrisation.coordinates(gain)
    projected = _projected_regulator(loop)
    if projected is not None:
        yield parametrisation.coordinates(np.where(task.mask, projected, 0.0))
    while True:
        size = 10 ** rng.uniform(-1.5, 1.5)
        K = rest + size * rng.normal(size=task.mask.shape)
        yield parametrisation.coordinates(np.where(task.mask, K, 0.0))


def _projected_regulator(loop: Loop) -> Matrix | None:
    """Return the output gain nearest to a linear-quadratic state feedback."""
    solve = linalg.solve_discrete_are if loop.discrete else linalg.solve_continuous_are
    A, B, eye = loop.A, loop.B2, np.eye(loop.B2.shape[1])
    try:
        X = solve(A, B, np.eye(len(A)), eye)
        F = -np.linalg.solve(eye + B.T @ X @ B, B.T @ X @ A) if loop.discrete else -B.T @ X
    except (np.linalg.LinAlgError, ValueError):
        return None
    K = F @ np.linalg.pinv(loop.C2)
    return K if np.isfinite(K).all() else None


def _smaller_gain(
    problem: Problem, result: SearchResult, deadline: float
) -> tuple[NDArray[np.float64], float]:
    """Give away a little of the norm for the smallest gain."""
    assert result.point is not None
    K = problem.parametrisation.gain(result.point)
    bound = float(np.exp(result.value)) * (1 + SLACK)
    small = Problem(
        problem.parametrisation,
        GainMeasure(np.eye(K.shape[0]), np.eye(K.shape[1])),
        (Requirement(problem.objective, bound), *problem.requirements),
        problem.ceiling,
    )
    if not K.any() or small.model(result.point) is None:
        return result.point, result.value
    ended = minimax(small, result.point, deadline, iterations=150, weight=100.0)
    check = problem.model(ended.point)
    if check is None or check.violation > 1e-9 or check.objective > np.log(bound) + 1e-6:
        return result.point, result.value
    if np.abs(problem.parametrisation.gain(ended.point)).max() > np.abs(K).max():
        return result.point, result.value
    return ended.point, check.objective


def scaled_matrix(controller: control.StateSpace, scaled: ScaledPlant) -> Matrix:
    """Return [[Ak, Bk], [Ck, Dk]] of a controller in the units of the scaled plant."""
    u, y = scaled.control[:, None], scaled.measurement
    A, B, C, D = (np.asarray(M) for M in (controller.A, controller.B, controller.C, controller.D))
    return np.block([[A * scaled.time, B * scaled.time * y], [C / u, D * y / u]])


def _unscaled(task: StructuredTask, scaled: ScaledPlant, K: Matrix) -> control.StateSpace:
    # Entries that only rounding left in place of a zero are zeros.
    K = np.where(np.abs(K) < 1e-13 * np.abs(K).max(initial=0.0), 0.0, K)
    k = task.order
    own = control.StateSpace(
        K[:k, :k], K[:k, k:], K[k:, :k], K[k:, k:], task.plant.dt, remove_useless_states=False
    )
    back = scaled.controller(own)
    return named_controller(task.plant, *(np.array(M) for M in (back.A, back.B, back.C, back.D)))


def _failure(what: str, result: SearchResult, gain_bound: float | None, time_unit: float) -> str:
    tried = f"{len(result.history)} descents and the cone complementarity iteration"
    if gain_bound is not None and result.instability < 0:
        return (
            f"No {what} within the gain bound {gain_bound:g} was found by {tried}. "
            "Raise the bound or time_limit."
        )
    reached = (
        f"; the lowest spectral abscissa was {result.instability:.3g} of the plant's size"
        if np.isfinite(result.instability)
        else ""
    )
    return (
        f"No stabilising {what} was found by {tried}{reached}. None is proven not to exist. "
        "Raise order=, time_limit or the seed, or use output_feedback."
    )
