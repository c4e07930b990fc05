"""Controllers of one part under several specifications at once: static or of full order."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.lmi.mixed.output import Specification, mixed_start
from robustpolish.synthesis.lmi.mixed.state import mixed_state_start
from robustpolish.synthesis.nonsmooth import (
    AffineGain,
    MaskedGain,
    ObserverGain,
    RegionMeasure,
    Requirement,
)
from robustpolish.synthesis.problem.channels import channel as cut
from robustpolish.synthesis.problem.fixed_modes import refuse_fixed_modes
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.pole_regions import PoleRegion
from robustpolish.synthesis.problem.scaling import ScaledPlant, scale_plant
from robustpolish.synthesis.problem.static_loop import augmented
from robustpolish.synthesis.structured_search.observer import proposals
from robustpolish.synthesis.structured_search.search import Norm, Setting, objective
from robustpolish.synthesis.structured_search.static import (
    bounded_loops,
    free_gain,
    gain_requirement,
    projected_regulator,
    unscaled_controller,
)

Vector = NDArray[Any]

# Poles are asked a little inside their region, relative to the size of the plant.
_INSIDE = 1e-7
# The semidefinite program of a larger plant does not return within the usual time limits.
_LARGEST_FOR_INEQUALITIES = 14


@dataclass(frozen=True, eq=False)
class MixedTask:
    """What is asked for one part.

    Attributes
    ----------
    whole : GeneralizedPlant
        With the disturbances and outputs of all channels.
    goal : GeneralizedPlant
        The channel whose norm is minimised.
    norm : {"hinf", "h2"}
        Which norm of it.
    side : GeneralizedPlant or None
        The channel whose other norm is bounded.
    side_bound : float or None
    regions : tuple of PoleRegion
    gain_bound : float or None
    backend : str
    solver : str or None
    order : int
        States of the controller: those of the part, or 0 for a static gain.
    """

    whole: GeneralizedPlant
    goal: GeneralizedPlant
    norm: Norm
    side: GeneralizedPlant | None
    side_bound: float | None
    regions: tuple[PoleRegion, ...]
    gain_bound: float | None
    backend: str
    solver: str | None
    order: int


def mixed_setting(task: MixedTask) -> Setting:
    """Scale the part and state its problem; both channels share the scaling of the whole.

    Raises
    ------
    InfeasibleError
        If an unstable mode cannot be moved, or no controller makes the H2 norm finite.
    """
    scaled = scale_plant(task.whole)
    n, what = task.order, "controller" if task.order else "static gain"
    inner = PlantMatrices.of(scaled.plant)
    everything = np.ones((task.whole.nu, task.whole.ny), bool)
    refuse_fixed_modes(inner, everything, task.whole.states, scaled.time, what)
    goal = _scaled_channel(scaled, task.goal)
    goal_loop = augmented(PlantMatrices.of(goal), n)
    side = None if task.side is None else _scaled_channel(scaled, task.side)
    other: Norm = "h2" if task.norm == "hinf" else "hinf"
    h2_loop = goal_loop if task.norm == "h2" else None
    requirements: list[Requirement] = []
    specifications = [Specification(goal, task.norm, None)]
    if side is not None and task.side_bound is not None:
        side_loop = augmented(PlantMatrices.of(side), n)
        bound = scaled.scaled_norm(task.side_bound, other)
        requirements.append(Requirement(objective(side_loop, other), bound))
        specifications.append(Specification(side, other, bound))
        h2_loop = side_loop if other == "h2" else h2_loop
    mask = np.ones((n + task.whole.nu, n + task.whole.ny), bool)
    parametrisation = MaskedGain(mask) if h2_loop is None else free_gain(mask, h2_loop)
    regions = tuple(region.in_unit_of_time(scaled.time) for region in task.regions)
    loop = augmented(inner, n)
    requirements.extend(Requirement(_region(loop, region), None) for region in regions)
    requirements.extend(gain_requirement(task.gain_bound, n, scaled))

    def starts(deadline: float, rng: np.random.Generator) -> Iterator[Vector]:
        small = task.whole.nx <= _LARGEST_FOR_INEQUALITIES
        start = mixed_start if n else mixed_state_start
        if not task.whole.is_discrete and small and (n or _measures_the_state(task.whole)):
            first = start(specifications, regions, deadline, task.backend, task.solver)
            if first is not None:
                yield parametrisation.coordinates(first)
        if n:
            yield from _proposed(goal, task.norm, parametrisation, deadline, rng)
        else:
            yield from _regulators(inner, parametrisation, rng)

    return Setting(
        scaled=scaled,
        norm=task.norm,
        loop=loop,
        parametrisation=parametrisation,
        starts=starts,
        controller=lambda K: unscaled_controller(scaled, K, n),
        what=what,
        requirements=tuple(requirements),
        bound_named="all specifications" if requirements else "",
        descents=8,
        objective_loop=goal_loop,
        also_stable=bounded_loops(task.gain_bound, n, scaled),
    )


def _scaled_channel(scaled: ScaledPlant, channel: GeneralizedPlant) -> GeneralizedPlant:
    """Cut a channel out of the scaled whole."""
    return cut(scaled.plant, channel.disturbance_names, channel.performance_names)


def _region(loop: PlantMatrices, region: PoleRegion) -> RegionMeasure:
    """Measure the largest eigenvalue of the region's matrix over the poles."""
    size = float(np.linalg.norm(loop.A, 2)) or 1.0
    scale = float(np.linalg.norm(region.L, 2)) + size * float(np.linalg.norm(region.M, 2))

    def distance(pole: complex) -> tuple[float, complex]:
        values, vectors = np.linalg.eigh(region.L + pole * region.M + np.conj(pole) * region.M.T)
        v = np.asarray(vectors)[:, -1]
        moved = complex(v.conj() @ region.M @ v)
        # The derivatives over real and imaginary part of s M + conj(s) M'.
        return float(values[-1]) + _INSIDE * scale, complex(2 * moved.real, -2 * moved.imag)

    return RegionMeasure(loop, distance, scale)


