"""Plants and systems with names in files: as plain values, every entry of a matrix exact."""

from __future__ import annotations

from typing import Any

import control
import numpy as np

from robustpolish.analysis import DelayLine
from robustpolish.models.plant.blocks import named_system
from robustpolish.models.plant.wired import WiredPlant
from robustpolish.models.plant.wiring import Wiring
from robustpolish.saved_file import Fields
from robustpolish.validation import described, invalid


def plant_content(plant: WiredPlant) -> dict[str, Any]:
    """Return a plant as plain values; where it has delays, with their lines still open."""
    wiring = plant.wiring
    content = {
        "system": system_content(wiring.system),
        "measurements": plant.measurements,
        "controls": plant.controls,
        "units": dict(plant.units),
    }
    if wiring.lines:
        content["lines"] = [vars(line) for line in wiring.lines]
    facts = {key: dict(getattr(plant, key)) for key in _FACTS}
    return content | {key: known for key, known in facts.items() if known}


def plant_parts(fields: Fields) -> tuple[Wiring, dict[str, Any]]:
    """Return wiring, units and facts of a plant that :func:`plant_content` described."""
    units = fields.table("units")
    system, counts = system_from(fields.table("system")), {}
    for key, available in (("measurements", system.noutputs), ("controls", system.ninputs)):
        counts[key] = fields.whole(key)
        if not 0 <= counts[key] <= available:
            shown, want = counts[key], f"a whole number from 0 to {available}"
            raise invalid(f"{fields.where}: {key}", shown, want, "The file was edited.")
    lines = tuple(
        DelayLine(line.text("name"), line.number("seconds"), line.whole("order"))
        for line in (fields.tables("lines") if "lines" in fields else ())
    )
    ports = min(system.ninputs - counts["controls"], system.noutputs - counts["measurements"])
    if len(lines) > ports:
        shown = described(f"{len(lines)} delay lines and {ports} signals for them")
        raise invalid(f"{fields.where}: lines", shown, "one per pair", "The file was edited.")
    facts = {key: fields.numbers(key) for key in _FACTS if key in fields}
    wiring = Wiring(system, counts["measurements"], counts["controls"], lines)
    return wiring, {"units": {name: units.text(name) for name in units}, **facts}


_FACTS = ("limits", "rate_limits", "delays")


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
