"""Real elements that share an ellipsoid: their physical numbers, and points drawn from it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from robustpolish.models.uncertain.elements import Block, Directions, RealElement, real_number
from robustpolish.validation import described, invalid

# Relative size of what is left of numbers that no point of the ellipsoid's space has.
_OUTSIDE = 1e-9


def groups(blocks: Iterable[Block]) -> list[list[RealElement]]:
    """Return the elements of each group."""
    found: dict[str, list[RealElement]] = {}
    for block in blocks:
        if isinstance(block.element, RealElement) and block.element.group:
            found.setdefault(block.element.group, []).append(block.element)
    return list(found.values())


def physical(blocks: Iterable[Block], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values with physical numbers in place of the directions of ellipsoids."""
    found: dict[str, Any] = {}
    rest = dict(values)
    for members in groups(blocks):
        known = members[0].directions
        if known and any(name in rest for name in known.names):
            found |= numbers_at(known, rest)
            rest = {name: value for name, value in rest.items() if name not in known.names}
    return found | rest


def by_element(blocks: Sequence[Block], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values with the directions of ellipsoids in place of physical numbers.

    Directions that the system does not depend on are left out.
    """
    rest, elements = dict(values), {block.element.name for block in blocks}
    for members in groups(blocks):
        known = members[0].directions
        if known is None:
            continue
        named = {n: rest.pop(n) for n in known.numbers if n in rest and n not in elements}
        twice = [name for name in known.names if name in rest]
        if named and twice:
            shown = described(f"{', '.join(named)} and {', '.join(twice)}")
            remedy = "Give the physical numbers of an ellipsoid, or its directions."
            raise invalid("values", shown, "one way to name a point", remedy)
        rest |= point_of(known, named) if named else {}
        idle = {name for name in known.names if name not in elements}
        rest = {name: value for name, value in rest.items() if name not in idle}
    return rest


def numbers_at(known: Directions, values: Mapping[str, Any]) -> dict[str, float]:
    """Return the physical numbers at a point of an ellipsoid; directions not named are 0."""
    deltas = [real_number(name, values.get(name, 0.0)) for name in known.names]
    numbers = np.array(known.centre) + np.array(known.slopes) @ deltas
    return dict(zip(known.numbers, numbers.tolist(), strict=True))


def point_of(known: Directions, values: Mapping[str, Any]) -> dict[str, float]:
    """Return the directions of the point nearest to the centre that has some physical numbers."""
    rows = [known.numbers.index(name) for name in values]
    slopes = np.array(known.slopes)[rows]
    changes = np.array([real_number(n, v) for n, v in values.items()])
    changes = changes - np.array(known.centre)[rows]
    # Rows in units of their own largest change: numbers of any unit are alike.
    units = np.linalg.norm(slopes, axis=1)
    units[units == 0] = 1.0
    slopes, changes = slopes / units[:, None], changes / units
    deltas = np.linalg.pinv(slopes, rcond=1e-12) @ changes
    left = np.abs(slopes @ deltas - changes).max(initial=0.0)
    if left > _OUTSIDE * np.abs(changes).max(initial=1.0):
        shown = described(", ".join(values))
        remedy = "What is certain cannot be changed: leave it out, or give fewer numbers."
        raise invalid("values", shown, "numbers that the ellipsoid can have together", remedy)
    return dict(zip(known.names, deltas.tolist(), strict=True))


def drawn(members: Sequence[RealElement], random: np.random.Generator) -> dict[str, float]:
    """Draw a point of an ellipsoid, evenly."""
    direction = random.standard_normal(len(members))
    direction *= random.uniform() ** (1 / len(members)) / np.linalg.norm(direction)
    return {m.name: m.value(float(d)) for m, d in zip(members, direction, strict=True)}
