"""Blocks put on a plant: which signals they join, how all is called, which numbers are free."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.blocks.block import TunableBlock
from robustpolish.synthesis.blocks.slot import Slot
from robustpolish.synthesis.blocks.stage import Stage
from robustpolish.synthesis.blocks.tunable import Tunable
from robustpolish.validation import described, instance_of, invalid

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
class FreeNumber:
    """A number that is tuned, whoever shares it.

    Attributes
    ----------
    key : str
        Its name, or block and slot.
    tunable : Tunable
        Start and limits, those of its slots included.
    slot : Slot
        The first one that takes it.
    block, stage : int
        Where that is.
    """

    key: str
    tunable: Tunable
    slot: Slot
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
    def numbers(self) -> tuple[FreeNumber, ...]:
        """What is tuned, each number once.

        Raises
        ------
        InvalidInputError
            If a name has several meanings, or nothing is free.
        """
        found: dict[str, FreeNumber] = {}
        for i, j, stage in self.places:
            for slot in stage.slots:
                if slot.held is not None:
                    continue
                key = self.key(stage, slot)
                given = slot.given if isinstance(slot.given, Tunable) else Tunable(key)
                if key in found:
                    found[key] = _shared(found[key], given, slot)
                else:
                    own = _within(given, slot, given)
                    found[key] = FreeNumber(key, own, slot, i, j)
        if not found:
            raise invalid(
                "blocks",
                described("blocks all of whose numbers are held"),
                "a number to be tuned",
                "Leave one out, or certify the controller with rp.given_controller.",
            )
        return tuple(found.values())

    @staticmethod
    def key(stage: Stage, slot: Slot) -> str:
        """Return what a number is called among all of them."""
        if isinstance(slot.given, Tunable):
            return slot.given.name
        return f"{stage.name}.{slot.name}"


def placed(blocks: Any, plant: GeneralizedPlant) -> Placement:
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
    remedy = "Pass a list, such as [rp.pid('x', control='F')]."
    try:
        given = [blocks] if isinstance(blocks, TunableBlock) else list(blocks)
    except TypeError:
        raise invalid("blocks", blocks, "blocks to be tuned", remedy) from None
    if not given:
        raise invalid("blocks", blocks, "at least one block", remedy)
    names: set[str] = set()
    for block in given:
        instance_of("blocks", block, TunableBlock, "a block, such as rp.pid('x')", remedy)
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
            stage = stage.named(_own_name(stage.kind, read, driven, names))
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
        raise invalid(argument, shown, f"one of {listed}", "Say which: rp.pid('x', control='F').")
    for name in given:
        if name not in known:
            raise invalid(argument, name, f"one of {listed}", f"See plant.{argument}_names.")
    return given


def _own_name(kind: str, read: Sequence[str], driven: Sequence[str], names: set[str]) -> str:
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


def _within(given: Tunable, slot: Slot, spoken: Tunable) -> Tunable:
    """Return a tunable number with the limits that its slot has besides."""
    low, high = max(given.low, slot.low), min(given.high, slot.high)
    if not low < high:
        shown = described(f"{spoken.name} between {spoken.low:g} and {spoken.high:g}")
        want = f"limits that a {slot.name} can keep"
        raise invalid(slot.name, shown, want, "Change its limits.")
    return replace(given, low=low, high=high)


def _shared(known: FreeNumber, given: Tunable, slot: Slot) -> FreeNumber:
    """Return a number that one more slot takes.

    Raises
    ------
    InvalidInputError
        If it was told otherwise there.
    """
    first = known.slot.given
    if first != given:
        shown = described(f"{first} and {given}")
        remedy = "Make it once with rp.tunable, and pass the same object to all blocks."
        raise invalid("blocks", shown, f"one meaning of {known.key}", remedy)
    positive = "positive" if "positive" in (known.slot.search, slot.search) else known.slot.search
    both = replace(known.slot, search=positive)
    return replace(known, tunable=_within(known.tunable, slot, given), slot=both)
