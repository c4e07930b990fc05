"""Blocks whose numbers are tuned: what they consist of, and the controller that they make."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import AnyVector as Vector
from robustpolish.base.checks import described, instance_of, invalid
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.scaling import ScaledPlant
from robustpolish.synthesis.structured.block_parts import (
    ParameterSlot,
    ParameterTransform,
    Stage,
    Tunable,
    TunableBlock,
)

# K = [[Ak, Bk], [Ck, Dk]] as a function of the numbers of blocks, with its adjoint.


@dataclass(frozen=True, eq=False)
class WiredStage:
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
    rows, columns : ndarray of int
        Where its matrix stands in that of all stages.
    """

    stage: Stage
    numbers: NDArray[np.int_]
    held: Vector
    sizes: Vector
    rows: NDArray[np.int_]
    columns: NDArray[np.int_]

    def values(self, numbers: Vector) -> Vector:
        """Return the values of its slots, in the units of the search."""
        if not len(self.numbers):
            return self.held
        free = self.numbers >= 0
        return np.where(free, numbers[self.numbers] / self.sizes, self.held)


@dataclass(frozen=True, eq=False)
class BlockGain:
    """The matrix M of all stages, side by side, wired to one controller.

    K = leave T enter with T = M (I - wires M)^-1: what stages put out goes into those behind them.
    As no wire leads back, the inverse exists for any M.

    Attributes
    ----------
    coordinates : sequence of Coordinate
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
        M = self._block_diagonal(self.numbers(theta))
        return self.leave @ (M @ self._feedback_inverse(M)) @ self.enter

    def back(self, theta: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over K into one over theta."""
        numbers = self.numbers(theta)
        M = self._block_diagonal(numbers)
        around = self._feedback_inverse(M)
        # dT = (I - M wires)^-1 dM (I - wires M)^-1, and (I - M wires)^-1 = I + T wires.
        on_t = self.leave.T @ gradient @ self.enter.T
        on_m = (on_t + (M @ around @ self.wires).T @ on_t) @ around.T
        found = np.zeros(self.size)
        for wired in self.stages:
            own = on_m[wired.rows[:, None], wired.columns]
            slopes = wired.stage.back(wired.values(numbers), own)
            for number, slope, size in zip(wired.numbers, slopes, wired.sizes, strict=True):
                if number >= 0:
                    found[number] += slope / size
        return found * [c.slope(t) for c, t in zip(self.coordinates, theta, strict=True)]

    def _block_diagonal(self, numbers: Vector) -> Matrix:
        M = np.zeros(self.wires.T.shape)
        for wired in self.stages:
            M[wired.rows[:, None], wired.columns] = wired.stage.matrix(wired.values(numbers))
        return M

    def _feedback_inverse(self, M: Matrix) -> Matrix:
        """Return (I - wires M)^-1."""
        one = np.eye(len(self.wires))
        return np.linalg.inv(one - self.wires @ M) if self.wires.any() else one


# Blocks put on a plant: which signals they join, how all is called, which numbers are free.

Units = TypeVar("Units")


@dataclass(frozen=True, eq=False)
class PlacedBlock:
    """A block whose signals are known.

    Attributes
    ----------
    measurements, controls : tuple of str
    read, driven : ndarray of int
        Where they are among those of the plant.
    sign : {1, -1}
    stages : tuple of Stage
        Sized and named.
    law : str
    """

    measurements: tuple[str, ...]
    controls: tuple[str, ...]
    read: NDArray[np.int_]
    driven: NDArray[np.int_]
    sign: int
    stages: tuple[Stage, ...]
    law: str

    @property
    def carrier(self) -> int:
        """The stage whose gain has units of u over y; the number of stages if there is none."""
        wide = [i for i, stage in enumerate(self.stages) if stage.resizable]
        gains = [i for i, stage in enumerate(self.stages) if stage.carries]
        return (wide or gains or [len(self.stages)])[0]

    def around(self, stage: int, y: Units, u: Units) -> tuple[Units, Units]:
        """Return the units of what enters and what leaves a stage, of those of y and u."""
        if stage == self.carrier:
            return y, u
        return (y, y) if stage < self.carrier else (u, u)


