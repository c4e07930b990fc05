"""What tuned blocks have become: numbers by name, with units and limits."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from robustpolish.display import Card, Displayed, Table


@dataclass(frozen=True)
class TunedNumber:
    """A number of a block after the search.

    Attributes
    ----------
    name : str
        What it is in its block, such as "Kp".
    value : float
    unit : str
        From the units of the plant; empty where they are unknown.
    key : str
        Its name among all numbers: that of a shared number, or ``pid_x.Kp``.
    low, high : float
        Its limits.
    tuned : bool
        False if it was held.

    Examples
    --------
    >>> import robustpolish as rp
    >>> number = rp.TunedNumber("Kp", 3.0, "N/m", "pid_x.Kp", 0.0, 3.0, True)
    >>> print(number, number.fate, sep=", ")
    Kp = 3 N/m, at its limit
    """

    name: str
    value: float
    unit: str
    key: str
    low: float
    high: float
    tuned: bool

    @property
    def at_limit(self) -> bool:
        """Whether the search left it at one of its limits."""
        return self.tuned and any(
            abs(self.value - limit) <= 1e-6 * max(abs(self.value), abs(limit))
            for limit in (self.low, self.high)
            if math.isfinite(limit)
        )

    @property
    def called(self) -> str:
        """Its name, with that under which it is shared."""
        own = self.key == self.name or self.key.endswith(f".{self.name}")
        return self.name if own else f"{self.name} = {self.key}"

    @property
    def fate(self) -> str:
        """What the search did with it, in words."""
        return "held" if not self.tuned else "at its limit" if self.at_limit else "tuned"

    def __str__(self) -> str:
        return f"{self.name} = {self.value:.6g} {self.unit}".rstrip()


@dataclass(frozen=True)
class TunedBlock:
    """A block after the search; its numbers by name, ``block["Kp"]``.

    Attributes
    ----------
    name : str
    formula : str
        Its transfer function in words.
    numbers : tuple of TunedNumber

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    >>> gain = rp.tunable("k", 2.0, low=0.0, high=3.0)
    >>> design = rp.structured_output_feedback(plant, [rp.pid(kind="P", Kp=gain, sign=-1)])
    >>> block = design.details["blocks"]["pid_y1"]
    >>> print(block)
    pid_y1: Kp, with Kp = 3
    >>> block["Kp"]
    3.0
    """

    name: str
    formula: str
    numbers: tuple[TunedNumber, ...]

    def __getitem__(self, name: str) -> float:
        for number in self.numbers:
            if number.name == name:
                return number.value
        raise KeyError(name)

    def __str__(self) -> str:
        numbers = ", ".join(str(number) for number in self.numbers)
        return f"{self.name}: {self.formula}" + (f", with {numbers}" if numbers else "")


@dataclass(frozen=True, eq=False, repr=False)
class TunedBlocks(Mapping[str, TunedBlock], Displayed):
    """All blocks of a controller by name, and what it computes.

    Attributes
    ----------
    blocks : tuple of TunedBlock
    laws : tuple of str
        One for each series of blocks, such as ``F = -(Kp + Ki/s) x``.
    """

    blocks: tuple[TunedBlock, ...]
    laws: tuple[str, ...]

    def __getitem__(self, name: str) -> TunedBlock:
        for block in self.blocks:
            if block.name == name:
                return block
        raise KeyError(name)

    def __iter__(self) -> Iterator[str]:
        return (block.name for block in self.blocks)

    def __len__(self) -> int:
        return len(self.blocks)

    @property
    def numbers(self) -> dict[str, float]:
        """Values of what was tuned, by name; what ``initial=`` takes."""
        return {n.key: n.value for b in self.blocks for n in b.numbers if n.tuned}

    def content(self) -> dict[str, Any]:
        """Return what is written to a file."""
        return {
            "laws": list(self.laws),
            "blocks": [
                {
                    "name": block.name,
                    "formula": block.formula,
                    # Infinities have no place in JSON: a limit that is none is left out.
                    "numbers": [
                        {k: v for k, v in vars(number).items() if v not in (math.inf, -math.inf)}
                        for number in block.numbers
                    ],
                }
                for block in self.blocks
            ],
        }

    @classmethod
    def of_content(cls, content: Any) -> TunedBlocks:
        """Return what :meth:`content` wrote.

        Raises
        ------
        TypeError, ValueError, KeyError
            If it is not what that writes.
        """
        limits = {"low": -math.inf, "high": math.inf}
        blocks = [
            TunedBlock(
                str(block["name"]),
                str(block["formula"]),
                tuple(TunedNumber(**{**limits, **number}) for number in block["numbers"]),
            )
            for block in content["blocks"]
        ]
        return cls(tuple(blocks), tuple(map(str, content["laws"])))

    def tables(self) -> tuple[Table, ...]:
        """Return the numbers of blocks that have few in a table; none for free state spaces."""
        rows = [
            (block.name, number.called, number.value, number.unit, number.fate)
            for block in self.blocks
            if len(block.numbers) <= _MOST
            for number in block.numbers
        ]
        head = ("block", "number", "value", "unit", "")
        return (Table("Blocks", head, tuple(rows), digits=6),) if rows else ()

    def _card(self) -> Card:
        return Card("", self.tables(), self.laws)


# Blocks with more numbers than these show none.
_MOST = 12
