"""Plants in files."""

from __future__ import annotations

from typing import Any

import control

from robustpolish.models.plant.blocks import PlantBlocks
from robustpolish.models.plant.systems import system_content, system_from
from robustpolish.saved_file import Fields


def plant_content(plant: PlantBlocks) -> dict[str, Any]:
    """Return a plant as plain values."""
    return {
        "system": system_content(plant.system),
        "measurements": plant.measurements,
        "controls": plant.controls,
        "units": dict(plant.units),
    }


def plant_arguments(fields: Fields) -> tuple[control.StateSpace, int, int, dict[str, str]]:
    """Return what `GeneralizedPlant` is made of, from what :func:`plant_content` described."""
    units = fields.table("units")
    return (
        system_from(fields.table("system")),
        fields.whole("measurements"),
        fields.whole("controls"),
        {name: units.text(name) for name in units},
    )
