"""A number that a search may choose, by name and within limits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from robustpolish.validation import described, invalid


@dataclass(frozen=True)
class Tunable:
    """A number of blocks that is tuned; see :func:`tunable`.

    Attributes
    ----------
    name : str
        Blocks with a number of the same name share its value.
    value : float or None
        Where the search starts; None leaves that to the block.
    low, high : float
        Limits, in the unit of the number.
    free : bool
        Whether it is tuned; otherwise it keeps `value`.

    Examples
    --------
    >>> import robustpolish as rp
    >>> print(rp.tunable("k", 1.0, low=0.0))
    k, from 1, between 0 and inf
    """

    name: str
    value: float | None = None
    low: float = -math.inf
    high: float = math.inf
    free: bool = True

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.strip():
            raise invalid("name", self.name, "a name", "Numbers of one name share their value.")
        low, high = _number("low", self.low, True), _number("high", self.high, True)
        if not low < high:
            shown = described(f"{self.name} between {low:g} and {high:g}")
            raise invalid("low", shown, "less than high", "Exchange them, or write free=False.")
        value = None if self.value is None else _number("value", self.value, False)
        if not isinstance(self.free, bool):
            raise invalid("free", self.free, "True or False", "False holds the number.")
        if value is None and not self.free:
            shown = described(f"no value for {self.name}, which is held")
            raise invalid("value", shown, "a number", "Say which value it is held at.")
        if value is not None and not low <= value <= high:
            shown = described(f"{value:g} for {self.name}")
            want = f"a number between its limits, {low:g} and {high:g}"
            raise invalid("value", shown, want, "Start inside the limits.")
        for field, checked in (("value", value), ("low", low), ("high", high)):
            object.__setattr__(self, field, checked)

    def __str__(self) -> str:
        if not self.free:
            return f"{self.name}, held at {self.value:g}"
        start = "" if self.value is None else f", from {self.value:g}"
        return f"{self.name}{start}, between {self.low:g} and {self.high:g}"


def tunable(
    name: str,
    value: float | None = None,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    free: bool = True,
) -> Tunable:
    """Return a number that :func:`robustpolish.structured_output_feedback` tunes.

    Parameters
    ----------
    name : str
        Several blocks that are given a number of one name share its value.
    value : float, optional
        Where the search starts.
    low, high : float, optional
        Limits, which are kept exactly.
    free : bool, optional
        False holds the number at `value`.

    Returns
    -------
    Tunable

    Raises
    ------
    InvalidInputError
        If the limits contradict each other, or the value is outside of them.

    Examples
    --------
    One gain for two axes, with negative feedback:

    >>> import robustpolish as rp
    >>> k = rp.tunable("k", 10.0, low=0.0, high=1e4)
    >>> axes = [rp.pid(y, control=u, kind="P", Kp=k, sign=-1) for y, u in ("xF", "yG")]
    """
    return Tunable(name, value, low, high, free)


def _number(argument: str, value: Any, infinite: bool) -> float:
    try:
        number = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError):
        number = math.nan
    if math.isnan(number) or (math.isinf(number) and not infinite):
        want = "a number" if infinite else "a finite number"
        raise invalid(argument, value, want, "Pass a number.")
    return number