@dataclass(frozen=True)
class FreeParameter:
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
    def numbers(self) -> tuple[FreeParameter, ...]:
        """What is tuned, each number once.

        Raises
        ------
        InvalidInputError
            If a name has several meanings, or nothing is free.
        """
        found: dict[str, FreeParameter] = {}
        for i, j, stage in self.places:
            for slot in stage.slots:
                if slot.held is not None:
                    continue
                key = self.key(stage, slot)
                given = slot.given if isinstance(slot.given, Tunable) else Tunable(key)
                if key in found:
                    found[key] = _merge_shared(found[key], given, slot)
                else:
                    own = _intersect_limits(given, slot, given)
                    found[key] = FreeParameter(key, own, slot, i, j)
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
        if isinstance(slot.given, Tunable):
            return slot.given.name
        return f"{stage.name}.{slot.name}"


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
        for stage in block.stages:
            if stage.name in names:
                want = "a name of its own for every block"
                raise invalid("name", stage.name, want, "Only numbers are shared, by rp.tunable.")
            if stage.name is not None:
                names.add(stage.name)
    placement = Placement(plant, tuple(_placed(block, plant, names) for block in given))
    _refuse_without_effect(placement)
    return placement


def _placed(block: TunableBlock, plant: GeneralizedPlant, names: set[str]) -> PlacedBlock:
    wide = len(block.stages) == 1 and block.stages[0].resizable
    ours = plant.measurement_names, plant.control_names
    read = _chosen("measurement", block.measurements, ours[0], wide)
    driven = _chosen("control", block.controls, ours[1], wide)
    if plant.is_discrete and not all(stage.discrete for stage in block.stages):
        kind = next(stage.kind for stage in block.stages if not stage.discrete)
        raise invalid(
            "plant",
            described(f"a discrete plant, dt = {plant.dt}, for a block of kind {kind}"),
            "a continuous plant",
            "Tune it for the continuous plant, then call design.discretize(period).",
        )
    stages, count = [], len(read)
    for position, stage in enumerate(block.stages):
        last = position == len(block.stages) - 1
        outputs = len(driven) if stage.resizable or last else stage.outputs
        stage = stage.sized(count, outputs)
        if stage.name is None:
            stage = stage.named(_default_name(stage.kind, read, driven, names))
            names.add(stage.name or "")
        count = outputs
        stages.append(stage)
    return PlacedBlock(
        read,
        driven,
        np.array([ours[0].index(name) for name in read]),
        np.array([ours[1].index(name) for name in driven]),
        block.sign,
        tuple(stages),
        block.law(read, driven),
    )


def _chosen(
    argument: str, given: tuple[str, ...] | None, known: Sequence[str], wide: bool
) -> tuple[str, ...]:
    listed = ", ".join(known) or "none"
    if given is None:
        if known and (wide or len(known) == 1):
            return tuple(known)
        shown = described(f"no name, with a plant that has {len(known)}")
        raise invalid(
            argument, shown, f"one of {listed}", "Say which: rp.tunable.pid('x', control='F')."
        )
    for name in given:
        if name not in known:
            raise invalid(argument, name, f"one of {listed}", f"See plant.{argument}_names.")
    return given


def _default_name(kind: str, read: Sequence[str], driven: Sequence[str], names: set[str]) -> str:
    name = f"{kind}_{read[0]}" if len(read) == 1 else kind
    if name in names and len(driven) == 1:
        name = f"{name}_{driven[0]}"
    count, free = 2, name
    while free in names:
        free, count = f"{name}_{count}", count + 1
    return free


