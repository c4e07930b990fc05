"""Controllers under several specifications at once: static or of full order."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.arrays import AnyVector as Vector
from robustpolish.long_calls import Budget
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.lmi.mixed.output import Specification, mixed_start
from robustpolish.synthesis.lmi.mixed.state import mixed_state_start
from robustpolish.synthesis.lmi.semidefinite import ProgramSolver
from robustpolish.synthesis.nonsmooth import (
    MaskedGain,
    ObserverGain,
    RegionMeasure,
    Requirement,
)
from robustpolish.synthesis.problem.channels import channel
from robustpolish.synthesis.problem.decoupling import PlantPart
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.pole_regions import PoleRegion
from robustpolish.synthesis.problem.static_loop import augmented
from robustpolish.synthesis.structured_search.observer_structure import RiccatiStarts
from robustpolish.synthesis.structured_search.policy import POLICY
from robustpolish.synthesis.structured_search.starts import (
    DrawnStarts,
    KnownStarts,
    RegulatorStart,
)
from robustpolish.synthesis.structured_search.static_structure import free_gain, resting
from robustpolish.synthesis.structured_search.structure import (
    Norm,
    PartProblem,
    StartProposal,
    Structure,
    norm_measure,
    scaled_part,
)


@dataclass(frozen=True, eq=False)
class MixedStructure(Structure):
    """A static gain or a full-order controller for one norm while others are bounded.

    Attributes
    ----------
    norm : {"hinf", "h2"}
        The norm that is minimised ...
    goal : GeneralizedPlant
        ... on this channel.
    static : bool
    side : GeneralizedPlant or None
        The channel whose other norm is bounded; the plant is one part then.
    side_bound : float or None
    regions : tuple of PoleRegion
    gain_bound : float or None
    backend : str
    solver : str or None
    """

    norm: Norm
    goal: GeneralizedPlant
    static: bool
    side: GeneralizedPlant | None
    side_bound: float | None
    regions: tuple[PoleRegion, ...]
    gain_bound: float | None
    backend: str
    solver: str | None
    method: ClassVar[str] = "lmi, descent"

    def problem(self, part: PlantPart) -> PartProblem | None:
        """State the search in one part, scaled as a whole; see :meth:`Structure.problem`."""
        plant, norm = part.plant, self.norm
        if 0 in (plant.nx, plant.nu, plant.ny):
            return None
        order = 0 if self.static else plant.nx
        what = "controller" if order else "static gain"
        scaled, inner = scaled_part(plant, what)
        goal = _shared_channel(scaled.plant, self.goal)
        goal_loop = augmented(PlantMatrices.of(goal), order)
        h2_loop = goal_loop if norm == "h2" else None
        demands: list[Requirement] = []
        specifications = [Specification(goal, norm, None)]
        if self.side is not None and self.side_bound is not None:
            other: Norm = "h2" if norm == "hinf" else "hinf"
            side = _shared_channel(scaled.plant, self.side)
            side_loop = augmented(PlantMatrices.of(side), order)
            bound = scaled.scaled_norm(self.side_bound, other)
            demands.append(Requirement(norm_measure(side_loop, other), bound))
            specifications.append(Specification(side, other, bound))
            h2_loop = side_loop if other == "h2" else h2_loop
        mask = np.ones((order + plant.nu, order + plant.ny), bool)
        free = MaskedGain(mask) if h2_loop is None else free_gain(mask, h2_loop)
        loop = augmented(inner, order)
        regions = tuple(region.in_unit_of_time(scaled.time) for region in self.regions)
        demands.extend(Requirement(_region(loop, region), None) for region in regions)

        starts: list[StartProposal] = []
        small = plant.nx <= POLICY.shared_states
        if small and not plant.is_discrete and (order or _measures_the_state(plant)):
            starts.append(
                InequalityStart(
                    specifications, regions, order, self.backend, self.solver, free.coordinates
                )
            )
        rest = KnownStarts([free.coordinates(resting(mask.shape, order, loop.discrete))])
        if order:
            P = PlantMatrices.of(goal)
            form = ObserverGain(P.A, P.B2, P.C2, P.D22)
            starts += [RiccatiStarts(P, norm, form, free.coordinates), rest, DrawnStarts(-2, 0)]
        else:
            starts += [RegulatorStart(loop, mask, free.coordinates), rest, DrawnStarts(-1.5, 1)]
        return PartProblem(
            scaled=scaled,
            norm=norm,
            order=order,
            parametrisation=free,
            starts=tuple(starts),
            what=what,
            gain_bound=self.gain_bound,
            specifications=tuple(demands),
            demands="all specifications" if demands or self.gain_bound is not None else "",
            effort=POLICY.mixed,
            objective_loop=goal_loop,
            extra=b"".join(PlantMatrices.of(goal).fingerprint),
        )


@dataclass(frozen=True, eq=False)
class InequalityStart:
    """The controller of inequalities that share one Lyapunov matrix.

    Attributes
    ----------
    specifications : sequence of Specification
    regions : sequence of PoleRegion
    order : int
    backend, solver
        Who solves the programs.
    coordinates : callable
        From K to the free numbers.
    """

    specifications: Sequence[Specification]
    regions: Sequence[PoleRegion]
    order: int
    backend: str
    solver: str | None
    coordinates: Callable[[Matrix], Vector]

    def propose(
        self, earlier: Sequence[Vector], budget: Budget, rng: np.random.Generator
    ) -> Iterator[Vector]:
        """Propose the one controller, if a solver finds any."""
        own = budget.share(POLICY.start_share)
        if self.order:
            solver = ProgramSolver(self.backend, self.solver, own, accuracy=1e-8)
            K = mixed_start(self.specifications, self.regions, solver, POLICY.output_back_off)
        else:
            solver = ProgramSolver(self.backend, self.solver, own)
            K = mixed_state_start(self.specifications, self.regions, solver, POLICY.state_back_off)
        if K is not None:
            yield self.coordinates(K)


def _shared_channel(whole: GeneralizedPlant, asked: GeneralizedPlant) -> GeneralizedPlant:
    """Cut out of a part what it has of a channel; all of it if that is nothing."""
    w = [name for name in whole.disturbance_names if name in asked.disturbance_names]
    z = [name for name in whole.performance_names if name in asked.performance_names]
    return channel(whole, w, z) if w and z else whole


def _region(loop: PlantMatrices, region: PoleRegion) -> RegionMeasure:
    """Measure the largest eigenvalue of the region's matrix over the poles."""
    size = float(np.linalg.norm(loop.A, 2)) or 1.0
    scale = float(np.linalg.norm(region.L, 2)) + size * float(np.linalg.norm(region.M, 2))

    def distance(pole: complex) -> tuple[float, complex]:
        values, vectors = np.linalg.eigh(region.L + pole * region.M + np.conj(pole) * region.M.T)
        v = np.asarray(vectors)[:, -1]
        moved = complex(v.conj() @ region.M @ v)
        # The derivatives over real and imaginary part of s M + conj(s) M'.
        return float(values[-1]) + POLICY.inside * scale, complex(2 * moved.real, -2 * moved.imag)

    return RegionMeasure(loop, distance, scale)


def _measures_the_state(plant: GeneralizedPlant) -> bool:
    """Tell whether y = x, as the inequalities of state feedback assume."""
    return (
        np.array_equal(plant.C2, np.eye(plant.nx)) and not plant.D21.any() and not plant.D22.any()
    )
