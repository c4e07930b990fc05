"""Plants and other linear systems in files."""

from __future__ import annotations

from typing import Any

import control
import numpy as np

from robustpolish.models.generalized_plant import GeneralizedPlant
from robustpolish.saved_file import Fields


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
    names = {key: list(fields.texts(key)) for key in ("states", "inputs", "outputs")}
    n, m, p = (len(names[key]) for key in ("states", "inputs", "outputs"))
    dt = fields.raw("dt")
    return control.StateSpace(
        fields.array("A", n, n),
        fields.array("B", n, m),
        fields.array("C", p, n),
        fields.array("D", p, m),
        True if dt is True else fields.number("dt"),
        remove_useless_states=False,
        **names,
    )


def plant_content(plant: GeneralizedPlant) -> dict[str, Any]:
    """Return a plant as plain values."""
    return {
        "system": system_content(plant.system),
        "measurements": plant.measurements,
        "controls": plant.controls,
        "units": dict(plant.units),
    }


def plant_from(fields: Fields) -> GeneralizedPlant:
    """Return the plant that :func:`plant_content` described."""
    units = fields.table("units")
    return GeneralizedPlant(
        system_from(fields.table("system")),
        fields.whole("measurements"),
        fields.whole("controls"),
        {name: units.text(name) for name in units},
    )
