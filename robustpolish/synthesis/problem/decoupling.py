"""Split a plant into parts that share no signal, and put their controllers together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.analysis import decoupled_blocks
from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.models import GeneralizedPlant
from robustpolish.models.plant.blocks import named_system


@dataclass(frozen=True, eq=False)
class PlantPart:
    """One decoupled part of a plant.

    Attributes
    ----------
    plant : GeneralizedPlant
        The part, with the names of the whole.
    states, disturbances, controls, performance, measurements : tuple of int
        Where its signals are in the whole.
    """

    plant: GeneralizedPlant
    states: tuple[int, ...]
    disturbances: tuple[int, ...]
    controls: tuple[int, ...]
    performance: tuple[int, ...]
    measurements: tuple[int, ...]


def decoupled_parts(
    plant: GeneralizedPlant, structure: NDArray[np.bool_] | None = None
) -> tuple[PlantPart, ...]:
    """Return the parts of a plant that are connected neither by it nor by its controller.

    Parameters
    ----------
    plant : GeneralizedPlant
    structure : ndarray of bool, shape (nu, ny), optional
        Entries of the controller that join a control to a measurement; none by
        default, because a full-order controller gains nothing from joining parts.

    Returns
    -------
    tuple of PlantPart
    """
    D = np.array(plant.system.D)
    if structure is not None:
        # A feedthrough as a mark only: it joins y to u in the graph.
        D = (D != 0).astype(float)
        D[plant.nz :, plant.nw :] += np.asarray(structure, float).T
    blocks = decoupled_blocks(plant.A, plant.system.B, plant.system.C, D)
    return tuple(_part(plant, b.states, b.inputs, b.outputs) for b in blocks)


def undivided(plant: GeneralizedPlant) -> PlantPart:
    """Return the whole plant as its only part."""
    counts = (plant.nx, plant.nw, plant.nu, plant.nz, plant.ny)
    return PlantPart(plant, *(tuple(range(count)) for count in counts))


def _part(
    plant: GeneralizedPlant, states: Sequence[int], inputs: Sequence[int], outputs: Sequence[int]
) -> PlantPart:
    disturbances = [i for i in inputs if i < plant.nw]
    controls = [i - plant.nw for i in inputs if i >= plant.nw]
    performance = [i for i in outputs if i < plant.nz]
    measurements = [i - plant.nz for i in outputs if i >= plant.nz]
    # python-control holds no outputs without inputs; without inputs they do not matter either.
    part = plant.part(
        states=states,
        disturbances=disturbances,
        controls=controls,
        performance=performance if inputs else [],
        measurements=measurements if inputs else [],
    )
    kept = (states, disturbances, controls, performance, measurements)
    return PlantPart(part, *(tuple(indices) for indices in kept))


def with_signals(part: GeneralizedPlant) -> GeneralizedPlant:
    """Add a w or a z without effect to a part that has none and only has to be stabilised."""
    if part.nw and part.nz:
        return part
    return part.replace(
        B1=part.B1 if part.nw else np.zeros((part.nx, 1)),
        C1=part.C1 if part.nz else np.zeros((1, part.nx)),
        disturbances=part.disturbance_names or None,
        performance=part.performance_names or None,
    )


def joined_controller(
    plant: GeneralizedPlant,
    parts: Sequence[PlantPart],
    controllers: Sequence[control.StateSpace | None],
) -> control.StateSpace:
    """Put the controllers of the parts together, with the plant's signal names.

    Parameters
    ----------
    plant : GeneralizedPlant
    parts : sequence of PlantPart
    controllers : sequence of control.StateSpace or None
        One for each part; None leaves the part's controls at zero.

    Returns
    -------
    control.StateSpace
        From the plant's measurements to its controls.
    """
    order = sum(0 if K is None else K.nstates for K in controllers)
    A, B = np.zeros((order, order)), np.zeros((order, plant.ny))
    C, D = np.zeros((plant.nu, order)), np.zeros((plant.nu, plant.ny))
    start = 0
    for part, K in zip(parts, controllers, strict=True):
        if K is None:
            continue
        own = list(range(start, start + K.nstates))
        start += K.nstates
        A[np.ix_(own, own)] = K.A
        B[np.ix_(own, part.measurements)] = K.B
        C[np.ix_(part.controls, own)] = K.C
        D[np.ix_(part.controls, part.measurements)] = K.D
    return named_controller(plant, A, B, C, D)


def named_controller(
    plant: GeneralizedPlant, A: Matrix, B: Matrix, C: Matrix, D: Matrix
) -> control.StateSpace:
    """Return a controller whose signals have the names of the plant's y and u."""
    states = [f"xk{i + 1}" for i in range(len(A))]
    names = (plant.measurement_names, plant.control_names, states)
    return named_system((A, B, C, D), plant.dt, *names)
