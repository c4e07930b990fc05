"""``monte_carlo``: a design's loop around machines, surfaces and brushes that are drawn."""

from __future__ import annotations

import os
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import xarray as xr

from robustpolish.brush import BrushParameters
from robustpolish.closed_loop.studies.sampled_loops import SampledLoops
from robustpolish.closed_loop.studies.trial import (
    PEAK,
    Figures,
    Machine,
    PlantOf,
    Trial,
    check_names,
    column,
    default_plant_of,
    needs_brush,
)
from robustpolish.models import AirBearingParameters, MechanicalModel, air_bearing
from robustpolish.sweeps import sweep
from robustpolish.sweeps.distributions import draws
from robustpolish.synthesis.design.checked import checked_design
from robustpolish.synthesis.design.design import Design
from robustpolish.validation import described, instance_of, invalid, is_whole, positive


def monte_carlo(
    design: Design,
    distributions: Mapping[str, Any],
    *,
    machine: Machine | None = None,
    plant_of: PlantOf | None = None,
    duration: float | None = None,
    brush: BrushParameters | None = None,
    disturbance: xr.Dataset | None = None,
    figures: Figures | None = None,
    samples: int = 200,
    seed: int = 0,
    executor: Executor | Literal["serial"] | None = None,
    file: str | os.PathLike[str] | None = None,
    progress: bool = True,
) -> SampledLoops:
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
    >>> study = rp.monte_carlo(
    ...     design, {"brush_mass": (0.18, 0.22), "brush.friction": ("normal", 0.35, 0.03)},
    ...     duration=0.01, samples=20, executor="serial")
    >>> study.failures, study.dataset["peak_y"].attrs["units"]
    ({}, 'm')
    >>> bool(study.percentile("peak_y", 95) >= study.percentile("peak_y", 50))
    True
    """
    checked_design("design", design)
    brush = BrushParameters() if brush is None else brush
    remedy = "Build them with BrushParameters(...)."
    instance_of("brush", brush, BrushParameters, "BrushParameters", remedy)
    machine = _machine(design, machine)
    if not isinstance(distributions, Mapping) or not distributions:
        remedy = 'Write {"brush.friction": ("normal", 0.35, 0.05)}, for example.'
        raise invalid("distributions", distributions, "a distribution by name", remedy)
    check_names(distributions, machine, brush)
    _check_load(distributions, duration, disturbance)
    for name, value, least in (("samples", samples, 1), ("seed", seed, 0)):
        if not is_whole(value) or value < least:
            raise invalid(name, value, f"a whole number, at least {least}", "Write 200.")
    trial = Trial(
        plant=design.plant,
        controller=design.controller,
        norm=design.norm,
        machine=machine,
        plant_of=plant_of or default_plant_of(machine, design.plant),
        brush=brush,
        duration=duration,
        load=disturbance,
        figures=figures,
        names=tuple(sorted(distributions)),
    )
    trial, nominal = _with_nominal(trial, any(map(needs_brush, distributions)))
    drawn = draws(distributions, int(samples), int(seed))
    points = [{column(i): one[name] for i, name in enumerate(trial.names)} for one in drawn]
    found = sweep(trial, points, executor=executor, file=file, progress=progress)
    return SampledLoops(_named(found, trial), nominal, seed, trial)


def _machine(design: Design, machine: Any) -> Machine | None:
    if machine is None:
        # Any other plant has numbers that only its maker knows: brush and surface may be drawn.
        same = design.plant.states == air_bearing().states
        return AirBearingParameters() if same else None
    kinds, expected = (MechanicalModel, AirBearingParameters), "a model or AirBearingParameters"
    return instance_of("machine", machine, kinds, expected, "Pass what the plant was made of.")


def _check_load(
    distributions: Mapping[str, Any], duration: float | None, disturbance: xr.Dataset | None
) -> None:
    asked = [name for name in distributions if needs_brush(name)]
    if duration is not None:
        positive("duration", duration, "s")
        if disturbance is not None:
            remedy = "Leave out duration, or the disturbance."
            raise invalid("disturbance", described("a Dataset and a duration"), "one", remedy)
    elif asked:
        expected = f"a time in s for which the brush runs, for {asked[0]} is drawn"
        raise invalid("duration", None, expected, "Write duration=1.0.")


def _with_nominal(trial: Trial, brush_is_drawn: bool) -> tuple[Trial, dict[str, float]]:
    """Run the nominal loop, and keep its load if it is that of all loops."""
    load = trial.load_with({})
    nominal = replace(trial, load=load).figures_of({})
    if not np.isfinite(nominal["norm"]):
        expected = "a design whose loop is stable with the nominal numbers"
        raise invalid("design", described("an unstable loop"), expected, "Check the machine.")
    told = tuple(nominal)
    if brush_is_drawn or load is None:
        return replace(trial, told=told), nominal
    # Workers get what drives the loop, not all that the brush tells.
    driving = [name for name in trial.plant.disturbance_names if name in load]
    return replace(trial, load=load[driving], told=told), nominal


def _named(found: xr.Dataset, trial: Trial) -> xr.Dataset:
    """Return a sweep's Dataset with the names of what was drawn, and units of the peaks."""
    named = found.rename({column(i): name for i, name in enumerate(trial.names)})
    for name in trial.told:
        if name not in named:  # no sample has figures
            named[name] = ("sample", np.full(named.sizes["sample"], np.nan))
        unit = trial.plant.units.get(name.removeprefix(PEAK))
        if name.startswith(PEAK) and unit:
            named[name].attrs["units"] = unit
    return named
