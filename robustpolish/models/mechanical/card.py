"""How a mechanical model shows itself."""

from __future__ import annotations

from typing import Any

from robustpolish.display import Card, Table
from robustpolish.models.mechanical.data import MechanicalData, unit_of, values
from robustpolish.models.mechanical.parts import Input, Output

COLUMNS = ("part", "at", "quantity", "value", "unit")


def mechanical_card(model: MechanicalData) -> Card:
    """List masses, springs, dampers and effects, and the signals that drive and leave a model."""
    rows: list[tuple[Any, ...]] = []
    for dof in model.dofs:
        if dof.name in model.channels:  # no mass, and no motion
            continue
        name = dof.key[-1]
        rows.append((name, dof.name, name, dof.mass, dof.unit))
    parts = [(f"spring[{i}]", "spring", s.between) for i, s in enumerate(model.springs)]
    parts += [(f"damper[{i}]", "damper", d.between) for i, d in enumerate(model.dampers)]
    parts += [(f"coupled_inertia[{i}]", "coupled inertia", c.between)
              for i, c in enumerate(model.coupled_inertias)]  # fmt: skip
    parts += [(f"effect[{i}]", e.kind, e.at) for i, e in enumerate(model.effects)]
    numbers = values(model)
    for start, part, at in parts:
        for key in (key for key in numbers if key.startswith(f"{start}.")):
            name = key.removeprefix(f"{start}.")
            rows.append((part, _joined(at), name, float(numbers[key]), unit_of(model, key)))
    signals = [
        ("input", item.name, *_what(model, item), model.unit_of(item)) for item in model.inputs
    ] + [
        ("output", item.name, _seen(item), item.quantity, model.unit_of(item))
        for item in model.outputs
    ]
    columns = ("signal", "name", "at", "quantity", "unit")
    tables = [Table("", COLUMNS, tuple(rows)), Table("", columns, tuple(signals))]
    if model.spin_frequency is not None:
        tables.append(Table("", (), (("spin [Hz]", model.spin_frequency),)))
    return Card(f"Mechanical model {model.name}".rstrip(), tuple(tables))


def _what(model: MechanicalData, item: Input) -> tuple[str, str]:
    """Return where an input acts, and what it is there."""
    if item.imposes and item.on[0] in model.channels:
        return "", "channel"
    return _joined(item.on), item.imposes or "force"


def _seen(item: Output) -> str:
    """Return where an output measures, or the sum that it sees."""
    if item.weights is None:
        return _joined(item.of)
    terms = zip(item.weights, item.of, strict=True)
    return " ".join(f"{weight:+.4g} {name}" for weight, name in terms).removeprefix("+")


def _joined(places: tuple[str, ...]) -> str:
    return " - ".join(places)
