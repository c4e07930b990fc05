"""A formula as a list of operations.

They stand in postfix order, so that whatever has to be known of a formula (its value, its units,
how a parameter enters, its machine code) is one walk along the list: see :meth:`Formula.fold`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")

MOTION = ("q", "v", "t")
"""Relative displacement, relative velocity and time, which every formula may name."""
FUNCTIONS: Mapping[str, Any] = {
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "exp": np.exp,
    "log": np.log,
    "sqrt": np.sqrt,
    "abs": np.abs,
    "sign": np.sign,
    "tanh": np.tanh,
    "arctan": np.arctan,
}
PAIRS: Mapping[str, Any] = {
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    "**": np.power,
    "min": np.minimum,
    "max": np.maximum,
}


@dataclass(frozen=True)
class Formula:
    """A formula as a program in postfix order.

    Parameters
    ----------
    text : str
        As it was written.
    program : tuple of (str, float or str or None)
        ``("number", 2.0)`` and ``("name", "q")`` are put on a stack; ``("+", None)`` and the
        like take their operands off it and put the result there.
    """

    text: str
    program: tuple[tuple[str, Any], ...]

    def fold(self, leaf: Callable[[float | str], T], combine: Callable[..., T]) -> T:
        """Walk along the program.

        Parameters
        ----------
        leaf : callable
            ``leaf(number)`` and ``leaf(name)`` give what stands for them.
        combine : callable
            ``combine(operation, *operands)`` gives what an operation makes of them.

        Returns
        -------
        object
            What stands for the whole formula.
        """
        stack: list[T] = []
        for operation, argument in self.program:
            if argument is not None:
                stack.append(leaf(argument))
                continue
            count = 2 if operation in PAIRS else 1
            operands = stack[-count:]
            del stack[-count:]
            stack.append(combine(operation, *operands))
        return stack[0]

    def value(self, values: Mapping[str, Any]) -> Any:
        """Return the value of the formula.

        Parameters
        ----------
        values : mapping of str to float or ndarray
            Of every name in it.

        Returns
        -------
        float or ndarray
            Not finite where the formula has no value.

        Examples
        --------
        >>> twice = Formula("f = 2*q", (("number", 2.0), ("name", "q"), ("*", None)))
        >>> twice.value({"q": 3.0})
        6.0
        """

        def leaf(item: float | str) -> Any:
            return values[item] if isinstance(item, str) else item

        with np.errstate(all="ignore"):
            found = self.fold(leaf, result_of)
        return float(found) if np.ndim(found) == 0 else found

    @property
    def names(self) -> frozenset[str]:
        """The names in it."""
        return frozenset(item for kind, item in self.program if kind == "name")

    @property
    def operations(self) -> frozenset[str]:
        """The operations in it, such as ``"+"`` and ``"tanh"``."""
        return frozenset(kind for kind, item in self.program if item is None)


def result_of(operation: str, *operands: Any) -> Any:
    """Return what an operation makes of numbers or arrays."""
    if operation == "negative":
        return -operands[0]
    return (PAIRS.get(operation) or FUNCTIONS[operation])(*operands)
