"""Numbers with their derivative along one direction, exact to rounding.

The numbers may be uncertain systems, as long as they are only added, multiplied and divided.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from robustpolish.base.checks import described, invalid

_SLOPES: Mapping[str, Callable[[Any, Any], Any]] = {
    "sin": lambda x, y: np.cos(x),
    "cos": lambda x, y: -np.sin(x),
    "tan": lambda x, y: 1 + y * y,
    "exp": lambda x, y: y,
    "log": lambda x, y: 1 / x,
    "sqrt": lambda x, y: 0.5 / y,
    "tanh": lambda x, y: 1 - y * y,
    "arctan": lambda x, y: 1 / (1 + x * x),
}


def plus(a: Any, b: Any) -> Any:
    """Return a sum of numbers, uncertain ones spared where one of them is 0."""
    return b if _is_zero(a) else a if _is_zero(b) else a + b


def times(a: Any, b: Any) -> Any:
    """Return a product of numbers, uncertain ones spared where one of them is 0."""
    return 0.0 if _is_zero(a) or _is_zero(b) else a * b


def _is_zero(a: Any) -> bool:
    return isinstance(a, int | float) and a == 0


class Dual:
    """A number and its derivative.

    Parameters
    ----------
    value, slope : float or UncertainSystem
    """

    def __init__(self, value: Any, slope: Any = 0.0) -> None:
        self.value, self.slope = value, slope

    def __add__(self, other: Any) -> Dual:
        other = dual(other)
        return Dual(plus(self.value, other.value), plus(self.slope, other.slope))

    def __mul__(self, other: Any) -> Dual:
        a, b = self, dual(other)
        slope = plus(times(a.slope, b.value), times(a.value, b.slope))
        return Dual(times(a.value, b.value), slope)

    def __pow__(self, power: Any) -> Dual:
        n = power.value if isinstance(power, Dual) else power
        if isinstance(power, Dual) and not _is_zero(power.slope):
            return (power * self.log()).exp()
        return Dual(self.value**n, times(n * self.value ** (n - 1) if n else 0.0, self.slope))

    def __truediv__(self, other: Any) -> Dual:
        b = dual(other)
        quotient = times(self.value, 1 / b.value)
        slope = plus(self.slope, times(-1.0, times(quotient, b.slope)))
        return Dual(quotient, times(slope, 1 / b.value))

    def __neg__(self) -> Dual:
        return self * -1.0

    def __sub__(self, other: Any) -> Dual:
        return self + dual(other) * -1.0

    def __rsub__(self, other: Any) -> Dual:
        return dual(other) - self

    def __rtruediv__(self, other: Any) -> Dual:
        return dual(other) / self

    def __rpow__(self, other: Any) -> Dual:
        return dual(other) ** self

    def __abs__(self) -> Dual:
        return self * float(np.sign(self.value))  # at a corner the mean of both slopes

    def __lt__(self, other: Any) -> bool:
        return bool(self.value < dual(other).value)

    def __gt__(self, other: Any) -> bool:
        return bool(self.value > dual(other).value)

    def __le__(self, other: Any) -> bool:
        return not self > other

    def __ge__(self, other: Any) -> bool:
        return not self < other

    def __eq__(self, other: object) -> bool:
        return bool(self.value == dual(other).value)

    def __getattr__(self, name: str) -> Callable[[], Dual]:
        """Return a function of it, as numpy asks for ``sin`` of an object."""
        if name not in _SLOPES:
            raise AttributeError(name)
        if not isinstance(self.value, int | float):
            shown, want = described(f"a number that {name} is taken of"), "sums and products of it"
            raise invalid("ranges", shown, want, "Leave it certain.")

        def call() -> Dual:
            x = float(self.value)
            y = float(getattr(np, name)(x))
            return Dual(y, times(float(_SLOPES[name](x, y)), self.slope))

        return call

    __radd__, __rmul__, __hash__ = __add__, __mul__, None  # type: ignore[assignment]


def larger(a: Any, b: Any) -> Dual:
    """Return the larger of two numbers; where they are equal the mean of both slopes."""
    return (dual(a) + b + abs(dual(a) - b)) * 0.5


def dual(number: Any) -> Dual:
    """Return a number with its derivative, 0 of a constant."""
    return number if isinstance(number, Dual) else Dual(number)
