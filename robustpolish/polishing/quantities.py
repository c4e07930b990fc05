"""Fields with a unit and a source, checked when a set of parameters is built."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import field, fields
from typing import Any

from robustpolish.base.checks import positive


def quantity(default: float, unit: str, source: str = "", **more: str) -> Any:
    """Declare a field whose metadata carry unit, source and more, such as a symbol."""
    return field(default=default, metadata={"unit": unit, "source": source, **more})


def check_quantities(
    owner: Any,
    prefix: str = "",
    *,
    zero: Collection[str] = (),
    infinite: Collection[str] = (),
    skip: Collection[str] = (),
) -> None:
    """Check that every field is a positive number, and keep it as a float.

    Parameters
    ----------
    owner : dataclass
    prefix : str, optional
        Before the names of the fields in messages.
    zero, infinite, skip : collection of str, optional
        Fields that may be zero, that may be infinite, and that are no numbers.
    """
    for item in fields(owner):
        value = getattr(owner, item.name)
        endless = item.name in infinite and isinstance(value, float) and value == math.inf
        if item.name in skip or endless:
            continue
        unit = item.metadata.get("unit", "")
        value = positive(f"{prefix}{item.name}", value, unit, zero=item.name in zero)
        object.__setattr__(owner, item.name, value)


def quantity_table(owner: Any) -> list[tuple[str, Any, str, str]]:
    """List every field as (name, value, unit, source)."""
    return [
        (item.name, getattr(owner, item.name), item.metadata["unit"], item.metadata["source"])
        for item in fields(owner)
    ]