def _refuse_without_effect(placement: Placement) -> None:
    P = placement.plant
    seen = np.any(np.hstack([P.C2, P.D21, P.D22]) != 0, axis=1)
    moves = np.any(np.vstack([P.B2, P.D12, P.D22]) != 0, axis=0)
    for block in placement.blocks:
        if not seen[block.read].any():
            text = f"a block that reads {', '.join(block.measurements)}, which is always zero"
        elif not moves[block.driven].any():
            text = f"a block that drives {', '.join(block.controls)}, which moves nothing"
        else:
            continue
        raise invalid("blocks", described(text), "blocks with an effect", "Leave it out.")


def _intersect_limits(given: Tunable, slot: ParameterSlot, spoken: Tunable) -> Tunable:
    """Return a tunable number with the limits that its slot has besides."""
    low, high = max(given.low, slot.low), min(given.high, slot.high)
    if not low < high:
        shown = described(f"{spoken.name} between {spoken.low:g} and {spoken.high:g}")
        want = f"limits that a {slot.name} can keep"
        raise invalid(slot.name, shown, want, "Change its limits.")
    return replace(given, low=low, high=high)


def _merge_shared(known: FreeParameter, given: Tunable, slot: ParameterSlot) -> FreeParameter:
    """Return a number that one more slot takes.

    Raises
    ------
    InvalidInputError
        If it was told otherwise there.
    """
    first = known.slot.given
    if first != given:
        shown = described(f"{first} and {given}")
        remedy = "Make it once with rp.tunable.tunable, and pass the same object to all blocks."
        raise invalid("blocks", shown, f"one meaning of {known.key}", remedy)
    positive = "positive" if "positive" in (known.slot.search, slot.search) else known.slot.search
    both = replace(known.slot, search=positive)
    return replace(known, tunable=_intersect_limits(known.tunable, slot, given), slot=both)


# Units that suit a loop: frequencies at which it may cross over, and gains that do it there.

# A mode counts if its part of the response from u to y is not below this share of the largest:
# the modes of weights and of what nobody measures do not belong to the loop.
_VISIBLE = 1e-9
# How far beyond the modes of the plant a loop may cross over.
_BELOW, _ABOVE = 30.0, 10.0


@dataclass(frozen=True, eq=False)
class LoopUnits:
    """What numbers of blocks are measured by.

    Attributes
    ----------
    plant : PlantMatrices
        Scaled, continuous.
    frequency : float
        In rad/s of the scaled plant; 0 for the middle of :attr:`band`.
    """

    plant: PlantMatrices
    frequency: float = 0.0

    @cached_property
    def band(self) -> tuple[float, float]:
        """The lowest and the highest frequency at which the loop may cross over."""
        P = self.plant
        if not P.nx:
            return 1 / _BELOW, _ABOVE
        found = np.linalg.eig(P.A)
        poles, right = np.asarray(found[0]), np.asarray(found[1])
        left = np.linalg.pinv(right)
        part = np.linalg.norm(left @ P.B2, axis=1) * np.linalg.norm(P.C2 @ right, axis=0)
        size = np.abs(poles)
        kept = (part > _VISIBLE * part.max()) & (size > 1e-6 * size.max(initial=0.0))
        if not kept.any():
            return 1 / _BELOW, _ABOVE
        return float(size[kept].min()) / _BELOW, float(size[kept].max()) * _ABOVE

    @property
    def middle(self) -> float:
        """The frequency that sizes belong to."""
        return self.frequency or float(np.sqrt(self.band[0] * self.band[1]))

    @cached_property
    def response(self) -> Matrix:
        """The response from u to y there."""
        P = self.plant
        pencil = 1j * self.middle * np.eye(P.nx) - P.A
        try:
            return np.abs(P.C2 @ np.linalg.solve(pencil, P.B2) + P.D22)
        except np.linalg.LinAlgError:
            return np.ones((P.ny, P.nu))

    def size(self, block: PlacedBlock, stage: int, slot: ParameterSlot) -> float:
        """Return the number that matters in the loop at that frequency, in scaled units."""
        rate = self.middle ** (-slot.time)
        if slot.out is None or stage != block.carrier:
            return rate
        gain = float(np.linalg.norm(self.response[block.read[:, None], block.driven]))
        return rate / gain if gain > 0 else rate


