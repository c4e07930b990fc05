"""Controller design for the air bearing, and its simulation under the forces of the brush."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import xarray as xr

from robustpolish.base.checks import described, invalid, one_of
from robustpolish.polishing.air_bearing import AirBearingParameters, air_bearing
from robustpolish.polishing.buildable import build_against_brush
from robustpolish.polishing.hardware import PolishingHardware
from robustpolish.polishing.ideal import BrushDesign, ideal_against_brush
from robustpolish.polishing.quantities import or_default
from robustpolish.polishing.simulate import simulate_brush

Realisation = Literal["buildable", "ideal"]


def design_against_brush(
    run: int = 1,
    simulator: Literal["physical", "listing"] = "physical",
    *,
    realisation: Realisation | None = None,
    hardware: PolishingHardware | None = None,
    actuation: Literal["force", "displacement"] | None = None,
    norm: Literal["hinf", "h2"] | None = None,
    method: Literal["lmi", "riccati"] | None = None,
    backend: Literal["cvxpy", "picos"] | None = None,
    control_weight: float | None = None,
    gain_bound: float | None = None,
    parameters: AirBearingParameters | None = None,
    dissipation: float = 0.001,
    duration: float = 5.0,
    tell: Callable[[str], None] = lambda _: None,
) -> BrushDesign:
    """Build the machine, disturb it, design a controller, certify it, compare.

    Parameters
    ----------
    run : {1, 2, 3, 4}, optional
        Contact stiffness of the brush (table 9.2).
    simulator : {"physical", "listing"}, optional
        As in :func:`robustpolish.polishing.simulate_brush`.
    realisation : {"buildable", "ideal"}, optional
        "buildable": two gap sensors, two actuators, a computer with its delay and samples, as
        `hardware` says. "ideal": the thesis's state feedback, which measures twelve states
        without noise and applies six forces without delay. By default what can be built, unless an
        option of the ideal is given.
    hardware : PolishingHardware, optional
        Of the buildable controller.
    actuation, norm, method, backend, control_weight, gain_bound : optional
        Of the ideal: as in :func:`robustpolish.air_bearing`, forces by default, and in
        :func:`robustpolish.state_feedback`. Without weight and bound the infimum would be
        zero, at infinite gain; then a force costs 1e-7 m/N and a velocity 1e-8 m per m/s.
    parameters, dissipation : optional
        As in :func:`robustpolish.air_bearing`.
    duration : float, optional
        Simulated time in s.
    tell : callable, optional
        Is told what is being done.

    Returns
    -------
    BrushDesign
        A :class:`BuildableBrushDesign`, which has the ideal beside it, unless the ideal is asked
        for.

    Raises
    ------
    InvalidInputError, InfeasibleError, SolverError
        As the functions above; also if options of both are given, and if no controller keeps its
        margins with the hardware.

    Examples
    --------
    >>> import robustpolish as rp
    >>> job = rp.polishing.design_against_brush(duration=0.05, realisation="ideal")
    >>> job.design.certificate.valid
    True
    >>> bool(job.comparison.table["improvement"].sel(row="with control", signal="y") > 90)
    True
    """
    given: dict[str, Any] = {"actuation": actuation, "norm": norm, "method": method}
    given |= {"backend": backend, "control_weight": control_weight, "gain_bound": gain_bound}
    options = {name: value for name, value in given.items() if value is not None}
    parts = or_default("hardware", hardware, PolishingHardware)
    if realisation is None:
        realisation = "ideal" if options else "buildable"
    one_of("realisation", realisation, ("buildable", "ideal"))
    if realisation == "ideal" and hardware is not None:
        shown = described("hardware of an ideal controller")
        raise invalid("hardware", shown, "none", "Leave it out, or the options of the ideal.")
    if realisation == "buildable" and options:
        name = next(iter(options))
        remedy = "Pass realisation='ideal', or leave it out and set hardware=."
        raise invalid(name, options[name], "nothing for a controller that can be built", remedy)
    machine = or_default("parameters", parameters, AirBearingParameters)
    entry = options.pop("actuation", "force")
    plant = air_bearing(machine, dissipation, entry)

    def load() -> xr.Dataset:
        tell(f"Simulating the brush for {duration:g} s (run {run}, {simulator}) ...")
        return simulate_brush(simulator, run, duration)

    ideal = ideal_against_brush(plant, machine, load, entry, tell, **options)
    if realisation == "ideal":
        return ideal
    return build_against_brush(ideal, parts, dissipation, tell=tell)
