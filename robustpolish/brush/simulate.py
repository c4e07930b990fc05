"""The one way in: simulate the brush, get its motion and the forces it makes."""

from __future__ import annotations

from typing import Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.brush.dataset import physical_dataset
from robustpolish.brush.parameters import BrushParameters
from robustpolish.brush.physical import run_refined
from robustpolish.validation import described, invalid, one_of, positive


def simulate_brush(
    simulator: Literal["physical", "listing"] = "physical",
    run: int | None = None,
    duration: float = 5.0,
    *,
    parameters: BrushParameters | None = None,
    sample_rate: float = 20e3,
    disc: Literal["two-angle", "three-angle"] = "two-angle",
    start: Literal["pressed", "landing"] = "pressed",
    tolerance: float = 2e-3,
    max_passes: int = 4,
) -> xr.Dataset:
    r"""Simulate the polishing brush and the forces with which it disturbs the tool.

    Parameters
    ----------
    simulator : {"physical", "listing"}
        "physical": unilateral contact along the whole rim with damping, and friction against
        the slip of the spinning rim; well posed. "listing": the code of the thesis's
        appendix D, see `simulate_listing` for its own choices.
    run : {1, 2, 3, 4}, optional
        Sets the contact stiffness to 1e4, 1e6, 1e8 or 1e10 N/m (table 9.2), also in given
        `parameters`. Without both, run 1.
    duration : float
        Simulated time [s].
    parameters : BrushParameters, optional
        Default: ``BrushParameters()`` for "physical", ``BrushParameters.as_published()`` for
        "listing".
    sample_rate : float
        Samples per second of the result [Hz]; forces are averaged over each sample, so that
        straight lines through them have the impulse of the contact. Also bounds the step.
    disc : {"two-angle", "three-angle"}
        Two angles and an ideal drive, (6.59) to (6.62), or three, (6.54) to (6.58), with a
        spin that friction slows down against the drive's damping.
    start : {"pressed", "landing"}
        The disc begins parallel to the surface, pressed down by the polishing force, or
        just touching it.
    tolerance : float
        Largest difference of the contact impulse over 10 ms between the last two of the
        passes with ever smaller steps and more rim points, relative to the impulse of the
        polishing force.
    max_passes : int
        At most this many passes, at least 2; a warning tells when they did not agree.

    Returns
    -------
    xarray.Dataset
        Along `time` [s]: `theta`, `psi` [rad] and `theta_rate`, `psi_rate` [rad/s] (tilts about
        x and y, zero when level; for the three-angle disc nutation and precession, with `phi`,
        `phi_rate` and `omega_z`); `F_x`, `F_y`, `F_z`, `F_p` [N]; `contact_share`; `contact_force`
        [N] by `point`, the normal force on the quarter of the rim around +x (C1), -x (C2), +y (C3), -y (C4);
        `friction_power`, `damping_power` [W], `contact_energy` [J]; `tool_x`, `tool_y`, `tool_z`,
        `surface_height` [m], `elevation` [rad]. The attributes say how exact the run is.

        Signs follow (8.45): the tool's equations are m x'' = ... - F_x, m y'' = ... - F_y,
        m z'' = ... + F_z, and m_z z_m'' = ... - F_p, so that F_x > 0 pushes the tool along -x
        and F_z > 0 lifts it.

    Raises
    ------
    InvalidInputError
        If an argument is out of its range.
    SolverError
        If the disc tips over or moves too fast to be followed.

    Warns
    -----
    RobustPolishWarning
        If the passes do not agree, as when the brush rattles for want of damping.

    Examples
    --------
    >>> from robustpolish.brush import simulate_brush
    >>> signals = simulate_brush(run=2, duration=0.02)
    >>> signals.sizes["time"], signals.F_z.attrs["units"], signals.attrs["converged"]
    (401, 'N', 1)
    >>> bool((signals.contact_force >= 0).all())
    True
    """
    one_of("simulator", simulator, ("physical",))
    one_of("disc", disc, ("two-angle", "three-angle"))
    one_of("start", start, ("pressed", "landing"))
    positive("tolerance", tolerance)
    if not isinstance(max_passes, int) or max_passes < 2:
        raise invalid("max_passes", max_passes, "an integer of at least 2", "Allow more passes.")
    time = _sample_times(duration, sample_rate)
    chosen = _parameters(simulator, run, parameters)
    three_angles = disc == "three-angle"
    result, check = run_refined(
        chosen,
        time,
        three_angles=three_angles,
        landing=start == "landing",
        tolerance=tolerance,
        max_passes=max_passes,
    )
    return physical_dataset(result, check, chosen, three_angles)


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
    simulator: str, run: int | None, parameters: BrushParameters | None
) -> BrushParameters:
    if parameters is None:
        listed = simulator == "listing"
        parameters = BrushParameters.as_published() if listed else BrushParameters()
    elif not isinstance(parameters, BrushParameters):
        raise invalid(
            "parameters",
            described(type(parameters).__name__),
            "BrushParameters",
            "Build them with BrushParameters(...) or BrushParameters.for_run(...).",
        )
    return parameters if run is None else parameters.with_run(run)
