"""A block from measurements to controls: links in series."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from robustpolish.synthesis.blocks.given_filter import GivenFilter
from robustpolish.synthesis.blocks.stage import Stage
from robustpolish.validation import described, invalid

Names = str | Sequence[str] | None


@dataclass(frozen=True, eq=False, repr=False)
class TunableBlock:
    """A part of a controller, with numbers to be tuned; ``*`` puts two in series.

    Attributes
    ----------
    measurements, controls : tuple of str or None
        What it reads and drives; None where the plant leaves no choice.
    sign : {1, -1}
        Of u = sign times block times y.
    stages : tuple of Stage
        From measurement to control.

    Examples
    --------
    >>> import robustpolish as rp
    >>> rp.pid("x", control="F", sign=-1) * rp.notch()
    block: F = -(Kp + Ki/s + Kd s/(Tf s + 1)) * notch(s) x
    """

    measurements: tuple[str, ...] | None
    controls: tuple[str, ...] | None
    sign: int
    stages: tuple[Stage, ...]

    def __mul__(self, other: Any) -> TunableBlock:
        if not isinstance(other, TunableBlock):
            other = TunableBlock(None, None, 1, (GivenFilter.of(other),))
        return TunableBlock(
            _one("measurement", self.measurements, other.measurements),
            _one("control", self.controls, other.controls),
            self.sign * other.sign,
            (*other.stages, *self.stages),
        )

    def __rmul__(self, other: Any) -> TunableBlock:
        return TunableBlock(None, None, 1, (GivenFilter.of(other),)) * self

    def __neg__(self) -> TunableBlock:
        return TunableBlock(self.measurements, self.controls, -self.sign, self.stages)

    def __repr__(self) -> str:
        return f"block: {self.law(self.measurements or ('y',), self.controls or ('u',))}"

    def law(self, measurements: Sequence[str], controls: Sequence[str]) -> str:
        """Return what it computes, in words.

        Parameters
        ----------
        measurements, controls : sequence of str
            What its signals are called.

        Returns
        -------
        str

        Examples
        --------
        >>> import robustpolish as rp
        >>> rp.pid(kind="PI", sign=-1).law(["x"], ["F"])
        'F = -(Kp + Ki/s) x'
        """
        links = " * ".join(stage.formula for stage in reversed(self.stages))
        links = f"-{links}" if self.sign < 0 else links
        read, driven = (_listed(names) for names in (measurements, controls))
        return f"{driven} = {links} {read}"


def block_of(stage: Stage, measurement: Names, control: Names, sign: Any = 1) -> TunableBlock:
    """Return the block of one link.

    Raises
    ------
    InvalidInputError
        If a name is none, or the sign is neither 1 nor -1.
    """
    if isinstance(sign, bool) or sign not in (1, -1):
        remedy = "u = K y has a positive sign: -1 writes negative feedback."
        raise invalid("sign", sign, "1 or -1", remedy)
    if stage.name is not None and not (isinstance(stage.name, str) and stage.name.strip()):
        raise invalid("name", stage.name, "a name", "Leave it out for one of its own.")
    read, driven = _names("measurement", measurement), _names("control", control)
    return TunableBlock(read, driven, int(sign), (stage,))


def _names(argument: str, given: Any) -> tuple[str, ...] | None:
    if given is None:
        return None
    try:
        names = (given,) if isinstance(given, str) else tuple(given)
    except TypeError:
        names = (given,)
    if not names or not all(isinstance(name, str) for name in names):
        raise invalid(argument, given, "a name of the plant, or several", "See its names.")
    if len(set(names)) != len(names):
        raise invalid(argument, names, "different names", "Name each signal once.")
    return names


def _one(
    argument: str, first: tuple[str, ...] | None, second: tuple[str, ...] | None
) -> tuple[str, ...] | None:
    if first is not None and second is not None and first != second:
        shown = described(f"{_listed(first)} and {_listed(second)} in one series")
        raise invalid(argument, shown, "the same in both, or in one only", "Name it once.")
    return first if second is None else second


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"[{', '.join(names)}]"
