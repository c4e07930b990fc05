"""One loop of a study: a machine, a surface and a brush with given numbers, and its figures."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import control
import numpy as np
import xarray as xr

from robustpolish.brush import BrushParameters, Surface, simulate_brush
from robustpolish.closed_loop.simulation import simulate
from robustpolish.closed_loop.uncertain_plant import in_place_of, loop_norm
from robustpolish.errors import RobustPolishWarning, SolverError
from robustpolish.models import (
    AirBearingParameters,
    GeneralizedPlant,
    MechanicalModel,
    air_bearing,
)
from robustpolish.validation import invalid, spelled

Machine = MechanicalModel | AirBearingParameters
PlantOf = Callable[[Any], GeneralizedPlant]
Figures = Callable[[xr.Dataset], Mapping[str, float]]

PEAK = "peak_"
"""Begins the names of largest absolute values."""


@dataclass(frozen=True)
class Trial:
    """What all loops of a study share.

    Attributes
    ----------
    plant : GeneralizedPlant
        The one that the controller was designed for.
    controller : control.StateSpace
    norm : {"hinf", "h2"}
    machine : MechanicalModel, AirBearingParameters or None
        What numbers of the machine belong to; None if they stay.
    plant_of : callable
        Makes a plant of a machine.
    names : tuple of str
        The numbers that are drawn, in the order in which they come.
    brush : BrushParameters
    duration : float or None
        Of the brush's run in s; None for none.
    load : xarray.Dataset or None
        Disturbances that are the same for all loops.
    figures : callable or None
        What else is to be told of a response.
    told : tuple of str
        The figures of a stable loop, which are infinite for an unstable one.
    """

    plant: GeneralizedPlant
    controller: control.StateSpace
    norm: str
    machine: Machine | None
    plant_of: PlantOf
    names: tuple[str, ...]
    brush: BrushParameters = field(default_factory=BrushParameters)
    duration: float | None = None
    load: xr.Dataset | None = None
    figures: Figures | None = None
    told: tuple[str, ...] = ()

    def __call__(self, **columns: Any) -> dict[str, float]:
        """Return the figures of one loop; `columns` are ``value_0``, ``value_1`` and so on."""
        return self.figures_of({name: columns[column(i)] for i, name in enumerate(self.names)})

    def figures_of(self, values: Mapping[str, Any]) -> dict[str, float]:
        """Return `norm`, largest deviations and controls; infinite if the loop is unstable."""
        plant = self.plant_with(values)
        norm = loop_norm(plant.closed_loop(self.controller), self.norm)
        if not np.isfinite(norm) and self.told:
            return dict.fromkeys(self.told, np.inf)
        found = {"norm": norm}
        load = self.load_with(values)
        if load is None:
            return found
        response = self.response(plant, load)
        for name in response.data_vars:
            if not str(name).startswith("price_"):  # which is a control once more
                found[f"{PEAK}{name}"] = float(np.abs(response[name]).max())
        return found | dict(self.figures(response) if self.figures else {})

    def plant_with(self, values: Mapping[str, Any]) -> GeneralizedPlant:
        """Return the plant with numbers of the machine in place of its own."""
        own = {name: value for name, value in values.items() if _room(name) == "machine"}
        if self.machine is None or all(map(needs_brush, self.names)):
            return self.plant
        changed = (
            replace(self.machine, **own)
            if isinstance(self.machine, AirBearingParameters)
            else self.machine.with_parameters(own)
        )
        with warnings.catch_warnings():
            # an effect without a linear part has been warned of when the plant was made
            warnings.simplefilter("ignore", RobustPolishWarning)
            return in_place_of(self.plant, self.plant_of(changed))

    def load_with(self, values: Mapping[str, Any]) -> xr.Dataset | None:
        """Return the disturbance; the brush is run if it is not the same for all."""
        if self.load is not None or self.duration is None:
            return self.load
        brush = self.brush.with_run(int(values["run"])) if "run" in values else self.brush
        changes = {_field(name): v for name, v in values.items() if _room(name) == "brush"}
        bends = {_field(name): v for name, v in values.items() if _room(name) == "surface"}
        if bends:
            changes["surface"] = replace(self.brush.surface, **bends)  # type: ignore[type-var]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RobustPolishWarning)  # of passes that do not agree
            found = simulate_brush(duration=self.duration, parameters=replace(brush, **changes))
        if not found.attrs["converged"]:
            raise SolverError("the passes of the brush's run do not agree")
        return found

    def response(self, plant: GeneralizedPlant, load: xr.Dataset) -> xr.Dataset:
        """Return all performance outputs and controls over time."""
        found = simulate(plant.with_control_outputs().closed_loop(self.controller), load)
        for name in found.data_vars:
            if name in plant.units:
                found[name].attrs["units"] = plant.units[str(name)]
        return found


def column(i: int) -> str:
    """Return the name by which a sweep hands over a number; keys of models are no identifiers."""
    return f"value_{i}"


def check_names(names: Mapping[str, Any], machine: Machine | None, brush: BrushParameters) -> None:
    """Refuse names that mean nothing to the machine, the brush or its surface."""
    known = [
        *_numbers(machine),
        *(f"brush.{item.name}" for item in fields(brush) if item.name not in ("surface", "path")),
        *(
            f"surface.{item.name}"
            for item in (fields(brush.surface) if isinstance(brush.surface, Surface) else ())
        ),
        "run",
    ]
    for name in names:
        if name not in known:
            expected = "a number of the machine, brush.NAME, surface.NAME or run"
            raise invalid(("distributions", name), name, expected, spelled(name, known))


def needs_brush(name: str) -> bool:
    """Tell whether a name belongs to the brush's run rather than to the machine."""
    return _room(name) != "machine"


def default_plant_of(machine: Machine | None, plant: GeneralizedPlant) -> PlantOf:
    """Return how plants are made of a machine if nobody says it."""
    if not isinstance(machine, AirBearingParameters):
        return linearized
    actuation = "force" if plant.units.get("u_x") == "N" else "displacement"
    measured = "state" if plant.ny == plant.nx else "displacement"
    return functools.partial(_air_bearing, actuation, measured)


def linearized(model: MechanicalModel) -> GeneralizedPlant:
    """Return a model's linear plant with its defaults."""
    return model.linearize()


def _air_bearing(
    actuation: Any, measured: Any, parameters: AirBearingParameters
) -> GeneralizedPlant:
    return air_bearing(parameters, actuation=actuation, measured=measured)


def _numbers(machine: Machine | None) -> list[str]:
    if isinstance(machine, AirBearingParameters):
        return [item.name for item in fields(machine) if item.name != "inertia_reading"]
    return list(machine.parameters) if machine is not None else []


def _room(name: str) -> str:
    head = name.partition(".")[0]
    return head if head in ("brush", "surface", "run") else "machine"


def _field(name: str) -> str:
    return name.partition(".")[2]
