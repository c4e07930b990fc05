"""Plants and systems with names in files: as plain values, every entry of a matrix exact."""

from __future__ import annotations

import math
from typing import Any

import control
import numpy as np

from robustpolish.analysis import DelayLine
from robustpolish.models.plant.blocks import named_system
from robustpolish.models.plant.wired import WiredPlant
from robustpolish.models.plant.wiring import Wiring
from robustpolish.saved_file import Fields
from robustpolish.validation import described, invalid, matrix


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
    for name, entries in zip(shapes, matrices, strict=True):
        matrix(f"{fields.where}: {name}", entries)
    for key, names in (("inputs", inputs), ("outputs", outputs), ("states", states)):
        dotted = key != "states" and any("." in name for name in names)
        if dotted or len(set(names)) < len(names):
            want, remedy = "different names, of signals without dots", "The file was edited."
            raise invalid(f"{fields.where}: {key}", names, want, remedy)
    dt = True if fields.raw("dt") is True else fields.number("dt")
    if not 0 <= dt < math.inf:
        raise invalid(f"{fields.where}: dt", dt, "0, or a sampling time in s", "Correct it.")
    return named_system(matrices, dt, inputs, outputs, states)


_SQUARED = 1e150
"""Entries whose squares doubles do not hold."""


def check_size(fields: Fields, *systems: control.StateSpace) -> None:
    """Refuse entries with which no loop can be computed, so that no design had them either.

    Raises
    ------
    InvalidInputError
        With the largest of them.
    """
    largest = max(
        float(np.abs(np.asarray(M)).max(initial=0.0)) for s in systems for M in (s.A, s.B, s.C, s.D)
    )
    if largest > _SQUARED:
        shown, remedy = described(f"an entry of size {largest:g}"), "The file was edited."
        raise invalid(fields.where, shown, "entries whose squares are finite", remedy)
