"""Monte Carlo over machines, surfaces and brushes, with the air bearing as the usual machine."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass, fields, replace
from typing import Any, Literal

import xarray as xr

from robustpolish.base.checks import closest_name_remedy, described, instance_of, invalid, positive
from robustpolish.closed_loop import sampled_loops
from robustpolish.errors import RobustPolishWarning, SolverError
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.polishing.air_bearing import AirBearingParameters, air_bearing
from robustpolish.polishing.parameters import NUMBERS, BrushParameters
from robustpolish.polishing.quantities import or_default
from robustpolish.polishing.simulate import simulate_brush
from robustpolish.polishing.surfaces.surface import Surface
from robustpolish.synthesis.design import Design, checked_design

Machine = MechanicalModel | AirBearingParameters


def monte_carlo(
    design: Design,
    distributions: Mapping[str, Any],
    *,
    machine: Machine | None = None,
    plant_of: sampled_loops.PlantOf | None = None,
    duration: float | None = None,
    brush: BrushParameters | None = None,
    disturbance: xr.Dataset | None = None,
    figures: sampled_loops.Figures | None = None,
    samples: int = 200,
    seed: int = 0,
    executor: Executor | Literal["serial"] | None = None,
    file: str | os.PathLike[str] | None = None,
    progress: bool = True,
) -> sampled_loops.SampledLoops:
    """Close a design's loop around machines and brushes whose numbers are drawn.

    Every sample is a machine, linearised anew, with the controller as it is: its norm, and its
    largest deviations and controls under the brush or a given disturbance.

    Parameters
    ----------
    design : Design
    distributions : mapping of str to distribution
        Of numbers of the machine, by the keys of ``machine.parameters`` or the fields of
        :class:`AirBearingParameters`; of the brush, ``brush.friction`` and other fields of
        :class:`BrushParameters`; of its trough, ``surface.along`` and ``surface.across``; and of
        `run`, 1 to 4. A frozen distribution of ``scipy.stats``; ``(low, high)``;
        ``("normal", mean, deviation)``, ``("uniform", low, high)``, ``("triangular", low, mode,
        high)`` or ``("lognormal", median, deviation of the logarithm)``; a list, of whose values
        each is as likely. All are independent, in the units of their numbers.
    machine : MechanicalModel or AirBearingParameters, optional
        What is drawn around. By default the air bearing, if the design's plant has its states.
    plant_of : callable, optional
        Makes a plant of a machine in the way in which the design's plant was made. By default the
        air bearing with the same actuation and measurement, or ``model.linearize()``.
    duration : float, optional
        Runs the physical brush for this time in s, for each sample if `distributions` asks for it,
        else once.
    brush : BrushParameters, optional
        Of the brush's run.
    disturbance : xarray.Dataset, optional
        In place of the brush: what drives all loops, as for :func:`simulate`.
    figures : callable, optional
        Takes the response of a loop, a Dataset over `time`, and returns further figures of merit,
        a mapping of names to numbers of which large ones are bad.
    samples, seed : int, optional
        The same seed draws the same numbers, on any number of workers. More samples begin with
        the same ones, and a further distribution leaves the draws of the others as they are.
    executor, file, progress : optional
        As for :func:`sweep`: local processes by default; `file` keeps what is finished.

    Returns
    -------
    SampledLoops
        Samples and figures as a Dataset, percentiles and shares with confidence limits, and the
        worst sample to be run once more by ``replay()``.

    Raises
    ------
    InvalidInputError
        If a name or a distribution means nothing, if the design does not belong to plants of this
        machine, or if workers cannot import `plant_of` or `figures`.

    Notes
    -----
    A draw of which no machine can be made, or whose brush cannot be simulated, is a failure with
    its reason; it counts as worse than every figure. No sample proves all machines:
    :func:`robust_stability` and :func:`worst_case_gain` do.

    Examples
    --------
    >>> import robustpolish as rp
    >>> plant = rp.air_bearing(actuation="force")
    >>> design = rp.state_feedback(plant, method="riccati", control_weight=1e-7)
    >>> study = rp.polishing.monte_carlo(
    ...     design, {"brush_mass": (0.18, 0.22), "brush.friction": ("normal", 0.35, 0.03)},
    ...     duration=0.01, samples=20, executor="serial")
    >>> study.failures, study.dataset["peak_y"].attrs["units"]
    ({}, 'm')
    >>> bool(study.percentile("peak_y", 95) >= study.percentile("peak_y", 50))
    True
    """
    checked_design("design", design)
    brush = or_default("brush", brush, BrushParameters)
    plant = design.plant
    if machine is not None:
        kinds, expected = (MechanicalModel, AirBearingParameters), "a model or AirBearingParameters"
        instance_of("machine", machine, kinds, expected, "Pass what the plant was made of.")
    elif plant.states == air_bearing().states:
        # Any other plant has numbers that only its maker knows: brush and surface may be drawn.
        machine = AirBearingParameters()
    if not isinstance(distributions, Mapping) or not distributions:
        remedy = 'Write {"brush.friction": ("normal", 0.35, 0.05)}, for example.'
        raise invalid("distributions", distributions, "a distribution by name", remedy)
    of_machine = list(machine.parameters) if isinstance(machine, MechanicalModel) else []
    if isinstance(machine, AirBearingParameters):
        of_machine = [item.name for item in fields(machine) if item.metadata["unit"]]
    surface = fields(brush.surface) if isinstance(brush.surface, Surface) else ()
    of_load = [f"brush.{name}" for name in NUMBERS]
    of_load += [*(f"surface.{item.name}" for item in surface), "run"]
    for name in distributions:
        if name not in (*of_machine, *of_load):
            expected = "a number of the machine, brush.NAME, surface.NAME or run"
            remedy = closest_name_remedy(name, [*of_machine, *of_load])
            raise invalid(("distributions", name), name, expected, remedy)
    drawn = [name for name in distributions if name in of_load]
    if duration is not None:
        positive("duration", duration, "s")
        if disturbance is not None:
            remedy = "Leave out duration, or the disturbance."
            raise invalid("disturbance", described("a Dataset and a duration"), "one", remedy)
    elif drawn:
        expected = f"a time in s for which the brush runs, for {drawn[0]} is drawn"
        raise invalid("duration", None, expected, "Write duration=1.0.")
    sampled = None
    if machine is not None and len(drawn) < len(distributions):
        if isinstance(machine, MechanicalModel):
            sampled = sampled_loops.SampledModel(machine, plant_of)
        else:
            actuation = "force" if plant.units.get("u_x") == "N" else "displacement"
            measured = "state" if plant.ny == plant.nx else "displacement"
            sampled = _SampledBearing(machine, plant_of, actuation, measured)
    load = disturbance if duration is None else _BrushRun(brush, duration)
    how: dict[str, Any] = {"figures": figures, "samples": samples, "seed": seed, "file": file}
    how |= {"load_is_drawn": bool(drawn), "executor": executor, "progress": progress}
    return sampled_loops.sample_loops(design, distributions, sampled, load, **how)


@dataclass(frozen=True)
class _SampledBearing:
    """The air bearing as a machine whose numbers are drawn, made into plants like a given one."""

    parameters: AirBearingParameters
    plant_of: sampled_loops.PlantOf | None
    actuation: Any
    measured: Any

    def plant(self, values: Mapping[str, Any]) -> GeneralizedPlant:
        """Return the plant with these numbers."""
        own = {name: v for name, v in values.items() if hasattr(self.parameters, name)}
        changed = replace(self.parameters, **own)
        if self.plant_of is not None:
            return self.plant_of(changed)
        return air_bearing(changed, actuation=self.actuation, measured=self.measured)


@dataclass(frozen=True)
class _BrushRun:
    """The physical brush as a disturbance whose numbers are drawn."""

    brush: BrushParameters
    duration: float

    def dataset(self, values: Mapping[str, Any]) -> xr.Dataset:
        """Return the forces of the brush with these numbers."""
        brush = self.brush.with_run(int(values["run"])) if "run" in values else self.brush
        changes, bends = (
            {name.removeprefix(of): v for name, v in values.items() if name.startswith(of)}
            for of in ("brush.", "surface.")
        )
        if bends:
            changes["surface"] = replace(self.brush.surface, **bends)  # type: ignore[type-var]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RobustPolishWarning)  # of passes that do not agree
            found = simulate_brush(duration=self.duration, parameters=replace(brush, **changes))
        if not found.attrs["converged"]:
            raise SolverError("the passes of the brush's run do not agree")
        return found
