"""The structure of an uncertain matrix Delta: which blocks lie on its diagonal."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from robustpolish.models.uncertain.elements import Block, RealElement
from robustpolish.validation import described, invalid

Kind = Literal["real", "complex", "full"]

_FORMS = '"real", "complex", ("real", copies), ("complex", copies), ("full", (rows, columns))'


@dataclass(frozen=True)
class DeltaBlock:
    """A block of Delta: so many equal copies of a number or of a full matrix.

    Attributes
    ----------
    kind : {"real", "complex", "full"}
        A real number, a complex number, or a full complex matrix.
    copies : int
    rows, columns : int
        Of one copy.
    name : str
    group : str
        Real numbers of one group, if it is not empty, have squares whose sum is at most 1; each
        counts once, however often it is repeated.
    """

    kind: Kind
    copies: int = 1
    rows: int = 1
    columns: int = 1
    name: str = ""
    group: str = ""

    @property
    def is_scalar(self) -> bool:
        """Whether one copy is a number."""
        return self.rows == self.columns == 1


@dataclass(frozen=True)
class Structure:
    """The blocks of Delta in their order, and the signals of each.

    Attributes
    ----------
    blocks : tuple of DeltaBlock
    """

    blocks: tuple[DeltaBlock, ...]

    @cached_property
    def outputs(self) -> tuple[slice, ...]:
        """Of each block, where its outputs w are: rows of Delta, columns of M."""
        return _slices([block.copies * block.rows for block in self.blocks])

    @cached_property
    def inputs(self) -> tuple[slice, ...]:
        """Of each block, where its inputs z are: columns of Delta, rows of M."""
        return _slices([block.copies * block.columns for block in self.blocks])

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of M: inputs z by outputs w."""
        return (
            sum(block.copies * block.columns for block in self.blocks),
            sum(block.copies * block.rows for block in self.blocks),
        )

    @cached_property
    def together(self) -> tuple[tuple[int, ...], ...]:
        """Positions of the blocks whose sizes count as one, the root of the sum of squares."""
        names = dict.fromkeys(block.group for block in self.blocks if block.group)
        return tuple(
            tuple(k for k, block in enumerate(self.blocks) if block.group == name) for name in names
        )

    def sizes(self, norms: Sequence[float]) -> list[float]:
        """Return the norms of the blocks, with that of its group for each that has one."""
        found = list(norms)
        for group in self.together:
            size = math.hypot(*(norms[k] for k in group))
            for k in group:
                found[k] = size
        return found

    def only(self, keep: Sequence[int]) -> Structure:
        """Return the structure of some of the blocks."""
        return Structure(tuple(self.blocks[i] for i in keep))


def structure_of(blocks: Iterable[Block]) -> Structure:
    """Return the structure of an uncertain system: dynamics are full blocks, or complex numbers."""
    found = []
    for block in blocks:
        element = block.element
        rows, columns = element.shape
        kind: Kind = "real" if element.kind == "real" else "complex"
        if element.kind == "dynamic" and (rows, columns) != (1, 1):
            kind = "full"
        group = element.group if isinstance(element, RealElement) else ""
        found.append(DeltaBlock(kind, block.copies, rows, columns, element.name, group))
    return Structure(tuple(found))


def read_structure(blocks: Any) -> Structure:
    """Return the structure that a user wrote.

    Parameters
    ----------
    blocks : sequence
        Of ``"real"``, ``("complex", copies)``, ``("full", (rows, columns))``, of pairs of numbers
        as MATLAB's ``mussv`` takes them, or of an uncertain system's blocks.

    Returns
    -------
    Structure
    """
    if isinstance(blocks, str) or not hasattr(blocks, "__iter__"):
        raise invalid("blocks", blocks, "a list of blocks", f"Write a list of {_FORMS}.")
    items = list(blocks)
    if not items:
        raise invalid("blocks", items, "at least one block", f"Write a list of {_FORMS}.")
    if all(isinstance(item, Block) for item in items):
        return structure_of(items)
    return Structure(tuple(_block(i, item) for i, item in enumerate(items)))


def _block(i: int, item: Any) -> DeltaBlock:
    where = ("blocks", i)
    if isinstance(item, DeltaBlock):
        return item
    if isinstance(item, str):
        item = (item, 1)
    if not hasattr(item, "__len__") or len(item) != 2:
        raise invalid(where, item, f"one of {_FORMS}", "Write the block in one of these forms.")
    first, second = item[0], item[1]
    if first in ("real", "complex") and isinstance(first, str):
        return DeltaBlock(first, _whole(where, second), name=f"{first}_{i}")  # type: ignore
    if isinstance(first, str) and first == "full":
        sizes = (second, second) if isinstance(second, int | np.integer) else second
        if not hasattr(sizes, "__len__") or len(sizes) != 2:
            raise invalid(where, item, '("full", (rows, columns))', "Give both sizes.")
        rows, columns = (_whole(where, size) for size in sizes)
        return _full(rows, columns, i)
    if isinstance(first, str):
        raise invalid(where, first, '"real", "complex" or "full"', "Choose one of these.")
    rows, columns = _any_whole(where, first), _any_whole(where, second)
    if rows < 0 and columns in (0, 1):
        return DeltaBlock("real", -rows, name=f"real_{i}")
    if rows > 0 and columns == 0:
        return DeltaBlock("complex", rows, name=f"complex_{i}")
    if rows > 0 and columns > 0:
        return _full(rows, columns, i)
    remedy = "Write [-r, 0] for r copies of a real, [r, 0] of a complex number, [r, c] for a full."
    raise invalid(where, item, f"one of {_FORMS}", remedy)


def _full(rows: int, columns: int, i: int) -> DeltaBlock:
    kind: Kind = "complex" if rows == columns == 1 else "full"
    return DeltaBlock(kind, 1, rows, columns, f"{kind}_{i}")


def _whole(where: tuple[str, int], value: Any) -> int:
    number = _any_whole(where, value)
    if number < 1:
        raise invalid(where, value, "a whole number above 0", "Give its number of copies or size.")
    return number


def _any_whole(where: tuple[str, int], value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer | float):
        raise invalid(where, value, "a whole number", f"Write {_FORMS}.")
    if float(value) != int(value):
        raise invalid(where, value, "a whole number", f"Write {_FORMS}.")
    return int(value)


def positions(places: Sequence[slice], blocks: Iterable[int]) -> list[int]:
    """Return the signals of some blocks one by one, of `outputs` or `inputs` of a structure."""
    return [i for k in blocks for i in range(places[k].start, places[k].stop)]


def _slices(sizes: Sequence[int]) -> tuple[slice, ...]:
    ends = np.cumsum([0, *sizes]).tolist()
    return tuple(slice(a, b) for a, b in pairwise(ends))


def fitting(M_shape: tuple[int, int], structure: Structure) -> None:
    """Refuse a matrix of another shape than the blocks need."""
    if M_shape != structure.shape:
        shown = described(f"blocks for M of shape {structure.shape}, and M of {M_shape}")
        remedy = "A block of r rows and c columns takes c rows and r columns of M."
        raise invalid("blocks", shown, "blocks that fit M", remedy)