def _measures_the_state(plant: GeneralizedPlant) -> bool:
    """Tell whether y = x, as the inequalities of state feedback assume."""
    return (
        np.array_equal(plant.C2, np.eye(plant.nx)) and not plant.D21.any() and not plant.D22.any()
    )


def _regulators(
    loop: PlantMatrices, parametrisation: AffineGain | MaskedGain, rng: np.random.Generator
) -> Iterator[Vector]:
    """Propose a linear-quadratic gain, no gain, then random changes of the first."""
    rest = np.zeros((loop.B2.shape[1], loop.C2.shape[0]))
    regulator = projected_regulator(loop)
    base = rest if regulator is None else regulator
    yield parametrisation.coordinates(base)
    yield parametrisation.coordinates(rest)
    while True:
        size = 10 ** rng.uniform(-1.5, 1)
        changed = base + size * (np.abs(base) + 0.1) * rng.normal(size=base.shape)
        yield parametrisation.coordinates(changed)


def _proposed(
    goal: GeneralizedPlant,
    norm: Norm,
    parametrisation: AffineGain | MaskedGain,
    deadline: float,
    rng: np.random.Generator,
) -> Iterator[Vector]:
    """Propose a resting controller, Riccati designs for the goal alone, then random changes."""
    n = goal.nx
    shape = (n + goal.nu, n + goal.ny)
    rest = np.zeros(shape)
    rest[:n, :n] = 0.0 if goal.is_discrete else -np.eye(n)
    found = [rest]
    observer = ObserverGain(goal.A, goal.B2, goal.C2, goal.D22)
    for point in proposals(goal, norm, observer, deadline):
        found.append(observer.gain(point))
        yield parametrisation.coordinates(found[-1])
    yield parametrisation.coordinates(rest)
    while True:
        base = found[int(rng.integers(len(found)))]
        size = 10 ** rng.uniform(-2, 0)
        changed = base + size * (np.abs(base) + 0.1) * rng.normal(size=shape)
        yield parametrisation.coordinates(changed)
