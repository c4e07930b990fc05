"""What each limit of the hardware costs: each relaxed alone, and the controller designed anew."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from robustpolish.analysis import hinf_norm
from robustpolish.closed_loop.buildable_axis import POLICY, AxisDesign, AxisProblem, design_axis
from robustpolish.closed_loop.simulation import simulate
from robustpolish.errors import RobustPolishError
from robustpolish.loops import LoopRequirements
from robustpolish.models import PolishingHardware
from robustpolish.synthesis import Design

BUILDABLE = "as it can be built"
IDEAL = "the thesis's ideal"


@dataclass(frozen=True)
class HardwareLimit:
    """A row of the table of what reality costs.

    Attributes
    ----------
    what : str
        What is relaxed.
    norm : float
        H-infinity norm from the brush's force to its displacement along the axis, in m/N, of
        the sampled loop; nan if no design was found.
    deviation : float
        Largest deviation along the axis during the landing, in m.
    stiffness : float
        That the weights asked for, in N/m; nan where there were none.
    effort : float
        Largest force of the actuator, in N.

    Examples
    --------
    >>> from robustpolish.closed_loop import HardwareLimit
    >>> HardwareLimit("no delay", 1e-6, 3e-6, 1e7, 8.0).norm
    1e-06
    """

    what: str
    norm: float
    deviation: float
    stiffness: float
    effort: float


def relaxed(hardware: PolishingHardware) -> Iterator[tuple[str, PolishingHardware]]:
    """Yield the hardware with one limit relaxed at a time, and what that is."""
    yield "ideal sensors", replace(hardware, sensor_bandwidth_hz=math.inf, sensor_noise=0.0)
    yield (
        "ideal actuators",
        replace(hardware, actuator_bandwidth_hz=math.inf, actuator_limit=math.inf),
    )
    yield "no computation delay", replace(hardware, computation_delay=0.0)
    yield "ten times the sampling", replace(hardware, sample_rate_hz=10 * hardware.sample_rate_hz)


def limits_of_hardware(
    design: AxisDesign, ideal: Design, load: xr.Dataset, requirements: LoopRequirements
) -> tuple[HardwareLimit, ...]:
    """Return the rows: without control, as built, one limit relaxed at a time, the ideal."""
    problem, axis = design.problem, design.problem.axis
    start = load["time"].values[0]
    landing = load.sel(time=slice(start, start + POLICY.deviation_window))
    plant = ideal.plant
    force, shown = f"F_{axis}", plant.performance_names.index(axis)
    column = plant.disturbance_names.index(force)
    rows = [
        HardwareLimit(
            "without control",
            hinf_norm(plant.open_loop[shown, column]).value,
            _largest(simulate(plant, landing), axis),
            math.nan,
            0.0,
        ),
        _row(BUILDABLE, design, landing),
    ]
    for what, hardware in relaxed(problem.hardware):
        try:
            found = design_axis(
                AxisProblem(axis, hardware, problem.parameters, problem.dissipation), requirements
            )
        except RobustPolishError:
            rows.append(HardwareLimit(what, math.nan, math.nan, math.nan, math.nan))
            continue
        rows.append(_row(what, found, landing))
    run = simulate(ideal, landing)
    loop = plant.state_feedback_loop(ideal.controller.D)
    norm = hinf_norm(loop[shown, column]).value
    effort = _largest(run, f"u_{axis}")
    rows.append(HardwareLimit(IDEAL, norm, _largest(run, axis), math.nan, effort))
    return tuple(rows)


def _row(what: str, design: AxisDesign, landing: xr.Dataset) -> HardwareLimit:
    axis, run = design.problem.axis, design.sampled.simulate(landing)
    norm = design.sampled.certificate.achieved
    effort = _largest(run, f"u_{axis}")
    return HardwareLimit(what, norm, _largest(run, axis), design.stiffness, effort)


def _largest(run: xr.Dataset, name: str) -> float:
    return float(np.abs(run[name]).max())
