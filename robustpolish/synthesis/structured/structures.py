"""Kinds of controllers of prescribed structure: how each is searched in one part, and joined."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import count
from typing import ClassVar

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import AnyVector as Vector
from robustpolish.base.checks import described, invalid
from robustpolish.errors import InfeasibleError
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import Norm
from robustpolish.synthesis.lmi.output_feedback import LMI_STATES
from robustpolish.synthesis.nonsmooth import descent
from robustpolish.synthesis.nonsmooth.measures import FrobeniusMeasure, RegionMeasure, norm_measure
from robustpolish.synthesis.problem.matrices import (
    PlantMatrices,
    augmented,
    channel,
    controller_matrix,
)
from robustpolish.synthesis.problem.pole_regions import PassiveElement, Place, PoleRegion
from robustpolish.synthesis.problem.preflight import PlantPart, ScaledPlant, scale_plant
from robustpolish.synthesis.structured import search, starts
from robustpolish.synthesis.structured.starts import Specification, observer_controller

# Springs and dampers between places of a machine, instead of a controller.

GROUND = "ground"
# Coefficients of springs and dampers, in scaled units, that count as nothing, and the largest ones.
_NOTHING, _HIGHEST = 1e-9, 3e4


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
        apart, pull = np.zeros(self.plant.nx), np.zeros(self.plant.nu)
        for name, sign in zip(place, (1.0, -1.0), strict=True):
            if name != GROUND:
                at = self.plant.states.index(name) if kind == "spring" else self.velocity[name]
                apart[at] = sign
                pull[self.force[name]] -= sign
        return np.outer(pull, apart)

    def unit(self, kind: str, place: Place) -> str:
        """Return the unit of a coefficient."""
        name = next(n for n in place if n != GROUND)
        of_u = self.plant.units.get(self.plant.control_names[self.force[name]], "N")
        of_q = self.plant.units.get(name, "m")
        return f"{of_u}/{of_q}" if kind == "spring" else f"{of_u} s/{of_q}"


@dataclass(frozen=True, eq=False)
class PassiveStructure(search.ControllerStructure):
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

    def problem(self, part: PlantPart) -> search.PartProblem | None:
        """State the search over the logarithms of the coefficients of the elements in one part."""
        scaled = scale_plant(part.plant)
        members, local, size = self._within(part, scaled)
        if not members:
            return None
        limits = self.limits[members]
        top = np.minimum(np.log(limits / size), np.log(_HIGHEST))
        bottom = np.minimum(np.full(len(size), np.log(_NOTHING)), top - 1.0)
        levels = [np.full(len(size), level) for level in (0.0, -3.0, 3.0, -8.0, 8.0)]
        u, y = scaled.control[:, None], scaled.measurement
        return search.PartProblem(
            scaled=scaled,
            norm=self.norm,
            order=0,
            parametrisation=descent.PositiveElements(size[:, None, None] * local * y / u),
            starts=(
                partial(starts.known, [*levels, top, bottom]),
                lambda _, rng: (rng.uniform(-10.0, 10.0, len(size)) for _ in count()),
            ),
            what="choice of springs and dampers",
            effort=search.SearchEffort(smooth_first=False),
            bounds=(bottom, top),
            open_ended=np.isinf(limits),
            size=FrobeniusMeasure(),
            # The norm is flat where several elements do the same: more of it buys smaller ones.
            slack=1e-3,
            extra=local.tobytes() + limits.tobytes(),
        )

    def join(
        self, plant: GeneralizedPlant, parts: Sequence[PlantPart], designs: search.Designs
    ) -> search.Joined:
        """Return the state feedback that all elements amount to, and list them."""
        coefficients = np.zeros(len(self.wanted))
        for part, found in zip(parts, designs, strict=True):
            if found is not None:
                members, _, size = self._within(part, found.part.scaled)
                used = found.point > np.log(2 * _NOTHING)
                coefficients[members] = np.exp(found.point) * size * used
        elements = tuple(
            PassiveElement(kind, place, float(value), self.mechanics.unit(kind, place))
            for (kind, place), value in zip(self.wanted, coefficients, strict=True)
        )
        F = np.tensordot(coefficients, self.elements, axes=1)
        return plant.static_controller(F), {"elements": elements}

    def _within(self, part: PlantPart, scaled: ScaledPlant) -> tuple[list[int], Matrix, Vector]:
        """Return which elements act in a part, their gains there, and their units."""
        own = self.elements[:, *np.ix_(part.controls, part.measurements)]
        members = [i for i, E in enumerate(own) if E.any()]
        u, y = scaled.control[:, None], scaled.measurement
        return members, own[members], np.array([1 / np.abs(E * y / u).max() for E in own[members]])


# Static and fixed-order output feedback with a pattern of free entries.


@dataclass(frozen=True, eq=False)
class StaticStructure(search.ControllerStructure):
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

    def problem(self, part: PlantPart) -> search.PartProblem | None:
        """State the search over the free entries of one part."""
        plant, order, start = part.plant, self.order, self.initial
        own = np.ix_(part.controls, part.measurements)
        mask = np.ones((order + plant.nu, order + plant.ny), bool)
        if self.mask is not None:
            mask = self.mask if order else self.mask[own]
        if plant.nx == 0 or not mask.any():
            return None
        if start is not None and not order:
            start = control.StateSpace([], [], [], np.asarray(start.D)[own], plant.dt)
        what = f"controller of order {order}" if order else "static gain"
        # Whatever the pattern of a dynamic controller, it moves no mode that no gain moves.
        scaled, inner = search.scaled_part(plant, what, None if order else mask)
        loop = augmented(inner, order)
        free = descent.MaskedGain(mask) if self.norm == "hinf" else free_gain(mask, loop)
        to_free = free.coordinates
        rest = to_free(zero_controller(mask.shape, order, loop.discrete))
        known = (
            [] if start is None else [to_free(controller_matrix(scaled.scaled_controller(start)))]
        )
        proposals: list[search.StartProposal] = [partial(starts.known, [*known, rest])]
        if self.mask is None:
            if order:
                # Half the order, down to none: each search starts from the one before.
                shorter = replace(self, order=order // 2, initial=None).problem(part)
                if shorter is not None:
                    proposals.append(partial(starts.augmented, shorter, order, to_free))
            proposals.append(partial(starts.reduced, scaled.plant, self.norm, order, to_free))
        return search.PartProblem(
            scaled=scaled,
            norm=self.norm,
            order=order,
            parametrisation=free,
            starts=(
                *proposals,
                partial(starts.stabilising, loop, mask, to_free),
                partial(starts.regulator, loop, mask, to_free),
            ),
            scatter=(-1.5, 1.5),
            rest=rest,
            what=what,
            gain_bound=self.gain_bound,
            extra=mask.tobytes() + b"".join(point.tobytes() for point in known),
        )


def zero_controller(shape: tuple[int, int], order: int, discrete: bool) -> Matrix:
    """Return the K whose states decay and whose u is zero."""
    rest = np.zeros(shape)
    rest[:order, :order] = 0.0 if discrete else -np.eye(order)
    return rest


def free_gain(
    mask: NDArray[np.bool_], loop: PlantMatrices
) -> descent.AffineGain | descent.MaskedGain:
    """Free the marked entries, as far as the feedthrough of a continuous loop stays zero.

    Raises
    ------
    InfeasibleError
        If no gain of the pattern cancels D11.
    """
    free = descent.MaskedGain(mask)
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


# State feedback of an observer's estimate.


@dataclass(frozen=True, eq=False)
class ObserverStructure(search.ControllerStructure):
    """u = F xhat with a Luenberger observer, over F and L.

    Attributes
    ----------
    norm : {"hinf", "h2"}
    gain_bound : float or None
    """

    norm: Norm
    gain_bound: float | None = None
    method: ClassVar[str] = "observer"

    def problem(self, part: PlantPart) -> search.PartProblem | None:
        """State the search over F and L of one part."""
        plant, what = part.plant, "observer-based controller"
        if 0 in (plant.nx, plant.nu, plant.ny):
            return None
        if self.norm == "h2" and not plant.is_discrete and plant.D11.any():
            raise InfeasibleError(
                "The H2 norm is infinite for every observer-based controller: D11 passes the "
                "disturbance straight to z. Filter the disturbance or the output, or use 'hinf'."
            )
        scaled, inner = search.scaled_part(plant, what)
        form = descent.ObserverGain(inner.A, inner.B2, inner.C2, inner.D22)
        return search.PartProblem(
            scaled=scaled,
            norm=self.norm,
            order=plant.nx,
            parametrisation=form,
            starts=(partial(starts.riccati, inner, self.norm, form.coordinates),),
            scatter=(-2, 0),
            what=what,
            gain_bound=self.gain_bound,
            # The H2 problem over F and L is smooth and its Riccati start optimal, so that few
            # descents tell.
            effort=search.SearchEffort(descents=14, fewest=9 if self.norm == "hinf" else 3),
        )

    def join(
        self, plant: GeneralizedPlant, parts: Sequence[PlantPart], designs: search.Designs
    ) -> search.Joined:
        """Return the observer of the whole plant from F and L of its parts."""
        F, L = np.zeros((plant.nu, plant.nx)), np.zeros((plant.nx, plant.ny))
        for part, found in zip(parts, designs, strict=True):
            if found is None:
                continue
            scaled, P = found.part.scaled, found.part.scaled.plant
            own_F, own_L = descent.ObserverGain(P.A, P.B2, P.C2, P.D22).split(found.point)
            own_L = scaled.state[:, None] * own_L / scaled.measurement / scaled.time
            F[np.ix_(part.controls, part.states)] = scaled.state_gain(own_F)
            L[np.ix_(part.states, part.measurements)] = own_L
        return observer_controller(plant, F, L), {
            "state_feedback": F,
            "observer_gain": L,
            "feedback_poles": np.linalg.eigvals(plant.A + plant.B2 @ F),
            "observer_poles": np.linalg.eigvals(plant.A - L @ plant.C2),
        }


# Controllers under several specifications at once: static or of full order.


@dataclass(frozen=True, eq=False)
class MixedStructure(search.ControllerStructure):
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
    solver : tuple of str
        Backend and solver of linear matrix inequalities.
    """

    norm: Norm
    goal: GeneralizedPlant
    static: bool
    side: GeneralizedPlant | None
    side_bound: float | None
    regions: tuple[PoleRegion, ...]
    gain_bound: float | None
    solver: tuple[str, str | None]
    method: ClassVar[str] = "lmi, descent"

    def problem(self, part: PlantPart) -> search.PartProblem | None:
        """State the search in one part, scaled as a whole."""
        plant, norm = part.plant, self.norm
        if 0 in (plant.nx, plant.nu, plant.ny):
            return None
        order = 0 if self.static else plant.nx
        what = "controller" if order else "static gain"
        scaled, inner = search.scaled_part(plant, what)
        loop = augmented(inner, order)
        goal = _shared_channel(scaled.plant, self.goal)
        goal_matrices = PlantMatrices.of(goal)
        goal_loop = augmented(goal_matrices, order)
        h2_loop = goal_loop if norm == "h2" else None
        regions = tuple(region.in_unit_of_time(scaled.time) for region in self.regions)
        demands: list[descent.Requirement] = []
        specifications = [Specification(goal, norm, None)]
        if self.side is not None and self.side_bound is not None:
            other: Norm = "h2" if norm == "hinf" else "hinf"
            side = _shared_channel(scaled.plant, self.side)
            side_loop = augmented(PlantMatrices.of(side), order)
            bound = scaled.scaled_norm(self.side_bound, other)
            demands.append(descent.Requirement(norm_measure(side_loop, other), bound))
            specifications.append(Specification(side, other, bound))
            h2_loop = side_loop if other == "h2" else h2_loop
        demands.extend(descent.Requirement(_region(loop, region), None) for region in regions)
        mask = np.ones((order + plant.nu, order + plant.ny), bool)
        free = descent.MaskedGain(mask) if h2_loop is None else free_gain(mask, h2_loop)
        to_free = free.coordinates
        rest = zero_controller(mask.shape, order, loop.discrete)
        known = partial(starts.known, [to_free(rest)])
        proposals: tuple[search.StartProposal, ...] = (
            partial(starts.riccati, goal_matrices, norm, to_free)
            if order
            else partial(starts.regulator, loop, mask, to_free),
            known,
        )
        # The inequalities of state feedback assume y = x.
        measured = np.array_equal(plant.C2, np.eye(plant.nx)) and not (
            plant.D21.any() or plant.D22.any()
        )
        small = plant.nx <= LMI_STATES
        if small and not plant.is_discrete and (order or measured):
            first = partial(starts.inequality, specifications, regions, order, self.solver, to_free)
            proposals = first, *proposals
        return search.PartProblem(
            scaled=scaled,
            norm=norm,
            order=order,
            parametrisation=free,
            starts=proposals,
            scatter=(-2, 0) if order else (-1.5, 1),
            what=what,
            gain_bound=self.gain_bound,
            specifications=tuple(demands),
            effort=search.SearchEffort(descents=8),
            objective_loop=goal_loop,
            extra=b"".join(goal_matrices.fingerprint),
        )


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
