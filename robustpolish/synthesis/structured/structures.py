"""The search for a controller of prescribed structure, part by part."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import AnyVector as Vector
from robustpolish.base.budget import Budget
from robustpolish.base.checks import described, invalid
from robustpolish.errors import InfeasibleError
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.lmi.mixed import Specification, mixed_start, mixed_state_start
from robustpolish.synthesis.lmi.program import ProgramSolver
from robustpolish.synthesis.nonsmooth.descent import Requirement
from robustpolish.synthesis.nonsmooth.measures import FrobeniusMeasure, RegionMeasure
from robustpolish.synthesis.nonsmooth.parametrisations import (
    AffineGain,
    MaskedGain,
    ObserverGain,
    PositiveElements,
)
from robustpolish.synthesis.problem.matrices import PlantMatrices, augmented, channel
from robustpolish.synthesis.problem.pole_regions import PassiveElement, Place, PoleRegion
from robustpolish.synthesis.problem.scaling import (
    PlantPart,
    ScaledPlant,
    named_controller,
    scale_plant,
)
from robustpolish.synthesis.structured.observer import RiccatiStarts
from robustpolish.synthesis.structured.order_starts import AugmentedStarts, ReducedStarts
from robustpolish.synthesis.structured.search import (
    POLICY,
    ControllerStructure,
    Norm,
    PartDesign,
    PartProblem,
    StartProposal,
    bound_in_words,
    norm_measure,
    scaled_part,
)
from robustpolish.synthesis.structured.starts import (
    DrawnStarts,
    KnownStarts,
    RegulatorStart,
    StabilisingStart,
)

# Springs and dampers between places of a machine, instead of a controller.

GROUND = "ground"


@dataclass(frozen=True, eq=False)
class Mechanics:
    """Which states are displacements, which are their velocities, and which forces act there."""

    plant: GeneralizedPlant
    velocity: Mapping[str, int]
    force: Mapping[str, int]

    @classmethod
    def of(cls, plant: GeneralizedPlant) -> Mechanics:
        """Read the places of a machine off its matrices."""
        A, B = plant.A, plant.B2
        velocity: dict[str, int] = {}
        force: dict[str, int] = {}
        for i, name in enumerate(plant.states):
            into = np.flatnonzero(A[i])
            if len(into) != 1 or A[i, into[0]] != 1 or into[0] == i or B[i].any():
                continue
            velocity[name] = int(into[0])
            for j in range(plant.nu):
                if B[into[0], j] > 0 and np.count_nonzero(B[:, j]) == 1:
                    force[name] = j
        return cls(plant, velocity, force)

    def gain(self, kind: str, place: Place) -> Matrix:
        """Return the state feedback of one element with coefficient 1."""
        nx = self.plant.nx
        apart = np.zeros(nx)
        for name, sign in zip(place, (1.0, -1.0), strict=True):
            if name != GROUND:
                at = self.plant.states.index(name) if kind == "spring" else self.velocity[name]
                apart[at] = sign
        F = np.zeros((self.plant.nu, nx))
        for name, sign in zip(place, (-1.0, 1.0), strict=True):
            if name != GROUND:
                F[self.force[name]] += sign * apart
        return F

    def unit(self, kind: str, place: Place) -> str:
        """Return the unit of a coefficient."""
        name = next(n for n in place if n != GROUND)
        of_u = self.plant.units.get(self.plant.control_names[self.force[name]], "N")
        of_q = self.plant.units.get(name, "m")
        return f"{of_u}/{of_q}" if kind == "spring" else f"{of_u} s/{of_q}"


@dataclass(frozen=True, eq=False)
class PassiveStructure(ControllerStructure):
    """Coefficients of springs and dampers, not negative.

    Attributes
    ----------
    norm : {"hinf", "h2"}
    mechanics : Mechanics
    wanted : sequence of (kind, place)
    limits : ndarray
        Largest coefficient of each; infinite for none.
    """

    norm: Norm
    mechanics: Mechanics
    wanted: Sequence[tuple[str, Place]]
    limits: Vector
    method: ClassVar[str] = "passive"

    @cached_property
    def elements(self) -> Matrix:
        """State feedback of each element with coefficient 1."""
        return np.array([self.mechanics.gain(kind, place) for kind, place in self.wanted])

    @property
    def joined(self) -> Matrix:
        """Which controls the elements join to which states."""
        return (self.elements != 0).any(axis=0)

    def problem(self, part: PlantPart) -> PartProblem | None:
        """State the search over the coefficients in one part; see :meth:`Structure.problem`."""
        members, local = self._within(part)
        if not members:
            return None
        scaled = scale_plant(part.plant)
        size, limits = _sizes(scaled, local), self.limits[members]
        u, y = scaled.control[:, None], scaled.measurement
        top = np.minimum(np.log(limits / size), POLICY.highest)
        bottom = np.minimum(np.full(len(size), np.log(POLICY.nothing)), top - 1.0)
        levels = [np.full(len(size), level) for level in (0.0, -3.0, 3.0, -8.0, 8.0)]
        return PartProblem(
            scaled=scaled,
            norm=self.norm,
            order=0,
            parametrisation=PositiveElements(size[:, None, None] * local * y / u),
            starts=(KnownStarts([*levels, top, bottom]), _DrawnCoefficients(len(size))),
            what="choice of springs and dampers",
            effort=POLICY.passive,
            bounds=(bottom, top),
            open_ended=np.isinf(limits),
            size=FrobeniusMeasure(),
            # Share of the norm that is given away for a smaller gain, and for smaller springs and
            # dampers, whose norm is flat where several do the same.
            slack=1e-3,
            extra=local.tobytes() + limits.tobytes(),
        )

    def join(
        self,
        plant: GeneralizedPlant,
        parts: Sequence[PlantPart],
        designs: Sequence[PartDesign | None],
    ) -> tuple[control.StateSpace, dict[str, Any]]:
        """Return the state feedback that all elements amount to, and list them."""
        coefficients = np.zeros(len(self.wanted))
        for part, found in zip(parts, designs, strict=True):
            if found is not None:
                members, local = self._within(part)
                used = found.point > np.log(2 * POLICY.nothing)
                coefficients[members] = np.exp(found.point) * _sizes(found.scaled, local) * used
        F = np.tensordot(coefficients, self.elements, axes=1)
        none = np.zeros
        named = named_controller(plant, none((0, 0)), none((0, plant.nx)), none((plant.nu, 0)), F)
        elements = tuple(
            PassiveElement(kind, place, float(value), self.mechanics.unit(kind, place))
            for (kind, place), value in zip(self.wanted, coefficients, strict=True)
        )
        return named, {"elements": elements}

    def _within(self, part: PlantPart) -> tuple[list[int], Matrix]:
        """Return which elements act in a part, and their gains there."""
        own = self.elements[:, *np.ix_(part.controls, part.measurements)]
        members = [i for i, E in enumerate(own) if E.any()]
        return members, own[members]


@dataclass(frozen=True)
class _DrawnCoefficients:
    """Logarithms of random coefficients, without an end."""

    count: int

    def propose(
        self, earlier: Sequence[Vector], budget: Budget, rng: np.random.Generator
    ) -> Iterator[Vector]:
        """Propose coefficients from next to nothing to very hard."""
        while True:
            yield rng.uniform(-10.0, 10.0, self.count)


def _sizes(scaled: ScaledPlant, elements: Matrix) -> Vector:
    """Return for each element the coefficient that is 1 in scaled units."""
    u, y = scaled.control[:, None], scaled.measurement
    return np.array([1 / np.abs(E * y / u).max() for E in elements])


# Static and fixed-order output feedback with a pattern of free entries.


@dataclass(frozen=True, eq=False)
class StaticStructure(ControllerStructure):
    """Output feedback [[Ak, Bk], [Ck, Dk]] of a given order, with free entries where allowed.

    Attributes
    ----------
    norm : {"hinf", "h2"}
    order : int
        States of the controller of each part.
    mask : ndarray of bool, shape (order + nu, order + ny), or None
        Free entries, of the whole plant; all of each part by default.
    gain_bound : float or None
    initial : control.StateSpace or None
        For the whole plant: where to start first.
    """

    norm: Norm
    order: int = 0
    mask: NDArray[np.bool_] | None = None
    gain_bound: float | None = None
    initial: control.StateSpace | None = None

    def problem(self, part: PlantPart) -> PartProblem | None:
        """State the search over the free entries of one part; see :meth:`Structure.problem`."""
        plant, order, start = part.plant, self.order, self.initial
        own = np.ix_(part.controls, part.measurements)
        if self.mask is None:
            mask = np.ones((order + plant.nu, order + plant.ny), bool)
        else:
            mask = self.mask if order else self.mask[own]
        if plant.nx == 0 or not mask.any():
            return None
        if start is not None and not order:
            start = control.StateSpace([], [], [], np.asarray(start.D)[own], plant.dt)
        what = f"controller of order {order}" if order else "static gain"
        # Whatever the pattern of a dynamic controller, it moves no mode that no gain moves.
        scaled, inner = scaled_part(plant, what, None if order else mask)
        loop = augmented(inner, order)
        free = MaskedGain(mask) if self.norm == "hinf" else free_gain(mask, loop)
        rest = free.coordinates(zero_controller(mask.shape, order, loop.discrete))
        known = [] if start is None else [free.coordinates(scaled_matrix(start, scaled))]
        starts: list[StartProposal] = [KnownStarts([*known, rest])]
        if self.mask is None:
            if order:
                # Half the order, down to none: each search starts from the one before.
                shorter = replace(self, order=order // 2, initial=None).problem(part)
                if shorter is not None:
                    starts.append(AugmentedStarts(shorter, order, free.coordinates))
            starts.append(ReducedStarts(scaled.plant, self.norm, order, free.coordinates))
        return PartProblem(
            scaled=scaled,
            norm=self.norm,
            order=order,
            parametrisation=free,
            starts=(
                *starts,
                StabilisingStart(loop, mask, free.coordinates),
                RegulatorStart(loop, mask, free.coordinates),
                DrawnStarts(-1.5, 1.5, relative=False, base=rest),
            ),
            what=what,
            gain_bound=self.gain_bound,
            demands=bound_in_words(self.gain_bound),
            extra=mask.tobytes() + b"".join(point.tobytes() for point in known),
        )


def zero_controller(shape: tuple[int, int], order: int, discrete: bool) -> Matrix:
    """Return the K whose states decay and whose u is zero."""
    rest = np.zeros(shape)
    rest[:order, :order] = 0.0 if discrete else -np.eye(order)
    return rest


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


def scaled_matrix(controller: control.StateSpace, scaled: ScaledPlant) -> Matrix:
    """Return [[Ak, Bk], [Ck, Dk]] of a controller in the units of the scaled plant."""
    u, y = scaled.control[:, None], scaled.measurement
    A, B, C, D = (np.asarray(M) for M in (controller.A, controller.B, controller.C, controller.D))
    return np.block([[A * scaled.time, B * scaled.time * y], [C / u, D * y / u]])


# Controllers under several specifications at once: static or of full order.


@dataclass(frozen=True, eq=False)
class MixedStructure(ControllerStructure):
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
        rest = KnownStarts([free.coordinates(zero_controller(mask.shape, order, loop.discrete))])
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
            # How far the norm backs off from the optimum of shared inequalities before the
            # controller is made small; a dynamic controller needs more room for its change of
            # variables.
            K = mixed_start(self.specifications, self.regions, solver, 1.05)
        else:
            solver = ProgramSolver(self.backend, self.solver, own)
            K = mixed_state_start(self.specifications, self.regions, solver, 1.01)
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
        # Poles are asked so far inside their region, relative to the plant's size.
        return float(values[-1]) + 1e-7 * scale, complex(2 * moved.real, -2 * moved.imag)

    return RegionMeasure(loop, distance, scale)


def _measures_the_state(plant: GeneralizedPlant) -> bool:
    """Tell whether y = x, as the inequalities of state feedback assume."""
    return (
        np.array_equal(plant.C2, np.eye(plant.nx)) and not plant.D21.any() and not plant.D22.any()
    )
