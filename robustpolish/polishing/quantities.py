"""Fields with a unit and a source, checked when a set of parameters is built."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import field, fields
from typing import Any, ClassVar, TypeVar

from robustpolish.base.checks import instance_of, positive
from robustpolish.base.results import Card, Displayed, Table

T = TypeVar("T")


def quantity(default: Any, unit: str, source: str = "", **more: str) -> Any:
    """Declare a field whose metadata carry unit, source and more, such as a symbol."""
    return field(default=default, metadata={"unit": unit, "source": source, **more})


def check_quantities(
    owner: Any, prefix: str = "", *, zero: Collection[str] = (), infinite: Collection[str] = ()
) -> None:
    """Check that every field is a positive number, and keep it as a float.

    Parameters
    ----------
    owner : dataclass
        Fields whose unit is "" are no numbers.
    prefix : str, optional
        Before the names of the fields in messages.
    zero, infinite : collection of str, optional
        Fields that may be zero, and that may be infinite.
    """
    for item in fields(owner):
        value, unit = getattr(owner, item.name), item.metadata.get("unit")
        endless = item.name in infinite and isinstance(value, float) and value == math.inf
        if unit != "" and not endless:
            zero_too = item.name in zero
            value = positive(f"{prefix}{item.name}", value, unit or "", zero=zero_too)
            object.__setattr__(owner, item.name, value)


def or_default(argument: str, given: T | None, kind: type[T]) -> T:
    """Return the parameters that were given, of the right kind, or else the default ones."""
    if given is None:
        return kind()
    name = kind.__name__
    return instance_of(argument, given, kind, name, f"Build them with {name}(...).")


class Quantities(Displayed):
    """Base of parameters whose fields carry unit and source: they show themselves as a table."""

    _caption: ClassVar[tuple[str, str]]
    """Title, and what a row is."""

    def table(self) -> list[tuple[str, Any, str, str]]:
        """List every field as (name, value, unit, source).

        Returns
        -------
        list of tuple
        """
        owner: Any = self
        rows = [(item.name, item.metadata) for item in fields(owner)]
        return [(name, getattr(self, name), more["unit"], more["source"]) for name, more in rows]

    def _card(self) -> Card:
        title, what = self._caption
        columns = (what, "value", "unit", "source")
        return Card(title, (Table("", columns, tuple(self.table())),))
