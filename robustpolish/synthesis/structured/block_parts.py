"""Parts of tunable blocks: numbers with units and limits, links in series, and tuned results."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, Self

import numpy as np

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import AnyVector as Vector
from robustpolish.base.checks import described, invalid, misfit
from robustpolish.base.results import Card, Displayed, Table
from robustpolish.plants.blocks import matrices_of
from robustpolish.plants.wired import single_filter
from robustpolish.synthesis.problem.matrices import Controller, balanced, controller_matrix

# From a coordinate without a unit, in which a search moves, to a number in its unit.

Search = Literal["linear", "positive", "integral"]
# Decades from 1 at which the search for a positive number ends, in units that suit the loop:
# nothing in it depends on what is so small or large.
_FAR = 6.0
# The smallest gain of an integrator in these units: with less the loop has a pole so slow that
# nobody would notice the integral action, and at 0 it is not stable.
LEAST = 1e-4
# Within this factor of the smallest, in natural logarithms, an integral gain counts as not wanted.
_IDLE = math.log(10.0)
# Exponents beyond it leave doubles.
_STEEP = 700.0


@dataclass(frozen=True)
class ParameterTransform:
    """A number as a monotonic function of its coordinate.

    A positive number is searched over its logarithm. So is the size of an integral gain, on both
    sides of a gap around 0: where a norm wants none of it, it comes to rest there.

    Attributes
    ----------
    size : float
        The number that is 1 in units of order one.
    low, high : float
        Limits of the number.
    search : {"linear", "positive", "integral"}
    """

    size: float
    low: float
    high: float
    search: Search = "linear"

    @property
    def least(self) -> float:
        """The smallest size of an integral gain."""
        return min(LEAST * self.size, 1e-3 * max(abs(self.low), abs(self.high)))

    def idle(self, theta: float) -> bool:
        """Tell whether an integral gain has come to rest next to 0."""
        return self.search == "integral" and abs(theta) < _IDLE

    def value(self, theta: float) -> float:
        """Return the number at a coordinate, inside its limits in spite of rounding."""
        value = self.size * theta if self.search == "linear" else self.slope(theta)
        # An integral gain is folded at 0, where the number jumps.
        if self.search == "integral" and (theta < 0 or self.high <= 0):
            value = -value
        return min(max(value, self.low), self.high)

    def slope(self, theta: float) -> float:
        """Return the derivative of the number over its coordinate."""
        if self.search == "positive":
            return self.size * math.exp(min(theta, _STEEP))
        if self.search == "integral":
            return self.least * math.exp(min(abs(theta), _STEEP))
        return self.size

    def theta(self, value: float) -> float:
        """Return the coordinate of a number."""
        if self.search == "positive":
            return math.log(value / self.size) if value > 0 else -math.inf
        if self.search == "integral":
            return math.copysign(math.log(max(abs(value) / self.least, 1.0)), value)
        return value / self.size

    def bounds(self, start: float) -> tuple[float, float]:
        """Return the limits of the coordinate, which leave room around a start."""
        low, high = self.theta(self.low), self.theta(self.high)
        if self.search != "positive":
            return low, high
        far = _FAR * math.log(10.0)
        return max(low, min(-far, start - 1)), min(high, max(far, start + 1))


# A number that a search may choose, by name and within limits.


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
    >>> print(rp.tunable.tunable("k", 1.0, low=0.0))
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
            want = f"a number between its limits, {low:g} and {high:g}"
            raise misfit("value", f"{value:g} for {self.name}", want, "Start inside the limits.")
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
    >>> k = rp.tunable.tunable("k", 10.0, low=0.0, high=1e4)
    >>> axes = [rp.tunable.pid(y, control=u, kind="P", Kp=k, sign=-1) for y, u in ("xF", "yG")]
    """
    return Tunable(name, value, low, high, free)


def _as_number(value: Any) -> float:
    """Return a finite or infinite number; NaN for what is none."""
    try:
        return math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError):
        return math.nan


def _number(argument: str, value: Any, infinite: bool) -> float:
    number = _as_number(value)
    if math.isnan(number) or (math.isinf(number) and not infinite):
        want = "a number" if infinite else "a finite number"
        raise invalid(argument, value, want, "Pass a number.")
    return number


# A number of a block: what it is, its unit, where it may lie, and what the user made of it.

Given = Tunable | float | None


