"""Springs and dampers instead of a controller: what a force actuation means physically."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.design.design import Design
from robustpolish.synthesis.design.passive_element import PassiveElement, Place
from robustpolish.synthesis.methods.structured_design import (
    PartTask,
    certified_design,
    design_parts,
    search_deadline,
)
from robustpolish.synthesis.nonsmooth import FrobeniusMeasure, PositiveElements
from robustpolish.synthesis.problem.decoupling import decoupled_parts, named_controller
from robustpolish.synthesis.problem.fixed_modes import refuse_unstable
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.pricing import priced
from robustpolish.synthesis.problem.scaling import ScaledPlant, scale_plant
from robustpolish.synthesis.structured_search.search import Norm, Setting
from robustpolish.synthesis.structured_search.static import unscaled_controller
from robustpolish.validation import described, invalid, one_of, positive

Matrix = NDArray[Any]
Vector = NDArray[Any]

GROUND = "ground"

# Coefficients of the scaled plant that count as nothing.
_NOTHING = 1e-9
# Logarithm of the largest coefficient tried, in scaled units.
_HIGHEST = np.log(3e4)


def passive_feedback(
    plant: GeneralizedPlant,
    springs: Sequence[Place] = (),
    dampers: Sequence[Place] = (),
    norm: Norm = "hinf",
    *,
    stiffness_bound: float | Mapping[Place, float] | None = None,
    damping_bound: float | Mapping[Place, float] | None = None,
    control_weight: ArrayLike | None = None,
    time_limit: float = 60.0,
    seed: int = 0,
) -> Design:
    r"""Choose springs and dampers at given places for the smallest norm from w to z.

    The thesis reads its second solution, forces as controls, as springs and dampers
    added to the machine. Here that is meant literally: u is the force of elements with
    non-negative coefficients, k (q_b - q_a) and d (q_b' - q_a') on a and the opposite on b. Such
    elements cannot add energy, so a stable machine stays stable.

    Parameters
    ----------
    plant : GeneralizedPlant
        Continuous, with forces (or torques) as controls. A displacement is a state whose
        derivative is another state, its velocity; its force is the control that drives that
        velocity alone.
    springs, dampers : sequence of (str, str)
        Places, such as ``("x", "ground")`` or ``("x_m", "x")``: names of displacements.
    norm : {"hinf", "h2"}
        The norm from w to z.
    stiffness_bound, damping_bound : float or mapping, optional
        Largest coefficients, one for all or one for each place, in the plant's units. Without
        a bound the norm may fall for ever with a growing coefficient.
    control_weight : float or array_like, shape (nu,), optional
        Price on the forces: ``control_weight`` times u joins z.
    time_limit : float
        In s, for the whole call.
    seed : int
        Of the random starts.

    Returns
    -------
    Design
        With the state feedback that the elements amount to (its plant measures the state).
        ``details["elements"]`` lists each :class:`PassiveElement` with value and unit.

    Raises
    ------
    InvalidInputError
        If a place is unknown, has no velocity or no force, or the plant is discrete.
    InfeasibleError
        If the machine has an unstable mode that no element can reach.
    SolverError
        If no choice of elements makes the machine stable.

    References
    ----------
    M.L. Postma, Polishing robot: vibrations due to impact, (10.41) and section 11.2.

    Examples
    --------
    >>> import robustpolish as rp
    >>> mass = rp.GeneralizedPlant.from_matrices(
    ...     [[0.0, 1.0], [-100.0, 0.1]], [[0.0], [1.0]], [[0.0], [1.0]], [[1.0, 0.0]],
    ...     [[1.0, 0.0]], states=["x", "dx"],
    ... )
    >>> design = rp.passive_feedback(mass, dampers=[("x", "ground")], damping_bound=30.0)
    >>> for element in design.details["elements"]:
    ...     print(element)
    damper between x and ground: ... N s/m
    """
    began = time.monotonic()
    one_of("norm", norm, ("hinf", "h2"))
    time_limit = positive("time_limit", time_limit, "s")
    if plant.is_discrete:
        raise invalid(
            "plant",
            described(f"a discrete plant, dt = {plant.dt}"),
            "a continuous plant",
            "Springs and dampers act without a sampler: pass the continuous model.",
        )
    whole = priced(plant, control_weight).with_full_state()
    mechanics = _Mechanics.of(plant)
    wanted = [("spring", _place("springs", p, mechanics)) for p in springs]
    wanted += [("damper", _place("dampers", p, mechanics)) for p in dampers]
    if not wanted or len(set(wanted)) != len(wanted):
        raise invalid("springs", wanted, "different places, at least one", "Name them once each.")
    limits = [
        _limit(f"{'stiffness' if kind == 'spring' else 'damping'}_bound", bound, place)
        for kind, place in wanted
        for bound in [stiffness_bound if kind == "spring" else damping_bound]
    ]
    elements = np.array([mechanics.gain(kind, place) for kind, place in wanted])

    joined = (elements != 0).any(axis=0)
    parts = decoupled_parts(whole, joined)
    found, coefficients, tasks, members = [], np.zeros(len(wanted)), [], []
    for part in parts:
        rows = np.ix_(part.controls, part.measurements)
        own = [i for i, E in enumerate(elements) if part.controls and E[rows].any()]
        members.append(own)
        if not own:
            refuse_unstable(part.plant)
            tasks.append(None)
            continue
        task = _task(part.plant, norm, elements[own][:, *rows], [limits[i] for i in own])
        tasks.append(task)
    designs = design_parts(tasks, search_deadline(whole, began, time_limit), seed)
    for part, own, design in zip(parts, members, designs, strict=True):
        if design is not None:
            # Only a coefficient that nobody bounded can grow for ever.
            free = np.array([np.isinf(limits[i]) for i in own])
            growing = bool((design.point[free] > _HIGHEST - 0.1).any())
            found.append(replace(design, at_ceiling=growing))
            scaled = scale_plant(part.plant)
            rows = np.ix_(part.controls, part.measurements)
            local = elements[own][:, *rows]
            coefficients[own] = np.exp(design.point) * _sizes(scaled, local)
            coefficients[own] *= design.point > np.log(2 * _NOTHING)
    F = np.tensordot(coefficients, elements, axes=1)
    none = np.zeros
    controller = named_controller(whole, none((0, 0)), none((0, plant.nx)), none((plant.nu, 0)), F)
    return certified_design(
        whole,
        whole,
        controller,
        norm,
        found,
        "passive",
        began,
        {
            "elements": tuple(
                PassiveElement(kind, place, float(value), mechanics.unit(kind, place))
                for (kind, place), value in zip(wanted, coefficients, strict=True)
            )
        },
    )


@dataclass(frozen=True, eq=False)
class _Mechanics:
    """Which states are displacements, which are their velocities, and which forces act there."""

    plant: GeneralizedPlant
    velocity: Mapping[str, int]
    force: Mapping[str, int]

    @classmethod
    def of(cls, plant: GeneralizedPlant) -> _Mechanics:
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


def _place(argument: str, place: Place, mechanics: _Mechanics) -> Place:
    known = [n for n in mechanics.plant.states if n in mechanics.force]
    pair: list[str] = [place] if isinstance(place, str) else list(place)
    good = len(pair) == 2 and pair[0] != pair[1] and all(n in (*known, GROUND) for n in pair)
    if not good:
        raise invalid(
            argument,
            place,
            f"two different places out of {', '.join(known) or 'none'} and {GROUND}",
            "A place is a displacement state with a force on it: choose actuation='force'.",
        )
    return (pair[0], pair[1])


def _limit(argument: str, bound: float | Mapping[Place, float] | None, place: Place) -> float:
    if isinstance(bound, Mapping):
        bound = bound.get(place, bound.get((place[1], place[0])))
    return np.inf if bound is None else positive(argument, bound)


def _sizes(scaled: ScaledPlant, elements: Matrix) -> Vector:
    """Return for each element the coefficient that is 1 in scaled units."""
    u, y = scaled.control[:, None], scaled.measurement
    return np.array([1 / np.abs(E * y / u).max() for E in elements])


def _task(
    plant: GeneralizedPlant, norm: Norm, elements: Matrix, limits: Sequence[float]
) -> PartTask:
    def state() -> Setting:
        scaled = scale_plant(plant)
        size = _sizes(scaled, elements)
        u, y = scaled.control[:, None], scaled.measurement
        local = np.array([s * E * y / u for s, E in zip(size, elements, strict=True)])
        top = np.minimum(np.log(np.array(limits) / size), _HIGHEST)
        bottom = np.minimum(np.full(len(size), np.log(_NOTHING)), top - 1.0)

        def starts(deadline: float, rng: np.random.Generator) -> Iterator[Vector]:
            for level in (0.0, -3.0, 3.0, -8.0, 8.0):
                yield np.full(len(size), level)
            yield top
            yield bottom
            while True:
                yield rng.uniform(-10.0, 10.0, len(size))

        return Setting(
            scaled=scaled,
            norm=norm,
            loop=PlantMatrices.of(scaled.plant),
            parametrisation=PositiveElements(local),
            starts=starts,
            controller=lambda K: unscaled_controller(scaled, K, 0),
            what="choice of springs and dampers",
            bounds=(bottom, top),
            size=FrobeniusMeasure(),
            slack=1e-3,
        )

    return PartTask(plant, state, elements.tobytes() + repr(tuple(limits)).encode())
