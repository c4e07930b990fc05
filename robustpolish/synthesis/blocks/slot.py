"""A number of a block: what it is, its unit, where it may lie, and what the user made of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from robustpolish.synthesis.blocks.tunable import Tunable
from robustpolish.validation import described, invalid

Given = Tunable | float | None


@dataclass(frozen=True)
class Slot:
    """A place for a number in a block.

    Attributes
    ----------
    name : str
        Such as "Kp".
    given : Tunable, float or None
        A number that is held, one that is tuned with a name and limits, or one that is tuned.
    time : int
        Power of the unit of time in its unit.
    out, into : int or None
        Output and input of the block whose units it has, above and below the bar.
    low, high : float
        Between which it makes sense; 0 as a lower limit of a positive number is excluded.
    default : float
        Where the search starts, in units of order one for the plant.
    search : {"linear", "positive", "integral"}
        Positive numbers are searched over their logarithm. Gains of integrators change sign, but
        where a norm wants none of them they approach 0, at which the loop loses its stability: they
        are searched over a scale that is logarithmic but for the smallest.
    hertz : bool
        Whether its unit is written Hz instead of 1/s.
    """

    name: str
    given: Given
    time: int = 0
    out: int | None = None
    into: int | None = None
    low: float = -math.inf
    high: float = math.inf
    default: float = 0.0
    search: Literal["linear", "positive", "integral"] = "linear"
    hertz: bool = False

    @property
    def held(self) -> float | None:
        """The value of a number that is not tuned; None for one that is."""
        if isinstance(self.given, Tunable):
            return None if self.given.free else self.given.value
        return self.given

    def unit(self, inputs: Sequence[str], outputs: Sequence[str]) -> str:
        """Return its unit, from those of the block's signals; empty if one is not known."""
        above = [] if self.out is None else [outputs[self.out]]
        below = [] if self.into is None else [inputs[self.into]]
        if "" in above + below:
            return ""
        if self.hertz:
            return "Hz"
        (above if self.time > 0 else below).extend(["s"] * abs(self.time))
        if not below:
            return " ".join(above)
        bar = " ".join(below) if len(below) == 1 else f"({' '.join(below)})"
        return f"{' '.join(above) or '1'}/{bar}"

    def size(self, inputs: Sequence[float], outputs: Sequence[float], time: float) -> float:
        """Return the value that is 1 in units of order one for the plant."""
        above = 1.0 if self.out is None else float(outputs[self.out])
        below = 1.0 if self.into is None else float(inputs[self.into])
        return above / below * time**self.time


def checked_slot(slot: Slot) -> Slot:
    """Return a slot whose number, if one is given, makes sense there.

    Raises
    ------
    InvalidInputError
        If it is no number, or none of its values is possible.
    """
    given: Any = slot.given
    positive = slot.search == "positive"
    want = _range_in_words(slot)
    if given is None:
        return slot
    if isinstance(given, Tunable):
        if given.high < slot.low or given.low > slot.high or (positive and given.high <= 0):
            shown = described(f"{given.name} between {given.low:g} and {given.high:g}")
            raise invalid(slot.name, shown, want, "Change its limits.")
        value = given.value
        if value is not None and not _possible(slot, value):
            shown = described(f"{given.name} starting at {value:g}")
            raise invalid(slot.name, shown, want, "Change its value.")
        return slot
    try:
        value = math.nan if isinstance(given, bool) else float(given)
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value) or not _possible(slot, value):
        remedy = "A number holds it; rp.tunable(name, value, low, high) tunes it, None too."
        raise invalid(slot.name, given, want, remedy)
    return Slot(**{**vars(slot), "given": value})


def _possible(slot: Slot, value: float) -> bool:
    return slot.low <= value <= slot.high and (slot.search != "positive" or value > 0)


def _range_in_words(slot: Slot) -> str:
    if math.isinf(slot.low):
        return "a number"
    top = "" if math.isinf(slot.high) else f", at most {slot.high:g}"
    above = slot.low == 0 and slot.search == "positive"
    return f"a number {'above' if above else 'of at least'} {slot.low:g}{top}"
