"""The vertices of what is uncertain: a list of plants, or the corners of a box of real numbers."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.models import GeneralizedPlant, UncertainSystem
from robustpolish.models.plant.sorting import Chosen, chosen_names
from robustpolish.models.uncertain.elements import RealElement
from robustpolish.models.uncertain.lft import Lft, block_slices
from robustpolish.synthesis.polytopes.policy import POLICY
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.preflight import priced
from robustpolish.synthesis.problem.scaling import ScaledPlant, scale_plant
from robustpolish.validation import described, instance_of, invalid, is_whole

# Entries below this beside the others are what rounding leaves of a zero.
_ROUNDING = 1e-12
_NAMES = ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21", "D22")


@dataclass(frozen=True, eq=False)
class Polytope:
    """Plants at the vertices of a polytope, all with the same signals.

    Attributes
    ----------
    plants : tuple of GeneralizedPlant
    points : tuple of mapping of str to float
        Values of the numbers at each vertex; empty mappings for a list of plants.
    system : UncertainSystem or None
        The box from which the vertices are, disturbances before controls and outputs z before y.
    bends : tuple of float or None
        See :func:`bends_of`; None if some plants of the box are no mixtures of its corners.
    """

    plants: tuple[GeneralizedPlant, ...]
    points: tuple[Mapping[str, float], ...]
    system: UncertainSystem | None = None
    bends: tuple[float, ...] | None = ()

    @property
    def names(self) -> tuple[str, ...]:
        """What messages call the vertices."""
        told = [", ".join(f"{k} = {v:.6g}" for k, v in point.items()) for point in self.points]
        return tuple(text or f"plants[{i}]" for i, text in enumerate(told))

    @property
    def all_mixtures(self) -> bool:
        """Whether all plants that are meant are mixtures of the vertices."""
        return self.bends is not None

    def weights(self, values: Mapping[str, float]) -> Matrix:
        """Return the shares of the vertices in the plant at a point of the box.

        Parameters
        ----------
        values : mapping of str to float
            The numbers, in their own units.
        """
        ends = [np.array([1 - s, 1 + s]) / 2 for s in self.place(values)]
        return functools.reduce(np.kron, ends, np.ones(1))

    def place(self, values: Mapping[str, float]) -> list[float]:
        """Return numbers as positions from -1 to 1, between which plants are mixed evenly."""
        found = []
        for element, bend in zip(self.numbers, self.bends or (), strict=True):
            delta = element.delta(values[element.name])
            # delta / (1 - bend delta) on the line between its values at the ends.
            found.append(float((delta - bend) / (1 - bend * delta)))
        return found

    def speed(self, name: str) -> float:
        """Return by how much the position of a number changes at most per unit of it."""
        index = [element.name for element in self.numbers].index(name)
        element, bend = self.numbers[index], (self.bends or ())[index]
        # Position over value is a fraction without a pole in between: steepest at an end.
        steep = []
        for delta, value in ((-1.0, element.low), (1.0, element.high)):
            below = element.slope + element.skew * (value - element.nominal)
            slope = element.slope / below**2
            steep.append(slope * (1 - bend**2) / (1 - bend * delta) ** 2)
        return max(steep) * (1 + 1e-12)

    @property
    def numbers(self) -> tuple[RealElement, ...]:
        """The real numbers of the system."""
        return () if self.system is None else real_numbers(self.system)

    @property
    def positions(self) -> Matrix:
        """The numbers at the vertices as -1 and 1, shape (vertices, numbers)."""
        columns = np.array([list(point.values()) for point in self.points])
        middle = (columns.max(axis=0) + columns.min(axis=0)) / 2
        return np.sign(columns - middle)

    def with_full_state(self) -> Polytope:
        """Return the polytope with y = x at all vertices."""
        return replace(self, plants=tuple(plant.with_full_state() for plant in self.plants))


def scaled_vertices(whole: Polytope) -> tuple[ScaledPlant, tuple[PlantMatrices, ...]]:
    """Return the units of the plant in the middle, and all vertices in these units."""
    vertices = tuple(PlantMatrices.of(plant) for plant in whole.plants)
    middle = shrunk_matrices(vertices, 0.0)[0]
    like = {name: getattr(middle, name) for name in _NAMES}
    scaled = scale_plant(whole.plants[0].replace(**like))
    return scaled, tuple(scaled.in_units(p) for p in vertices)


def shrunk_matrices(vertices: Sequence[PlantMatrices], factor: float) -> tuple[PlantMatrices, ...]:
    """Return vertices moved towards their middle."""
    middle = {name: sum(getattr(p, name) for p in vertices) / len(vertices) for name in _NAMES}
    return tuple(
        p.replace(**{n: m + factor * (getattr(p, n) - m) for n, m in middle.items()})
        for p in vertices
    )


def polytope(
    given: Any,
    controls: Chosen | None,
    measurements: Chosen | None,
    control_weight: ArrayLike | None = None,
) -> Polytope:
    """Return the polytope that a user gave, as plants or as an uncertain system.

    Parameters
    ----------
    given : sequence of GeneralizedPlant, or UncertainSystem
    controls, measurements : int, str or sequence of str, or None
        Which signals of an uncertain system are u and y; None where plants say it. Without
        measurements all outputs are z.
    control_weight : float or array_like, optional
        Prices on u that join z.

    Returns
    -------
    Polytope

    Raises
    ------
    InvalidInputError
        If plants differ in more than their numbers, or something else than real numbers is
        uncertain.
    """
    if isinstance(given, UncertainSystem):
        if controls is None:
            raise invalid(
                "controls", controls, "names or number of the inputs that are controls",
                'Write controls=["F"].',
            )  # fmt: skip
        return _of_system(given, controls, measurements, control_weight)
    for argument, value in (("controls", controls), ("measurements", measurements)):
        if value is not None:
            remedy = "Leave it out: the plants say what their signals are."
            raise invalid(argument, value, "no choice of signals beside plants", remedy)
    return _of_plants(given, control_weight)


def _of_plants(given: Any, weight: ArrayLike | None) -> Polytope:
    kind, remedy = "a list of GeneralizedPlant, or an UncertainSystem", "Pass [plant, plant]."
    if isinstance(given, GeneralizedPlant) or not isinstance(given, Sequence) or not given:
        raise invalid("plant", described(type(given).__name__), kind, remedy)
    plants = tuple(instance_of(("plant", i), p, GeneralizedPlant, kind, remedy)
                   for i, p in enumerate(given))  # fmt: skip
    first = plants[0]
    for i, p in enumerate(plants):
        if p.delays:
            shown = described("a plant with delays")
            raise invalid(("plant", i), shown, "plants without", "Take plant.without_delays().")
        for what in ("nx", "nw", "nu", "nz", "ny", "dt"):
            mine, theirs = getattr(first, what), getattr(p, what)
            if mine != theirs:
                shown, want = described(f"{what} = {theirs}"), f"{mine} as of the first plant"
                raise invalid(("plant", i), shown, want, "Vertices differ in numbers only.")
    paid = tuple(priced(p, weight) for p in plants)
    return Polytope(paid, tuple(MappingProxyType({}) for _ in plants))


def _of_system(
    system: UncertainSystem,
    controls: Chosen,
    measurements: Chosen | None,
    weight: ArrayLike | None,
) -> Polytope:
    for element in system.elements.values():
        if not isinstance(element, RealElement):
            raise invalid(
                "plant", described(f"{element.name}, {element}"), "real numbers only",
                "Use robust_output_feedback for dynamics and complex numbers.",
            )  # fmt: skip
    count = len(system.elements)
    if not 1 <= count <= POLICY.most_numbers:
        want = f"1 to {POLICY.most_numbers}, which have {2**POLICY.most_numbers} vertices at most"
        raise invalid("plant", described(f"{count} uncertain numbers"), want, "Fix some with .at.")
    inputs = _last("controls", controls, system.input_labels, "inputs")
    outputs = _last("measurements", measurements or 0, system.output_labels, "outputs")
    nu, ny = len(inputs[1]), len(outputs[1])
    if not system.nstates:
        shown = described("a matrix without states")
        raise invalid("plant", shown, "a system with states", "Make it with uncertain_system.")
    ordered = system[[*outputs[0], *outputs[1]], [*inputs[0], *inputs[1]]]
    ends = [[(one.name, one.low), (one.name, one.high)] for one in real_numbers(system)]
    points = tuple(MappingProxyType(dict(corner)) for corner in itertools.product(*ends))
    plants = tuple(
        GeneralizedPlant(ordered.at(point), measurements=ny, controls=nu) for point in points
    )
    paid = tuple(priced(plant, weight) for plant in plants)
    whole = _with_prices(ordered, paid[0], len(outputs[0]))
    return Polytope(paid, points, whole, bends_of(ordered.matrices))


def _with_prices(system: UncertainSystem, priced_plant: GeneralizedPlant, nz: int) -> Any:
    """Return the system with the prices of a plant among its outputs, behind its first z."""
    one, D = system.matrices, priced_plant.D12[nz:]
    if not len(D):
        return system
    J = np.hstack([np.zeros((len(D), one.J.shape[1] - D.shape[1])), D])
    outputs = system.output_labels
    return UncertainSystem(
        replace(
            one,
            H=np.vstack([one.H[:nz], np.zeros((len(D), one.H.shape[1])), one.H[nz:]]),
            J=np.vstack([one.J[:nz], J, one.J[nz:]]),
            outputs=(*outputs[:nz], *priced_plant.performance_names[nz:], *outputs[nz:]),
        )
    )


def real_numbers(system: UncertainSystem) -> tuple[RealElement, ...]:
    """Return the real numbers of a system, in the order of its blocks."""
    return tuple(e for e in system.elements.values() if isinstance(e, RealElement))


def _last(
    argument: str, given: Chosen, labels: Sequence[str], what: str
) -> tuple[list[str], list[str]]:
    """Return the other signals and the chosen ones, each by name."""
    if is_whole(given):
        if not 0 <= given <= len(labels):
            raise invalid(argument, given, f"0 to {len(labels)}", f"Count the last {what}.")
        chosen = list(labels[len(labels) - int(given) :])
    else:
        chosen = chosen_names(argument, given, labels, what)
    return [name for name in labels if name not in chosen], chosen


def with_equal(whole: Polytope, names: Sequence[str]) -> Polytope:
    """Refuse vertices whose matrices of these names differ, but for rounding, which is taken out.

    Raises
    ------
    InvalidInputError
        It tells how to put a filter between.
    """
    first = whole.plants[0]
    equal = {name: getattr(first, name) for name in names}
    for name, matrix in equal.items():
        size = max(float(np.abs(getattr(p, name)).max(initial=0.0)) for p in whole.plants)
        for p in whole.plants:
            if np.abs(getattr(p, name) - matrix).max(initial=0.0) > _ROUNDING * size:
                inputs = name in ("B2", "D12")
                raise invalid(
                    "plant",
                    described(f"numbers that {name} depends on"),
                    f"the same {name} at all corners",
                    "Put a fast lag before the controls: plant * rp.append(np.eye(nw), lag)."
                    if inputs
                    else "Put a fast lag behind the measurements: rp.append(np.eye(nz), lag) * "
                    "plant.",
                )
    return replace(whole, plants=tuple(p.replace(**equal) for p in whole.plants))


def bends_of(system: Lft) -> tuple[float, ...] | None:
    """Return how each number has to be bent for every entry to be affine in it, the others held.

    With one number at a time on a line, every plant of the box is a mixture of its corners. It is
    so if no number acts back on others through which it is reached, and on itself by a factor at
    most: then v = delta / (1 - bend delta) stands for the number, as for k / m it is 1 / m.

    Parameters
    ----------
    system : Lft

    Returns
    -------
    tuple of float or None
        One for each block, between -1 and 1; None if there is no such way.
    """
    n = len(system.states)
    slices = block_slices(system)
    size = max(1.0, float(np.abs(system.F[n:, n:]).max(initial=0.0)))
    reaches = np.zeros((len(slices), len(slices)), bool)
    bends = []
    for i, (z, _) in enumerate(slices):
        for j, (_, w) in enumerate(slices):
            part = system.F[z][:, w]
            if i == j:
                bends.append(float(np.trace(part)) / len(z))
                part = part - bends[-1] * np.eye(len(z))
            reaches[i, j] = np.abs(part).max(initial=0.0) > _ROUNDING * size
    # No path leads from a number back to it if powers of the pattern vanish.
    power = np.linalg.matrix_power(reaches.astype(float), len(slices))
    if power.any() or max(map(abs, bends), default=0.0) >= 1:
        return None
    return tuple(0.0 if abs(bend) <= _ROUNDING else bend for bend in bends)
