"""Tunable blocks on a plant: signals, shared numbers, the controller, and where searches start."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import islice
from typing import Any, ClassVar, NamedTuple

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import AnyVector as Vector
from robustpolish.base.budget import Budget
from robustpolish.base.checks import described, instance_of, invalid
from robustpolish.errors import InfeasibleError
from robustpolish.linear.systems import named_system
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.certificate import Norm
from robustpolish.synthesis.nonsmooth.descent import Bounds, ReflectedParametrisation
from robustpolish.synthesis.problem import matrices
from robustpolish.synthesis.problem.preflight import PlantPart, ScaledPlant
from robustpolish.synthesis.structured import starts
from robustpolish.synthesis.structured.block_parts import (
    ParameterSlot,
    ParameterTransform,
    Stage,
    Tunable,
    TunableBlock,
    TunedBlock,
    TunedBlocks,
    TunedNumber,
)
from robustpolish.synthesis.structured.search import (
    ControllerStructure,
    Designs,
    Joined,
    PartProblem,
    SearchEffort,
    StartProposal,
    drawn_starts,
    scaled_part,
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


def crossover_band(plant: matrices.PlantMatrices) -> tuple[float, float]:
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


def crossover_size(plant: matrices.PlantMatrices, frequency: float) -> LoopSize:
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


# Gains of a first guess, where 1 makes the loop cross over: low, so that a stable plant stays so.
_LOW = 0.1
# Scatter of drawn numbers, in natural logarithms, and how often a gain has another sign than the
# others of its block.
_SCATTER, _ODD = 1.0, 0.15


# Scatter of the entries of a K that is free, in decimal logarithms, as of static feedback.
_WIDE = (-1.5, 1.5)


@dataclass(frozen=True, eq=False)
class BlockStructure(ControllerStructure):
    """Tunable blocks between measurements and controls of the whole plant.

    Attributes
    ----------
    norm : {"hinf", "h2"}
    placement : Placement
    gain_bound : float or None
    initial : mapping of str to float
        Where to start, by the names of numbers.
    """

    norm: Norm
    placement: Placement
    gain_bound: float | None = None
    initial: Mapping[str, float] = field(default_factory=dict)
    method: ClassVar[str] = "blocks"

    def problem(self, part: PlantPart) -> PartProblem | None:
        """State the search over the numbers."""
        placement, what = self.placement, "choice of the blocks' numbers"
        scaled, inner = scaled_part(part.plant, what, placement.mask)
        search = self._search_of_entries if _entries_alone(placement) else self._search_of_numbers
        gain, bounds, proposals, rest = search(scaled, inner)
        order = len(gain.leave) - part.plant.nu
        loop = matrices.augmented(inner, order)
        rng = np.random.default_rng(0)
        drawn = (
            proposals[-1](Budget(), rng)
            if rest is None
            else drawn_starts(_WIDE, [rest], False, rng)
        )
        _refuse_unstabilisable(placement, gain, loop, drawn, self.norm)
        return PartProblem(
            scaled=scaled,
            norm=self.norm,
            order=order,
            parametrisation=gain,
            starts=proposals,
            scatter=None if rest is None else _WIDE,
            rest=rest,
            what=what,
            gain_bound=self.gain_bound,
            bounds=bounds,
            # Blocks have few numbers, and their descents mostly agree.
            effort=SearchEffort(descents=60, fewest=5, patience=12),
            advice="Look whether limits force signs (u = K y: sign=-1 is negative feedback), free "
            "more numbers",
        )

    def _search_of_entries(
        self, scaled: ScaledPlant, inner: matrices.PlantMatrices
    ) -> tuple[BlockGain, None, tuple[StartProposal, ...], Vector]:
        """Return K of the numbers, and the starts of a static or fixed-order feedback."""
        gain, numbers = block_parametrisation(self.placement, scaled), self.placement.numbers
        rest = np.array([0.0 if inner.discrete else n.slot.default for n in numbers])
        given = [self.initial.get(n.key) for n in numbers]
        pairs = zip(given, gain.coordinates, rest, strict=True)
        first = np.array([r if v is None else c.theta(v) for v, c, r in pairs])
        loop = matrices.augmented(inner, len(gain.leave) - inner.nu)
        mask = gain.gain(np.ones(gain.size)) != 0
        # Each number is one entry of K, so that the adjoint is the inverse.
        coordinates = partial(gain.back, np.zeros(gain.size))
        proposals = (
            partial(starts.known, [first]),
            partial(starts.stabilising, loop, mask, coordinates),
            partial(starts.regulator, loop, mask, coordinates),
        )
        return gain, None, proposals, rest

    def _search_of_numbers(
        self, scaled: ScaledPlant, inner: matrices.PlantMatrices
    ) -> tuple[BlockGain, Bounds, tuple[StartProposal, ...], None]:
        """Return K of the numbers, their limits, and guesses for a crossover of the loop."""
        placement, initial, band = self.placement, self.initial, crossover_band(inner)
        middle = crossover_size(inner, float(np.sqrt(band[0] * band[1])))
        gain = block_parametrisation(placement, scaled, middle)

        def guess(units: LoopSize, share: float, rng: np.random.Generator | None) -> Vector:
            signs = np.ones(len(placement.blocks))
            if rng is not None:
                signs = rng.choice([-1.0, 1.0], len(signs))
            # Numbers that were given are kept in half of the draws.
            keep = rng is None or rng.random() < 0.5
            there = block_parametrisation(placement, scaled, units).coordinates
            theta = []
            for number, own, size in zip(placement.numbers, gain.coordinates, there, strict=True):
                scatter = 0.0 if rng is None else rng.normal() * _SCATTER
                given = initial.get(number.key, number.tunable.value)
                if given is not None and keep:
                    odd = 0.0 if own.search == "linear" else 0.3 * scatter
                    theta.append(own.theta(given) + odd)
                    continue
                if number.slot.default:
                    value = number.slot.default * size.size * math.exp(scatter)
                else:
                    value = share * signs[number.block] * size.size * math.exp(scatter)
                    if rng is not None and rng.random() < _ODD:
                        value = -value
                theta.append(_within_limits(own, value))
            return np.array(theta)

        first = guess(middle, _LOW, None)
        low, high = np.array([c.bounds(t) for c, t in zip(gain.coordinates, first, strict=True)]).T
        folded = ReflectedParametrisation(gain, (low, high))

        def propose(budget: Budget, rng: np.random.Generator) -> Iterator[Vector]:
            yield first
            while True:
                crossover = float(np.exp(rng.uniform(*np.log(band))))
                yield folded.point(guess(crossover_size(inner, crossover), 1.0, rng))

        return gain, (low, high), (propose,), None

    def join(self, plant: GeneralizedPlant, parts: Sequence[PlantPart], designs: Designs) -> Joined:
        """Return the controller with named states, and the blocks with their numbers."""
        (found,) = designs
        assert found is not None
        gain: Any = found.part.parametrisation
        numbers = zip(self.placement.numbers, gain.coordinates, found.point, strict=True)
        idle = tuple(number.key for number, c, theta in numbers if c.idle(theta))
        controller = _controller(plant, self.placement, gain.gain(found.point), found.part.scaled)
        blocks = _tuned(self.placement, gain.numbers(found.point))
        return controller, {"blocks": blocks, "idle_integrals": idle}


def _within_limits(coordinate: ParameterTransform, value: float) -> float:
    """Return the coordinate of a number, or of one that its limits allow."""
    low, high = coordinate.low, coordinate.high
    if not low < value < high:
        value = min(max(-value, low), high)
    if value in (low, high):
        if math.isfinite(low) and math.isfinite(high):
            value = math.sqrt(low * high) if low > 0 else 0.5 * (low + high)
        elif coordinate.search == "positive":
            value = 2 * low if math.isfinite(low) and low > 0 else 0.5 * high
    return coordinate.theta(value)


def _entries_alone(placement: Placement) -> bool:
    """Whether K itself is free but for its zeros."""
    joined = np.zeros(placement.mask.shape)
    for block in placement.blocks:
        (stage, *more) = block.stages
        if more or not stage.resizable or any(slot.given is not None for slot in stage.slots):
            return False
        joined[block.driven[:, None], block.read] += 1
    return bool((joined <= 1).all())


# A mode that stays within this share of the state matrix of 0, whatever the numbers, is stuck.
_STUCK = 1e-11
_TRIES = 5


def _refuse_unstabilisable(
    placement: Placement,
    gain: BlockGain,
    loop: matrices.PlantMatrices,
    drawn: Iterator[Vector],
    norm: Norm,
) -> None:
    """Refuse integrators that no number stabilises, and feedthroughs that no H2 norm has."""
    names, at = _integrators(placement)
    stuck, always, tried = set(names), True, 0
    for theta in islice(drawn, 1, 4 * _TRIES):
        closed = matrices.close_static_loop(loop, gain.gain(theta))
        if closed is None:
            continue
        tried += 1
        always &= bool(np.abs(closed.D).max(initial=0.0) > 0)
        stuck &= {names[i] for i in np.flatnonzero(_integrators_at_zero(closed.A, at))}
        if tried == _TRIES:
            break
    if stuck and tried:
        listed = " and ".join(sorted(stuck))
        raise InfeasibleError(
            f"No numbers stabilise the integrators of {listed}: the loop keeps a mode at 0. Either "
            "the plant passes nothing constant from control to measurement (a zero at 0), or there "
            "are more integrators than controls or measurements tell apart. Leave one out "
            "(kind='PD' or 'P').",
            [0j],
        )
    if norm == "h2" and not loop.discrete and always and tried:
        through = "The plant passes w straight to z (D11)" if loop.D11.any() else ""
        blocks = "The blocks pass the noise of w straight on to z"
        raise InfeasibleError(
            f"The H2 norm is infinite whatever the numbers. {through or blocks}. "
            "Put rp.tunable.low_pass() in series with the blocks "
            "or choose fixed_order(feedthrough=False), "
            "filter disturbances that reach z directly, or use norm='hinf'."
        )


def _integrators_at_zero(A: Matrix, integrators: Sequence[int]) -> NDArray[np.bool_]:
    """Tell which integrators take part in a mode of the loop at 0."""
    if len(A) and integrators:
        values, vectors = np.linalg.eig(A)
        mode = int(np.argmin(np.abs(values)))
        if abs(values[mode]) <= _STUCK * np.linalg.norm(A, 2):
            return np.abs(vectors[:, mode])[integrators] > 1e-6
    return np.zeros(len(integrators), bool)


def _integrators(placement: Placement) -> tuple[list[str], list[int]]:
    """Return the names of stages that integrate, and where their integrals stand from the end."""
    labels = [
        (stage.name or stage.kind, x) for _, _, stage in placement.places for x in stage.states
    ]
    at = [i for i, (_, label) in enumerate(labels) if label == "integral"]
    return [labels[i][0] for i in at], [i - len(labels) for i in at]


def _controller(
    plant: GeneralizedPlant, placement: Placement, K: Matrix, scaled: ScaledPlant
) -> control.StateSpace:
    own = scaled.controller(matrices.controller_from_matrix(K, len(K) - plant.nu))
    states = [f"{stage.name}.{label}" for _, _, stage in placement.places for label in stage.states]
    names = (plant.measurement_names, plant.control_names, states)
    return named_system(own, plant.dt, *names)


def _tuned(placement: Placement, values: Vector) -> TunedBlocks:
    free = {n.key: (n.tunable, float(v)) for n, v in zip(placement.numbers, values, strict=True)}
    units, found = placement.plant.units, []
    for i, j, stage in placement.places:
        block = placement.blocks[i]
        y = [units.get(name, "") for name in block.measurements]
        u = [units.get(name, "") for name in block.controls]
        numbers = []
        for slot in stage.slots:
            key, unit = placement.key(stage, slot), slot.unit(*block.around(j, y, u))
            if slot.held is None:
                number, value = free[key]
                limits = number.low, number.high
            else:
                value, limits = slot.held, (slot.held, slot.held)
            tuned = slot.held is None
            numbers.append(TunedNumber(slot.name, value, unit, key, *limits, tuned))
        found.append(TunedBlock(stage.name or stage.kind, stage.formula, tuple(numbers)))
    return TunedBlocks(
        tuple(found), tuple(b.law(b.measurements, b.controls) for b in placement.blocks)
    )
