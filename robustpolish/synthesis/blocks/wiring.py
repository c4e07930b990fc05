"""A placement in the units of a scaled plant: its numbers as coordinates, its stages wired."""

from __future__ import annotations

import math

import numpy as np

from robustpolish.synthesis.blocks.block_gain import BlockGain, WiredStage
from robustpolish.synthesis.blocks.coordinate import Coordinate
from robustpolish.synthesis.blocks.loop_units import LoopUnits
from robustpolish.synthesis.blocks.placement import FreeNumber, Placement
from robustpolish.synthesis.problem.scaling import ScaledPlant


def wired(placement: Placement, scaled: ScaledPlant, loop: LoopUnits | None = None) -> BlockGain:
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
    coordinates = tuple(_coordinate(n, placement, scaled, loop) for n in placement.numbers)
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
                stage.in_time(scaled.time),
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


def _coordinate(
    number: FreeNumber, placement: Placement, scaled: ScaledPlant, loop: LoopUnits | None
) -> Coordinate:
    into, out = _units(placement, scaled, number.block, number.stage)
    size = number.slot.size(into, out, scaled.time)
    if loop is not None:
        size *= loop.size(placement.blocks[number.block], number.stage, number.slot)
    low, high = number.tunable.low, number.tunable.high
    if low > 0 or number.slot.search == "positive":
        return Coordinate(size, max(low, 0.0), high, "positive")
    # A narrow range is searched in its own size.
    if number.slot.search == "linear" and math.isfinite(low) and math.isfinite(high):
        size = min(size, high - low)
    return Coordinate(size, low, high, number.slot.search)


def _units(
    placement: Placement, scaled: ScaledPlant, block: int, stage: int
) -> tuple[list[float], list[float]]:
    """Return the units of what enters and leaves a stage."""
    placed = placement.blocks[block]
    y, u = scaled.measurement[placed.read], scaled.control[placed.driven]
    return placed.around(stage, y.tolist(), u.tolist())