# A placement in the units of a scaled plant: its numbers as coordinates, its stages wired.


def block_parametrisation(
    placement: Placement, scaled: ScaledPlant, loop: LoopUnits | None = None
) -> BlockGain:
    """Return K of the scaled plant as a function of the free numbers.

    Parameters
    ----------
    placement : Placement
    scaled : ScaledPlant
        Of the placement's plant.
    loop : LoopUnits, optional
        What the numbers are measured by; the entries of K are of order one by default.

    Returns
    -------
    BlockGain
    """
    index = {number.key: i for i, number in enumerate(placement.numbers)}
    coordinates = tuple(_parameter_transform(n, placement, scaled, loop) for n in placement.numbers)
    stages = [stage for _, _, stage in placement.places]
    order = sum(len(stage.states) for stage in stages)
    outs, ins = order + sum(s.outputs for s in stages), order + sum(s.inputs for s in stages)
    enter, wires = np.zeros((ins, order + scaled.original.ny)), np.zeros((ins, outs))
    leave = np.zeros((order + scaled.original.nu, outs))
    for M in (enter, leave):
        M[:order, :order] = np.eye(order)
    found: list[WiredStage] = []
    state, row, column = 0, order, order
    for i, j, stage in placement.places:
        block, n = placement.blocks[i], len(stage.states)
        own = np.arange(state, state + n)
        rows, columns = row + np.arange(stage.outputs), column + np.arange(stage.inputs)
        into, out = _units(placement, scaled, i, j)
        sizes = np.array([slot.size(into, out, scaled.time) for slot in stage.slots])
        held = [0.0 if slot.held is None else slot.held for slot in stage.slots]
        numbers = [index[placement.key(stage, s)] if s.held is None else -1 for s in stage.slots]
        found.append(
            WiredStage(
                stage.in_unit_of_time(scaled.time),
                np.array(numbers, dtype=int),
                np.array(held) / sizes,
                sizes,
                np.concatenate([own, rows]),
                np.concatenate([own, columns]),
            )
        )
        if j == 0:
            enter[columns, order + block.read] = 1.0
        else:
            wires[columns, found[-2].rows[-stage.inputs :]] = 1.0
        if j == len(block.stages) - 1:
            kept = block.carrier == len(block.stages)
            unit = scaled.measurement[block.read] / scaled.control[block.driven] if kept else 1.0
            leave[order + block.driven, rows] = block.sign * unit
        state, row, column = state + n, row + stage.outputs, column + stage.inputs
    return BlockGain(coordinates, tuple(found), enter, wires, leave)


def _parameter_transform(
    number: FreeParameter, placement: Placement, scaled: ScaledPlant, loop: LoopUnits | None
) -> ParameterTransform:
    into, out = _units(placement, scaled, number.block, number.stage)
    size = number.slot.size(into, out, scaled.time)
    if loop is not None:
        size *= loop.size(placement.blocks[number.block], number.stage, number.slot)
    low, high = number.tunable.low, number.tunable.high
    if low > 0 or number.slot.search == "positive":
        return ParameterTransform(size, max(low, 0.0), high, "positive")
    # A narrow range is searched in its own size.
    if number.slot.search == "linear" and math.isfinite(low) and math.isfinite(high):
        size = min(size, high - low)
    return ParameterTransform(size, low, high, number.slot.search)


def _units(
    placement: Placement, scaled: ScaledPlant, block: int, stage: int
) -> tuple[list[float], list[float]]:
    """Return the units of what enters and leaves a stage."""
    placed = placement.blocks[block]
    y, u = scaled.measurement[placed.read], scaled.control[placed.driven]
    return placed.around(stage, y.tolist(), u.tolist())
