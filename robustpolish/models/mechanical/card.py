"""How a mechanical model shows itself."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from robustpolish.display import Card, Table

if TYPE_CHECKING:
    from robustpolish.models.mechanical import MechanicalModel

COLUMNS = ("part", "at", "quantity", "value", "unit")


def mechanical_card(model: MechanicalModel) -> Card:
    """List masses, springs, dampers and effects, and the signals that drive and leave a model."""
    rows: list[tuple[Any, ...]] = []
    for dof in model.dofs:
        name = "inertia" if dof.rotational else "mass"
        rows.append((name, dof.name, name, dof.mass, dof.unit))
    turning = {dof.name: dof.rotational for dof in model.dofs}
    for spring in model.springs:
        unit = "N m/rad" if turning.get(spring.between[0]) else "N/m"
        rows.append(("spring", _joined(spring.between), "stiffness", spring.stiffness, unit))
    for damper in model.dampers:
        unit = "N m s/rad" if turning.get(damper.between[0]) else "N s/m"
        rows.append(("damper", _joined(damper.between), "damping", damper.damping, unit))
    for effect in model.effects:
        units = {p.name: p.unit for p in effect.definition.parameters}
        for name, value in effect.values.items():
            rows.append((effect.kind, _joined(effect.at), name, float(value), units[name]))
    signals = [
        ("input", item.name, _joined(item.on), item.imposes or "force", model.unit_of(item))
        for item in model.inputs
    ] + [
        ("output", item.name, _joined(item.of), item.quantity, model.unit_of(item))
        for item in model.outputs
    ]
    columns = ("signal", "name", "at", "quantity", "unit")
    tables = [Table("", COLUMNS, tuple(rows)), Table("", columns, tuple(signals))]
    if model.spin_frequency is not None:
        tables.append(Table("", (), (("spin [Hz]", model.spin_frequency),)))
    return Card(f"Mechanical model {model.name}".rstrip(), tuple(tables))


def _joined(places: tuple[str, ...]) -> str:
    return " - ".join(places)
