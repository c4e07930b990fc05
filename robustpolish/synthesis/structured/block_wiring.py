"""Tunable blocks on a plant: the signals they join, their shared numbers, and the controller."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import AnyVector as Vector
from robustpolish.base.checks import described, instance_of, invalid
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.preflight import ScaledPlant
from robustpolish.synthesis.structured.block_parts import (
    ParameterSlot,
    ParameterTransform,
    Stage,
    Tunable,
    TunableBlock,
)

# K = [[Ak, Bk], [Ck, Dk]] as a function of the numbers of blocks, with its adjoint.


class WiredStage(NamedTuple):
    """A stage at its place among all of them.

    Attributes
    ----------
    stage : Stage
    numbers : ndarray of int
        Which of the free numbers each slot takes; -1 for one that is held.
    held : ndarray
        Values of the held slots, in the units of the search; 0 elsewhere.
    sizes : ndarray
        Units of the slots.
    entries : tuple of ndarray of int
        Rows and columns of its matrix in that of all stages.
    """

    stage: Stage
    numbers: NDArray[np.int_]
    held: Vector
    sizes: Vector
    entries: tuple[NDArray[np.int_], ...]

    def values(self, numbers: Vector) -> Vector:
        """Return the values of its slots, in the units of the search."""
        return np.where(self.numbers >= 0, numbers[self.numbers] / self.sizes, self.held)


@dataclass(frozen=True, eq=False)
class BlockGain:
    """The matrix M of all stages, side by side, wired to one controller.

    K = leave T enter with T = M (I - wires M)^-1: what stages put out goes into those behind them.
    As no wire leads back, the inverse exists for any M.

    Attributes
    ----------
    coordinates : sequence of ParameterTransform
        Of the free numbers.
    stages : sequence of WiredStage
    enter, wires, leave : ndarray
        From (xk, y) to the inputs of M; from its outputs to its inputs; from its outputs to
        (xk', u).
    """

    coordinates: Sequence[ParameterTransform]
    stages: Sequence[WiredStage]
    enter: Matrix
    wires: Matrix
    leave: Matrix

    @property
    def size(self) -> int:
        """Number of free numbers."""
        return len(self.coordinates)

    def numbers(self, theta: Vector) -> Vector:
        """Return the free numbers in their units."""
        return np.array([c.value(t) for c, t in zip(self.coordinates, theta, strict=True)])

    def gain(self, theta: Vector) -> Matrix:
        """Return K(theta)."""
        M, inverse = self._open_and_closed(self.numbers(theta))
        return self.leave @ (M @ inverse) @ self.enter

    def back(self, theta: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over K into one over theta."""
        numbers = self.numbers(theta)
        M, inverse = self._open_and_closed(numbers)
        # dT = (I - M wires)^-1 dM (I - wires M)^-1, and (I - M wires)^-1 = I + T wires.
        on_t = self.leave.T @ gradient @ self.enter.T
        on_m = (on_t + (M @ inverse @ self.wires).T @ on_t) @ inverse.T
        found = np.zeros(self.size)
        for wired in self.stages:
            slopes = wired.stage.back(wired.values(numbers), on_m[wired.entries])
            free = wired.numbers >= 0
            # One number may stand in several slots of a stage.
            np.add.at(found, wired.numbers[free], (slopes / wired.sizes)[free])
        return found * [c.slope(t) for c, t in zip(self.coordinates, theta, strict=True)]

    def _open_and_closed(self, numbers: Vector) -> tuple[Matrix, Matrix]:
        """Return M and (I - wires M)^-1."""
        M = np.zeros(self.wires.T.shape)
        for wired in self.stages:
            M[wired.entries] = wired.stage.matrix(wired.values(numbers))
        one = np.eye(len(self.wires))
        if not self.wires.any():
            return M, one
        loop = one - self.wires @ M
        return M, np.linalg.inv(loop)


# Blocks put on a plant: which signals they join, how all is called, which numbers are free.


@dataclass(frozen=True, eq=False, repr=False)
class PlacedBlock(TunableBlock):
    """A block whose signals are known, and whose stages are sized and named.

    Attributes
    ----------
    read, driven : ndarray of int
        Where its measurements and controls are among those of the plant.
    """

    measurements: tuple[str, ...]
    controls: tuple[str, ...]
    read: NDArray[np.int_]
    driven: NDArray[np.int_]

    @property
    def carrier(self) -> int:
        """The stage whose gain has units of u over y; the number of stages if there is none."""
        wide = [i for i, stage in enumerate(self.stages) if stage.resizable]
        gains = [i for i, stage in enumerate(self.stages) if stage.has_gain]
        return (wide or gains or [len(self.stages)])[0]

    def around(self, stage: int, y: Any, u: Any) -> tuple[Any, Any]:
        """Return the units of what enters and what leaves a stage, of those of y and u."""
        return (y if stage <= self.carrier else u, u if stage >= self.carrier else y)


@dataclass(frozen=True)
class PlacedParameter:
    """A number that is tuned, whoever shares it.

    Attributes
    ----------
    key : str
        Its name, or block and slot.
    tunable : Tunable
        Start and limits, those of its slots included.
    slot : ParameterSlot
        The first one that takes it.
    block, stage : int
        Where that is.
    """

    key: str
    tunable: Tunable
    slot: ParameterSlot
    block: int
    stage: int

    def limited(self, given: Tunable, slot: ParameterSlot) -> PlacedParameter:
        """Return the number with the limits of a slot that takes it besides.

        Raises
        ------
        InvalidInputError
            If no value is left, or the slot was given another number of this name.
        """
        if self.slot is not slot and self.slot.given != given:
            shown = described(f"{self.slot.given} and {given}")
            remedy = "Make it once with rp.tunable.tunable, and pass the same object to all blocks."
            raise invalid("blocks", shown, f"one meaning of {self.key}", remedy)
        low, high = max(self.tunable.low, slot.low), min(self.tunable.high, slot.high)
        if not low < high:
            shown = described(f"{given.name} between {given.low:g} and {given.high:g}")
            want = f"limits that a {slot.name} can keep"
            raise invalid(slot.name, shown, want, "Change its limits.")
        search = "positive" if slot.search == "positive" else self.slot.search
        tunable, first = (
            replace(self.tunable, low=low, high=high),
            replace(self.slot, search=search),
        )
        return replace(self, tunable=tunable, slot=first)


@dataclass(frozen=True, eq=False)
class Placement:
    """All blocks of a controller on their plant.

    Attributes
    ----------
    plant : GeneralizedPlant
    blocks : tuple of PlacedBlock
    """

    plant: GeneralizedPlant
    blocks: tuple[PlacedBlock, ...]

    @property
    def mask(self) -> NDArray[np.bool_]:
        """Which controls the blocks join to which measurements, shape (nu, ny)."""
        mask = np.zeros((self.plant.nu, self.plant.ny), bool)
        for block in self.blocks:
            mask[block.driven[:, None], block.read] = True
        return mask

    @property
    def places(self) -> Iterator[tuple[int, int, Stage]]:
        """Every stage with the number of its block and its own there."""
        for i, block in enumerate(self.blocks):
            for j, stage in enumerate(block.stages):
                yield i, j, stage

    @cached_property
    def numbers(self) -> tuple[PlacedParameter, ...]:
        """What is tuned, each number once.

        Raises
        ------
        InvalidInputError
            If a name has several meanings, or nothing is free.
        """
        found: dict[str, PlacedParameter] = {}
        for i, j, stage in self.places:
            for slot in (slot for slot in stage.slots if slot.held is None):
                key = self.key(stage, slot)
                given = slot.given if isinstance(slot.given, Tunable) else Tunable(key)
                known = found.get(key, PlacedParameter(key, given, slot, i, j))
                found[key] = known.limited(given, slot)
        if not found:
            raise invalid(
                "blocks",
                described("blocks all of whose numbers are held"),
                "a number to be tuned",
                "Leave one out, or certify the controller with rp.given_controller.",
            )
        return tuple(found.values())

    @staticmethod
    def key(stage: Stage, slot: ParameterSlot) -> str:
        """Return what a number is called among all of them."""
        return slot.given.name if isinstance(slot.given, Tunable) else f"{stage.name}.{slot.name}"


def place_blocks(blocks: Any, plant: GeneralizedPlant) -> Placement:
    """Put blocks on a plant.

    Parameters
    ----------
    blocks : TunableBlock or sequence of them
    plant : GeneralizedPlant

    Returns
    -------
    Placement

    Raises
    ------
    InvalidInputError
        If there is none, a signal is unknown or without effect, or a block does not fit.
    """
    remedy = "Pass a list, such as [rp.tunable.pid('x', control='F')]."
    try:
        given = [blocks] if isinstance(blocks, TunableBlock) else list(blocks)
    except TypeError:
        raise invalid("blocks", blocks, "blocks to be tuned", remedy) from None
    if not given:
        raise invalid("blocks", blocks, "at least one block", remedy)
    names: set[str] = set()
    for block in given:
        instance_of("blocks", block, TunableBlock, "a block, such as rp.tunable.pid('x')", remedy)
        for name in (stage.name for stage in block.stages if stage.name is not None):
            if name in names:
                want = "a name of its own for every block"
                raise invalid("name", name, want, "Only numbers are shared, by rp.tunable.")
            names.add(name)
    placed = tuple(_placed(block, plant, names) for block in given)
    seen = np.any(np.hstack([plant.C2, plant.D21, plant.D22]) != 0, axis=1)
    moves = np.any(np.vstack([plant.B2, plant.D12, plant.D22]) != 0, axis=0)
    for block in placed:
        text = ""
        if not seen[block.read].any():
            text = f"a block that reads {', '.join(block.measurements)}, which is always zero"
        elif not moves[block.driven].any():
            text = f"a block that drives {', '.join(block.controls)}, which moves nothing"
        if text:
            raise invalid("blocks", described(text), "blocks with an effect", "Leave it out.")
    return Placement(plant, placed)


def _placed(block: TunableBlock, plant: GeneralizedPlant, names: set[str]) -> PlacedBlock:
    wide = len(block.stages) == 1 and block.stages[0].resizable
    known = plant.measurement_names, plant.control_names
    read = _chosen("measurement", block.measurements, known[0], wide)
    driven = _chosen("control", block.controls, known[1], wide)
    continuous = [stage.kind for stage in block.stages if not stage.resizable]
    if plant.is_discrete and continuous:
        raise invalid(
            "plant",
            described(f"a discrete plant, dt = {plant.dt}, for a block of kind {continuous[0]}"),
            "a continuous plant",
            "Tune it for the continuous plant, then call design.discretize(period).",
        )
    stages, count = [], len(read)
    for position, stage in enumerate(block.stages):
        last = position == len(block.stages) - 1
        outputs = len(driven) if stage.resizable or last else stage.outputs
        stage = stage.sized(count, outputs)
        if stage.name is None:
            stage = replace(stage, name=_default_name(stage.kind, read, driven, names))
            names.add(stage.name or "")
        count = outputs
        stages.append(stage)
    rows = np.array([known[0].index(name) for name in read])
    columns = np.array([known[1].index(name) for name in driven])
    return PlacedBlock(read, driven, block.sign, tuple(stages), rows, columns)


def _chosen(
    argument: str, given: tuple[str, ...] | None, known: Sequence[str], wide: bool
) -> tuple[str, ...]:
    listed = f"one of {', '.join(known) or 'none'}"
    if given is None:
        if known and (wide or len(known) == 1):
            return tuple(known)
        shown = described(f"no name, with a plant that has {len(known)}")
        raise invalid(argument, shown, listed, "Say which: rp.tunable.pid('x', control='F').")
    for name in given:
        if name not in known:
            raise invalid(argument, name, listed, f"See plant.{argument}_names.")
    return given


def _default_name(kind: str, read: Sequence[str], driven: Sequence[str], names: set[str]) -> str:
    name = f"{kind}_{read[0]}" if len(read) == 1 else kind
    if name in names and len(driven) == 1:
        name = f"{name}_{driven[0]}"
    count, free = 2, name
    while free in names:
        free, count = f"{name}_{count}", count + 1
    return free


# Units that suit a loop: frequencies at which it may cross over, and gains that do it there.

# A mode counts if its part of the response from u to y is not below this share of the largest:
# the modes of weights and of what nobody measures do not belong to the loop.
_VISIBLE = 1e-9
# How far beyond the modes of the plant a loop may cross over.
_BELOW, _ABOVE = 30.0, 10.0


def crossover_band(plant: PlantMatrices) -> tuple[float, float]:
    """Return the lowest and the highest frequency at which a loop may cross over, in rad/s."""
    size = np.ones(1)
    if plant.nx:
        found = np.linalg.eig(plant.A)
        poles, right = np.asarray(found[0]), np.asarray(found[1])
        left = np.linalg.pinv(right)
        part = np.linalg.norm(left @ plant.B2, axis=1) * np.linalg.norm(plant.C2 @ right, axis=0)
        rates = np.abs(poles)
        kept = (part > _VISIBLE * part.max()) & (rates > 1e-6 * rates.max(initial=0.0))
        size = rates[kept] if kept.any() else size
    return float(size.min()) / _BELOW, float(size.max()) * _ABOVE


LoopSize = Callable[[PlacedBlock, int, ParameterSlot], float]
"""The value of a slot of a stage of a block that matters in the loop, in scaled units."""


def crossover_size(plant: PlantMatrices, frequency: float) -> LoopSize:
    """Return the numbers with which the loop of a scaled plant crosses over at a frequency."""
    try:
        pencil = 1j * frequency * np.eye(plant.nx) - plant.A
        response = np.abs(plant.C2 @ np.linalg.solve(pencil, plant.B2) + plant.D22)
    except np.linalg.LinAlgError:
        response = np.ones((plant.ny, plant.nu))

    def size(block: PlacedBlock, stage: int, slot: ParameterSlot) -> float:
        rate = frequency ** (-slot.time)
        if slot.out is None or stage != block.carrier:
            return rate
        gain = float(np.linalg.norm(response[block.read[:, None], block.driven]))
        return rate / gain if gain > 0 else rate

    return size


# A placement in the units of a scaled plant: its numbers as coordinates, its stages wired.


def block_parametrisation(
    placement: Placement, scaled: ScaledPlant, loop: LoopSize | None = None
) -> BlockGain:
    """Return K of the scaled plant as a function of the free numbers.

    Parameters
    ----------
    placement : Placement
    scaled : ScaledPlant
        Of the placement's plant.
    loop : callable, optional
        What the numbers are measured by; the entries of K are of order one by default.

    Returns
    -------
    BlockGain
    """
    index = {number.key: i for i, number in enumerate(placement.numbers)}
    coordinates = tuple(_transform(number, placement, scaled, loop) for number in placement.numbers)
    stages = [stage for _, _, stage in placement.places]
    order = sum(len(stage.states) for stage in stages)
    outs, ins = order + sum(s.outputs for s in stages), order + sum(s.inputs for s in stages)
    enter, wires = np.zeros((ins, order + scaled.original.ny)), np.zeros((ins, outs))
    leave = np.zeros((order + scaled.original.nu, outs))
    for M in (enter, leave):
        M[:order, :order] = np.eye(order)
    found: list[WiredStage] = []
    state, row, column, before = 0, order, order, np.zeros(0, int)
    for i, j, stage in placement.places:
        block = placement.blocks[i]
        own = np.arange(state, state + len(stage.states))
        rows, columns = row + np.arange(stage.outputs), column + np.arange(stage.inputs)
        sizes = _sizes(stage.slots, placement, scaled, i, j)
        inner: Any = np.append(own, rows), np.append(own, columns)
        held = [0.0 if slot.held is None else slot.held for slot in stage.slots]
        numbers = [index[placement.key(stage, s)] if s.held is None else -1 for s in stage.slots]
        found.append(
            WiredStage(
                stage.in_unit_of_time(scaled.time),
                np.array(numbers, dtype=int),
                np.array(held) / sizes,
                sizes,
                np.ix_(*inner),
            )
        )
        if j == 0:
            enter[columns, order + block.read] = 1.0
        else:
            wires[columns, before] = 1.0
        if j == len(block.stages) - 1:
            kept = block.carrier == len(block.stages)
            unit = scaled.measurement[block.read] / scaled.control[block.driven] if kept else 1.0
            leave[order + block.driven, rows] = block.sign * unit
        state, row, column = state + len(own), row + stage.outputs, column + stage.inputs
        before = rows
    return BlockGain(coordinates, tuple(found), enter, wires, leave)


def _transform(
    number: PlacedParameter, placement: Placement, scaled: ScaledPlant, loop: LoopSize | None
) -> ParameterTransform:
    slot, at = number.slot, (number.block, number.stage)
    size = float(_sizes([slot], placement, scaled, *at)[0])
    if loop is not None:
        size *= loop(placement.blocks[number.block], number.stage, slot)
    low, high = number.tunable.low, number.tunable.high
    if low > 0 or slot.search == "positive":
        return ParameterTransform(size, max(low, 0.0), high, "positive")
    # A narrow range is searched in its own size.
    if slot.search == "linear" and math.isfinite(low) and math.isfinite(high):
        size = min(size, high - low)
    return ParameterTransform(size, low, high, slot.search)


def _sizes(
    slots: Sequence[ParameterSlot], placement: Placement, scaled: ScaledPlant, i: int, j: int
) -> Vector:
    """Return the values of slots of a stage that are 1 in the units of the scaled plant."""
    block = placement.blocks[i]
    y, u = scaled.measurement[block.read], scaled.control[block.driven]
    into, out = block.around(j, y.tolist(), u.tolist())
    return np.array([slot.size(into, out, scaled.time) for slot in slots])