@dataclass(frozen=True)
class ParameterSlot:
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

    Raises
    ------
    InvalidInputError
        If what was given is no number, or none of its values is possible.
    """

    name: str
    given: Given
    time: int = 0
    out: int | None = None
    into: int | None = None
    low: float = -math.inf
    high: float = math.inf
    default: float = 0.0
    search: Search = "linear"
    hertz: bool = False

    def __post_init__(self) -> None:
        given: Any = self.given
        if given is None:
            return
        if not isinstance(given, Tunable):
            value = _as_number(given)
            if not math.isfinite(value) or not self._admits(value):
                remedy = (
                    "A number holds it; rp.tunable.tunable(name, value, low, high) tunes it, None "
                    "too."
                )
                raise invalid(self.name, given, self._range, remedy)
            object.__setattr__(self, "given", value)
            return
        none_above = given.high <= 0 and self.search == "positive"
        if given.high < self.low or given.low > self.high or none_above:
            shown = described(f"{given.name} between {given.low:g} and {given.high:g}")
            raise invalid(self.name, shown, self._range, "Change its limits.")
        if given.value is not None and not self._admits(given.value):
            shown = described(f"{given.name} starting at {given.value:g}")
            raise invalid(self.name, shown, self._range, "Change its value.")

    def _admits(self, value: float) -> bool:
        return self.low <= value <= self.high and (self.search != "positive" or value > 0)

    @property
    def _range(self) -> str:
        """What may be given, in words."""
        if math.isinf(self.low):
            return "a number"
        top = "" if math.isinf(self.high) else f", at most {self.high:g}"
        above = self.low == 0 and self.search == "positive"
        return f"a number {'above' if above else 'of at least'} {self.low:g}{top}"

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


# One link of a block: a small system whose matrices depend on numbers, with their derivatives.


@dataclass(frozen=True, eq=False, kw_only=True)
class Stage(ABC):
    """A system with x' = A x + B e, v = C x + D e, all of it made of numbers.

    Attributes
    ----------
    kind : str
    formula : str
        Its transfer function in words.
    states : tuple of str
        Names of x; one that is called "integral" integrates e.
    slots : tuple of ParameterSlot
        Its numbers.
    name : str or None
        Given by the user; otherwise the kind and the signals name it.
    inputs, outputs : int
        Sizes of e and v.
    has_gain : bool
        Whether its numbers hold a gain from one unit to another; filters keep the unit.
    resizable : bool
        Whether it takes as many signals as the plant has, and means the same in discrete time.
    """

    kind: str
    formula: str
    states: tuple[str, ...] = ()
    slots: tuple[ParameterSlot, ...] = ()
    name: str | None = None
    inputs: int = 1
    outputs: int = 1
    has_gain: bool = True
    resizable: bool = False

    @abstractmethod
    def matrix(self, values: Vector) -> Matrix:
        """Return [[A, B], [C, D]] for the values of the slots."""

    @abstractmethod
    def back(self, values: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over [[A, B], [C, D]] into one over the values of the slots."""

    def sized(self, inputs: int, outputs: int) -> Self:
        """Return the stage for so many signals."""
        if (inputs, outputs) != (self.inputs, self.outputs):
            raise invalid(
                "blocks",
                described(f"a {self.kind} from {inputs} to {outputs} signals"),
                f"{self.inputs} and {self.outputs}",
                "Name one measurement and one control: rp.tunable.pid('x', control='F').",
            )
        return self

    def in_unit_of_time(self, unit: float) -> Self:
        """Return the stage in another unit of time; numbers of slots are converted elsewhere."""
        return self


@dataclass(frozen=True, eq=False, kw_only=True)
class GivenFilter(Stage):
    """A continuous system with fixed matrices.

    Attributes
    ----------
    matrices : Controller
    """

    matrices: Controller

    @classmethod
    def of(cls, system: Any) -> GivenFilter:
        """Take a system or a number.

        Raises
        ------
        InvalidInputError
            If it is no continuous system of one input and one output.
        """
        A, B, C, D = matrices_of(single_filter("blocks", system, 0))
        return cls(
            kind="given",
            formula=f"a given filter of order {len(A)}" if len(A) else f"{D[0, 0]:g}",
            states=tuple(f"x{i + 1}" for i in range(len(A))),
            has_gain=False,
            matrices=Controller(A, B, C, D),
        )

    def matrix(self, values: Vector) -> Matrix:
        """Return [[A, B], [C, D]]."""
        return controller_matrix(self.matrices)

    def back(self, values: Vector, gradient: Matrix) -> Vector:
        """Return nothing: there are no numbers."""
        return np.zeros(0)

    def in_unit_of_time(self, unit: float) -> Self:
        """Return the filter in another unit of time, with states of order one."""
        A, B, C, D = self.matrices
        return replace(self, matrices=balanced(Controller(A * unit, B * unit, C, D)))


# A block from measurements to controls: links in series.

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
    >>> rp.tunable.pid("x", control="F", sign=-1) * rp.tunable.notch()
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
        >>> rp.tunable.pid(kind="PI", sign=-1).law(["x"], ["F"])
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
    >>> number = rp.results.TunedNumber("Kp", 3.0, "N/m", "pid_x.Kp", 0.0, 3.0, True)
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
    >>> gain = rp.tunable.tunable("k", 2.0, low=0.0, high=3.0)
    >>> design = rp.structured_output_feedback(plant, [rp.tunable.pid(kind="P", Kp=gain, sign=-1)])
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
        return {number.name: number.value for number in self.numbers}[name]

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
        return {block.name: block for block in self.blocks}[name]

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
        # Infinities have no place in JSON: a limit that is none is left out.
        blocks = [
            {
                **vars(block),
                "numbers": [
                    {k: v for k, v in vars(number).items() if v not in (math.inf, -math.inf)}
                    for number in block.numbers
                ],
            }
            for block in self.blocks
        ]
        return {"laws": list(self.laws), "blocks": blocks}

    @classmethod
    def of_content(cls, content: Any) -> TunedBlocks:
        """Return what :meth:`content` wrote.

        Raises
        ------
        TypeError, ValueError, KeyError
            If it is not what that writes.
        """
        limits = {"low": -math.inf, "high": math.inf}
        blocks = []
        for block in content["blocks"]:
            numbers = tuple(TunedNumber(**{**limits, **number}) for number in block["numbers"])
            blocks.append(TunedBlock(str(block["name"]), str(block["formula"]), numbers))
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
