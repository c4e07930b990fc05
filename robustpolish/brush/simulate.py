"""The one way in: simulate the brush, get its motion and the forces it makes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.brush.ground import check_ground
from robustpolish.brush.listing.defects import ListingDefects
from robustpolish.brush.listing.run import Workaround, run_listing
from robustpolish.brush.parameters import BrushParameters
from robustpolish.brush.paths.tool_path import ToolPath
from robustpolish.brush.physical.dataset import physical_dataset
from robustpolish.brush.physical.run import run_refined
from robustpolish.brush.surfaces.polished_surface import PolishedSurface
from robustpolish.long_calls import working
from robustpolish.validation import instance_of, invalid, one_of, positive

_PHYSICAL = {"disc": "two-angle", "start": "pressed", "max_passes": 4}
_LISTING = {"defects": ListingDefects(), "workaround": "none"}
_SAMPLE_RATE = {"physical": 20e3, "listing": 1e5}
_TOLERANCE = {"physical": 2e-3, "listing": 1e-3}


def simulate_brush(
    simulator: Literal["physical", "listing"] = "physical",
    run: int | None = None,
    duration: float = 5.0,
    *,
    parameters: BrushParameters | None = None,
    surface: PolishedSurface | None = None,
    path: ToolPath | None = None,
    sample_rate: float | None = None,
    tolerance: float | None = None,
    disc: Literal["two-angle", "three-angle"] | None = None,
    start: Literal["pressed", "landing"] | None = None,
    max_passes: int | None = None,
    defects: ListingDefects | None = None,
    workaround: Workaround | None = None,
) -> xr.Dataset:
    r"""Simulate the polishing brush and the forces with which it disturbs the tool.

    Parameters
    ----------
    simulator : {"physical", "listing"}
        "physical": unilateral contact along the whole rim with damping, and friction against
        the slip of the spinning rim; well posed. "listing": the code of the thesis's
        appendix D with its mistakes, for reproducing the thesis.
    run : {1, 2, 3, 4}, optional
        Sets the contact stiffness to 1e4, 1e6, 1e8 or 1e10 N/m (table 9.2), also in given
        `parameters`. Without both, run 1.
    duration : float
        Simulated time [s].
    parameters : BrushParameters, optional
        Default: ``BrushParameters()`` for "physical", ``BrushParameters.as_published()`` for
        "listing".
    surface : Surface or Mould, optional
        What is polished, in place of that of the parameters; only "physical" knows moulds.
    path : ToolPath, optional
        Where the tool goes, in place of circling; only "physical".
    sample_rate : float, optional
        Samples of the result per second [Hz]. 20 kHz for "physical": no step is longer than a
        sample, and forces are averaged over each, so that straight lines through them have
        the impulse of the contact. 100 kHz for "listing": forces are those at the sample.
    tolerance : float, optional
        "physical": largest difference of the contact impulse over 10 ms between the last two of
        the passes with ever smaller steps and more rim points, relative to the impulse of the
        polishing force; 2e-3. "listing": relative tolerance of ode45; 1e-3.
    disc : {"two-angle", "three-angle"}, optional
        Only "physical". Two angles and an ideal drive, (6.59) to (6.62), the default; or three,
        (6.54) to (6.58), with a spin that friction slows down against the drive's damping.
    start : {"pressed", "landing"}, optional
        Only "physical". The disc begins parallel to the surface, pressed down by the polishing
        force, the default, or just touching it.
    max_passes : int, optional
        Only "physical". At most this many passes, 4, and at least 2; a warning tells when they
        did not agree.
    defects : ListingDefects, optional
        Only "listing". The mistakes to make; all of them by default.
    workaround : {"none", "divide", "impulse"}, optional
        Only "listing". What section 9.4.5 does to the impact forces: nothing, division by
        10000, or multiplication by the duration of impact.

    Returns
    -------
    xarray.Dataset
        Along `time` [s]: `theta`, `psi` [rad] and `theta_rate`, `psi_rate` [rad/s]; `F_x`, `F_y`,
        `F_z`, `F_p` [N]; `contact` by `point`; `tool_x`, `tool_y`, `surface_height` [m] and
        `elevation` [rad]. The attributes hold the parameters and say how exact the run is.

        "physical": theta and psi are tilts about x and y, zero when level, or for the
        three-angle disc nutation and precession, with `phi`, `phi_rate` and `omega_z`. A point is
        the quarter of the rim around +x (C1), -x (C2), +y (C3), -y (C4). Besides,
        `contact_force` [N] by `point`, `contact_share`, `contact_energy` [J], `friction_power`,
        `damping_power` [W], `tool_z` [m], `tool_z_rate` [m/s].

        "listing": theta is the tilt towards the feed and psi the roll about it, pi/2 when level;
        C1 is ahead, C2 behind, C3 and C4 at the sides. The gates by which D.2 and D.3 make
        forces depend on the bearing are open here; `listing_response` obeys them.

        Signs follow (8.45): the tool's equations are m x'' = ... - F_x, m y'' = ... - F_y,
        m z'' = ... + F_z, and m_z z_m'' = ... - F_p, so that F_x > 0 pushes the tool along -x
        and F_z > 0 lifts it.

    Raises
    ------
    InvalidInputError
        If an argument is out of its range, or belongs to the other simulator; if the path is
        shorter than the run or leads the rim off the mould; if the mould bulges under the disc.
    SolverError
        If the disc tips over or moves too fast to be followed.

    Warns
    -----
    RobustPolishWarning
        If the passes do not agree, as when the brush rattles for want of damping.

    Examples
    --------
    >>> import robustpolish as rp
    >>> signals = rp.simulate_brush(run=2, duration=0.02)
    >>> signals.sizes["time"], signals.F_z.attrs["units"], signals.attrs["converged"]
    (401, 'N', 1)
    >>> bool((signals.contact_force >= 0).all())
    True
    """
    one_of("simulator", simulator, ("physical", "listing"))
    given = {
        "disc": disc,
        "start": start,
        "max_passes": max_passes,
        "defects": defects,
        "workaround": workaround,
    }
    options = _options(simulator, given)
    chosen = _parameters(simulator, run, parameters, surface, path)
    rate = _SAMPLE_RATE[simulator] if sample_rate is None else sample_rate
    time = _sample_times(duration, rate)
    limit = positive("tolerance", _TOLERANCE[simulator] if tolerance is None else tolerance)
    check_ground(chosen, float(time[-1]))
    with working(f"Simulating the brush for {duration:g} s"):
        return _run(simulator, chosen, time, limit, options)


def _run(
    simulator: str,
    chosen: BrushParameters,
    time: NDArray[np.float64],
    limit: float,
    options: dict[str, Any],
) -> xr.Dataset:
    """Run a simulator with checked options."""
    if simulator == "listing":
        return run_listing(chosen, time, relative=limit, **options)
    three_angles = options["disc"] == "three-angle"
    result, check = run_refined(
        chosen,
        time,
        three_angles=three_angles,
        landing=options["start"] == "landing",
        tolerance=limit,
        max_passes=options["max_passes"],
    )
    return physical_dataset(result, check, chosen, three_angles)


def _options(simulator: str, given: dict[str, Any]) -> dict[str, Any]:
    """Check the options of one simulator, fill in its defaults, and refuse the other's."""
    defaults, foreign = (_PHYSICAL, _LISTING) if simulator == "physical" else (_LISTING, _PHYSICAL)
    for name in foreign:
        if given[name] is not None:
            raise invalid(
                name,
                given[name],
                f"nothing, because the {simulator} simulator has no such option",
                "Leave it out, or choose the other simulator.",
            )
    options = {
        name: default if given[name] is None else given[name] for name, default in defaults.items()
    }
    if simulator == "listing":
        one_of("workaround", options["workaround"], ("none", "divide", "impulse"))
        if not isinstance(options["defects"], ListingDefects):
            raise invalid(
                "defects", options["defects"], "ListingDefects", "Pass ListingDefects(...)."
            )
        return options
    one_of("disc", options["disc"], ("two-angle", "three-angle"))
    one_of("start", options["start"], ("pressed", "landing"))
    passes = options["max_passes"]
    if not isinstance(passes, int) or passes < 2:
        raise invalid("max_passes", passes, "an integer of at least 2", "Allow more passes.")
    return options


def _sample_times(duration: float, sample_rate: float) -> NDArray[np.float64]:
    seconds = positive("duration", duration, "s")
    rate = positive("sample_rate", sample_rate, "Hz")
    samples = round(seconds * rate)
    if samples < 1:
        raise invalid(
            "duration",
            duration,
            f"at least one sample of {1.0 / rate:g} s",
            "Raise the duration or the sample rate.",
        )
    return np.arange(samples + 1) / rate


def _parameters(
    simulator: str,
    run: int | None,
    parameters: BrushParameters | None,
    surface: PolishedSurface | None,
    path: ToolPath | None,
) -> BrushParameters:
    if parameters is None:
        listed = simulator == "listing"
        parameters = BrushParameters.as_published() if listed else BrushParameters()
    remedy = "Build them with BrushParameters(...) or BrushParameters.for_run(...)."
    instance_of("parameters", parameters, BrushParameters, "BrushParameters", remedy)
    given = {"surface": surface, "path": path}
    changes: dict[str, Any] = {name: item for name, item in given.items() if item is not None}
    changed = replace(parameters, **changes) if changes else parameters
    return changed if run is None else changed.with_run(run)
