"""Plants and systems with names in files: as plain values, every entry of a matrix exact."""

from __future__ import annotations

from typing import Any

import control
import numpy as np

from robustpolish.models.plant.blocks import PlantBlocks, named_system
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


def system_content(system: control.StateSpace) -> dict[str, Any]:
    """Return a system as plain values, every entry of its matrices exact."""
    return {
        **{name: np.asarray(getattr(system, name)) for name in "ABCD"},
        "dt": 0 if system.dt is None else system.dt,
        "states": list(system.state_labels),
        "inputs": list(system.input_labels),
        "outputs": list(system.output_labels),
    }


def system_from(fields: Fields) -> control.StateSpace:
    """Return the system that :func:`system_content` described."""
    inputs, outputs, states = (list(fields.texts(key)) for key in ("inputs", "outputs", "states"))
    n, m, p = len(states), len(inputs), len(outputs)
    shapes = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
    matrices = [fields.array(name, *shape) for name, shape in shapes.items()]
    dt = True if fields.raw("dt") is True else fields.number("dt")
    return named_system(matrices, dt, inputs, outputs, states)
