"""Simulation of the polishing brush: motion and forces by the physical or the listed equations."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from robustpolish.base.budget import progress_bar
from robustpolish.base.checks import (
    described,
    instance_of,
    invalid,
    matrix,
    one_of,
    positive,
    whole_number,
)
from robustpolish.errors import SolverError
from robustpolish.plots.charts import plot_over_plane
from robustpolish.polishing import brush as physical
from robustpolish.polishing import contact
from robustpolish.polishing.parameters import BrushParameters
from robustpolish.polishing.surfaces.mould import Mould
from robustpolish.polishing.surfaces.surface import Floats, PolishedSurface
from robustpolish.polishing.thesis.listing import ListingDefects, Workaround, run_listing
from robustpolish.polishing.tool_path import ToolPath

# Fit of a brush in a mould: curvature against the radius of the brush.

_PLACES = 200  # along each side, at least


@dataclass(frozen=True, eq=False)
class BrushFit:
    """Where a disc of a radius fits into a mould.

    Attributes
    ----------
    radius : float
        Of the disc [m].
    curvature : xarray.DataArray
        Largest curvature [1/m] over `x` and `y` [m]; nan where there is no mould. The disc fits
        where it is below 1 / radius.
    sharpest : tuple of float
        x, y [m] and radius of curvature [m] of the sharpest hollow; of those on the path, if one
        was given.
    share_too_narrow, share_bulging : float
        Of the mould, or of the path: where the hollow is narrower than the disc, and where the
        mould bulges in all directions, so that the disc touches with its face.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> import robustpolish as rp
    >>> bowl = rp.polishing.Mould.from_formula(
    ...     "10*x**2 + 10*y**2", x=(-0.03, 0.03), y=(-0.03, 0.03)
    ... )
    >>> fit = rp.polishing.check_brush_fit(bowl, 0.010)
    >>> fit.explain()
    'A disc of 10 mm fits everywhere: the sharpest hollow has 50 mm, at x = 0 mm, y = 0 mm.'
    >>> fit.plot().get_xlabel()
    'x [mm]'
    >>> plt.close("all")
    """

    radius: float
    curvature: xr.DataArray = field(repr=False)
    sharpest: tuple[float, float, float]
    share_too_narrow: float
    share_bulging: float

    @property
    def fits(self) -> bool:
        """Whether the disc fits everywhere, whether it touches with its rim or its face."""
        return self.share_too_narrow == 0

    def explain(self) -> str:
        """Tell in words where the disc does not fit.

        Returns
        -------
        str
        """
        x, y, sharpest = self.sharpest
        where = f"x = {round(1e3 * x, 3):g} mm, y = {round(1e3 * y, 3):g} mm"
        words = (
            f"A disc of {1e3 * self.radius:.4g} mm "
            + ("fits everywhere" if self.fits else f"does not fit at {self.share_too_narrow:.1%}")
            + f": the sharpest hollow has {1e3 * sharpest:.4g} mm, at {where}."
        )
        if self.share_bulging:
            words += (
                f" At {self.share_bulging:.1%} the mould bulges in all directions; there the disc "
                "touches with its face, which the simulator refuses."
            )
        return words

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw radius times largest curvature over the mould; from 1 on the disc does not fit.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional

        Returns
        -------
        matplotlib.axes.Axes
        """
        shown = (self.radius * self.curvature).rename("radius x curvature")
        return plot_over_plane(shown.assign_attrs(units="1"), ax, level=1.0)


def check_brush_fit(
    mould: Mould, radius: float | None = None, path: ToolPath | None = None
) -> BrushFit:
    """Compare the curvature of a mould with the radius of a brush, and say where it does not fit.

    Parameters
    ----------
    mould : Mould
    radius : float, optional
        Of the disc [m]; that of ``BrushParameters()``.
    path : ToolPath, optional
        Judge only what its disc passes over. Without one the whole mould.

    Returns
    -------
    BrushFit

    Examples
    --------
    >>> import robustpolish as rp
    >>> groove = rp.polishing.Mould.from_formula("40*y**2", x=(-0.03, 0.03), y=(-0.02, 0.02))
    >>> fit = rp.polishing.check_brush_fit(groove, 0.010)
    >>> fit.fits, round(1e3 * fit.sharpest[2], 3)
    (True, 12.5)
    >>> print(rp.polishing.check_brush_fit(groove, 0.020).explain().split(":")[0])
    A disc of 20 mm does not fit at 37.6%
    """
    instance_of("mould", mould, Mould, "a Mould", "Make one with Mould.from_stl(...) or the like.")
    reach = BrushParameters().radius if radius is None else positive("radius", radius, "m")
    # So fine a grid that nothing sharp hides between its places.
    x, y = (
        np.linspace(
            axis[0], axis[-1], int(np.ceil(_PLACES / (axis.size - 1))) * (axis.size - 1) + 1
        )
        for axis in (mould.x, mould.y)
    )
    largest, _ = mould.principal_curvatures(x[:, None], y[None, :])
    judged = np.isfinite(largest)
    if path is not None:
        steps = max(2, int(8 * path.length / reach))
        near = np.zeros(judged.shape, dtype=bool)
        for here in path.position(np.linspace(0.0, path.duration, steps)).T:
            near |= np.hypot(x[:, None] - here[0], y[None, :] - here[1]) <= reach
        judged &= near
    found = np.where(judged, largest, -np.inf)
    i, j = np.unravel_index(int(np.argmax(found)), found.shape)
    sharpest = 1.0 / found[i, j] if found[i, j] > 0 else np.inf
    count = int(judged.sum())
    axes = {"x": ("x", x, {"units": "m"}), "y": ("y", y, {"units": "m"})}
    flat = 1e-9 + 1e-6 / reach  # a plane is no bulge, though rounding bends it
    return BrushFit(
        radius=reach,
        curvature=xr.DataArray(largest, axes, ("x", "y"), "curvature", {"units": "1/m"}),
        sharpest=(float(x[i]), float(y[j]), float(sharpest)),
        share_too_narrow=float(np.sum(found * reach >= 1.0)) / count,
        share_bulging=float(np.sum(judged & (largest < -flat))) / count,
    )


# Validity of the physical simulator on a surface, along the path of the tool.

_PER_RADIUS = 8  # places along the path per radius of the brush
_BULGE = 1e-6  # m, and
_SHARE_OF_DEPTH = 0.02  # what the middle of the disc may stand in the mould, by its penetration


def check_ground(parameters: BrushParameters, duration: float) -> None:
    """Refuse a path that ends too soon or leads the rim off the mould, and moulds that bulge.

    The simulator knows contact along the rim. It is there as long as the surface is hollow, or
    straight, in some direction at least: the depth of the disc's face in it is then largest at
    the end of a chord. Only where it bulges in all directions the face would touch first.
    """
    path, mould = parameters.path, parameters.surface
    if path is not None and path.duration < duration * (1 - 1e-9):
        shown = described(f"a path of {path.duration:.4g} s")
        remedy = "Shorten the duration, or go slower."
        raise invalid("path", shown, f"at least the duration, {duration:g} s", remedy)
    if not isinstance(mould, Mould):
        return
    rough = physical.tool_position(np.linspace(0.0, duration, 2001), parameters)
    length = float(np.sum(np.hypot(*np.diff(rough, axis=1))))
    count = max(32, int(np.ceil(1.5 * length * _PER_RADIUS / parameters.radius)))
    places = physical.tool_position(np.linspace(0.0, duration, count), parameters)

    def where(worst: Any) -> str:
        x, y = (round(1e3 * float(part), 2) + 0.0 for part in places[:, int(np.argmin(worst))])
        return f"around x = {x:g} mm, y = {y:g} mm"

    reach = parameters.rim_distance
    spare = mould.distance_to_edge(*places) - reach
    if spare.min() < 0:
        away = f"{-1e3 * spare.min():.3g} mm"
        shown = described(f"a path whose rim leaves the mould by {away} {where(spare)}")
        wanted = f"the mould to reach {1e3 * reach:.3g} mm around the path"
        raise invalid("path", shown, wanted, "Move or shrink the path, or give a larger mould.")
    least = largest_bends_under_disc(mould, places, parameters.radius).min(axis=1)
    bulge = -0.5 * float(least.min()) * parameters.radius**2
    depth = parameters.polishing_force / parameters.contact_stiffness
    if bulge > max(_BULGE, _SHARE_OF_DEPTH * depth):
        much = f"{1e6 * bulge:.3g} µm"
        shown = described(f"{mould.name}, which bulges by {much} under the disc {where(least)}")
        expected = "a surface that is hollow in some direction, where the disc touches with its rim"
        remedy = "Lead the path round the bulge; the simulator knows no contact of the disc's face."
        raise invalid("surface", shown, expected, remedy)


def largest_bends_under_disc(surface: PolishedSurface, places: Floats, radius: float) -> Floats:
    """Largest second derivatives in any direction at places on and within the rim [1/m].

    Returns
    -------
    ndarray, shape (n, 33)
        Under the disc at each place of the path.
    """
    angle = np.linspace(0.0, 2 * np.pi, 16, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle)])
    spots = np.concatenate([np.zeros((2, 1)), 0.5 * radius * ring, radius * ring], axis=1)
    x, y = (places[k][:, None] + spots[k] for k in (0, 1))
    r, s, t = surface.bends(x, y)
    return 0.5 * (r + t) + np.hypot(0.5 * (r - t), s)


# Options of each simulator, which the other one refuses.
_OPTIONS: dict[str, dict[str, Any]] = {
    "physical": {"disc": "two-angle", "start": "pressed", "max_passes": 4},
    "listing": {"defects": ListingDefects(), "workaround": "none"},
}
_RATTLES = (
    "With little contact damping the brush rattles chaotically and no step is small enough for "
    "more than its statistics: raise contact_damping, shorten the run, or raise tolerance."
)
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
    >>> signals = rp.polishing.simulate_brush(run=2, duration=0.02)
    >>> signals.sizes["time"], signals.F_z.attrs["units"], signals.attrs["converged"]
    (401, 'N', 1)
    >>> bool((signals.contact_force >= 0).all())
    True
    """
    one_of("simulator", simulator, ("physical", "listing"))
    asked = {"disc": disc, "start": start, "max_passes": max_passes}
    asked |= {"defects": defects, "workaround": workaround}
    given = {name: value for name, value in asked.items() if value is not None}
    own, listing = _OPTIONS[simulator], simulator == "listing"
    for name, value in given.items():
        if name not in own:
            expected = f"nothing, because the {simulator} simulator has no such option"
            raise invalid(name, value, expected, "Leave it out, or choose the other simulator.")
    chosen = own | given
    if listing:
        one_of("workaround", chosen["workaround"], ("none", "divide", "impulse"))
        if not isinstance(chosen["defects"], ListingDefects):
            remedy = "Pass ListingDefects(...)."
            raise invalid("defects", chosen["defects"], "ListingDefects", remedy)
    else:
        one_of("disc", chosen["disc"], ("two-angle", "three-angle"))
        one_of("start", chosen["start"], ("pressed", "landing"))
        whole_number("max_passes", chosen["max_passes"], 2, remedy="Allow more passes.")
    if parameters is None:
        parameters = BrushParameters.as_published() if listing else BrushParameters()
    remedy = "Build them with BrushParameters(...) or BrushParameters.for_run(...)."
    instance_of("parameters", parameters, BrushParameters, "BrushParameters", remedy)
    replaced: dict[str, Any] = {"surface": surface, "path": path}
    brush = replace(parameters, **{k: item for k, item in replaced.items() if item is not None})
    brush = brush if run is None else brush.with_run(run)
    seconds = positive("duration", duration, "s")
    rate = _SAMPLE_RATE[simulator] if sample_rate is None else sample_rate
    rate = positive("sample_rate", rate, "Hz")
    samples = round(seconds * rate)
    if samples < 1:
        expected = f"at least one sample of {1.0 / rate:g} s"
        raise invalid("duration", duration, expected, "Raise the duration or the sample rate.")
    time = np.arange(samples + 1) / rate
    limit = positive("tolerance", _TOLERANCE[simulator] if tolerance is None else tolerance)
    check_ground(brush, float(time[-1]))
    with progress_bar(f"Simulating the brush for {duration:g} s"):
        if listing:
            return run_listing(brush, time, relative=limit, **chosen)
        three, landing = chosen["disc"] == "three-angle", chosen["start"] == "landing"
        force, passes = brush.polishing_force, chosen["max_passes"]

        def attempt(level: int) -> Any:
            return physical.integrate(brush, time, level, three_angles=three, landing=landing), None

        found, _, check = physical.refined(attempt, force, limit, passes, _RATTLES)
        return physical.physical_dataset(found, check, brush, three)


def simulate_disc(
    time: ArrayLike,
    moment: ArrayLike,
    *,
    parameters: BrushParameters | None = None,
    disc: Literal["two-angle", "three-angle"] = "two-angle",
    initial: ArrayLike = (0.0, 0.0, 0.0, 0.0),
) -> xr.Dataset:
    """Integrate the equations of the spinning disc under given moments, without contact.

    I_0 w' = M - (M . k) k - I omega_z (w x k) and k' = w x k: (6.54) to (6.62) without their
    singularity, and exact for large tilts. Without a moment the disc keeps its axis (figure 9.5).

    Parameters
    ----------
    time : array_like, shape (n,)
        Rising [s].
    moment : array_like, shape (n, 3)
        About the ball joint, along world x, y and z [N m]; straight lines between the samples.
    parameters : BrushParameters, optional
        Inertias, spin, drive, path and surface; ``BrushParameters()`` by default.
    disc : {"two-angle", "three-angle"}, optional
        Two angles and an ideal drive; or three, whose spin obeys
        I omega_z' = M . k - spindle_damping (omega_z - spin).
    initial : array_like, shape (4,), optional
        theta, psi [rad], theta_rate and psi_rate [rad/s] at the first time: tilts about x and y,
        or nutation and precession. The spin begins at that of the parameters.

    Returns
    -------
    xarray.Dataset
        Along `time` [s]: `theta`, `psi`, `theta_rate`, `psi_rate`, and for the three-angle disc
        `phi`, `phi_rate` and `omega_z`, as from `simulate_brush`; `tool_x`, `tool_y`,
        `surface_height` [m] and `elevation` [rad] of the path.

    Raises
    ------
    InvalidInputError
        If an argument has another shape, is not finite, or the times do not rise.
    SolverError
        If the moments turn the disc too fast to be followed.

    References
    ----------
    M.L. Postma, Polishing robot: vibrations due to impact, sections 6.4 and 9.3.

    Examples
    --------
    A steady moment M about x turns a level disc about y, on average at M / (I p):

    >>> import numpy as np
    >>> import robustpolish as rp
    >>> time = np.linspace(0.0, 0.1, 501)
    >>> run = rp.polishing.simulate_disc(time, np.tile([1e-4, 0.0, 0.0], (501, 1)))
    >>> round(float(run.psi_rate.mean()), 3), round(1e-4 / (1e-5 * 100 * np.pi), 3)
    (0.032, 0.032)
    """
    one_of("disc", disc, ("two-angle", "three-angle"))
    brush = BrushParameters() if parameters is None else parameters
    instance_of("parameters", brush, BrushParameters, "BrushParameters", "Build them first.")
    times, three = np.array(time, dtype=float), disc == "three-angle"
    rising = times.ndim == 1 and len(times) > 1 and (np.diff(times) > 0).all()
    if not rising or not np.isfinite(times).all():
        shown = described(f"an array of shape {times.shape}")
        raise invalid("time", shown, "at least two rising times in s", "Sort them.")
    moments = np.ascontiguousarray(matrix("moment", moment, (len(times), 3)))
    first = matrix("initial", np.atleast_2d(initial), (1, 4))[0]
    state, motion = np.zeros(contact.STATES), physical.motion_constants(brush, three)
    axis, turning = contact.axis_and_turning(*first, euler=three)
    state[contact.AXES], state[contact.TURNINGS], state[contact.SPIN] = axis, turning, brush.spin
    # The axis has length 1; rates are measured by that of nutation, I p / I_0.
    scale, track = np.full(contact.STATES, np.inf), np.empty((len(times), contact.STATES))
    scale[contact.AXES] = 1.0
    scale[contact.TURNINGS] = scale[contact.SPIN] = 1.0 + (
        brush.spin * brush.spin_inertia / brush.tilt_inertia
    )
    reached = contact.advance_free(state, times, moments, 1e-12, scale, motion, track)
    if reached < len(times):
        raise SolverError(
            f"The disc turns too fast to be followed after {times[reached - 1]:.4g} s. Lower the "
            "moments, or check their unit, N m."
        )
    variables = physical.attitude_variables(track, three) | physical.path_variables(times, brush)
    about = {"simulator": "moments", "disc": disc, **physical.parameter_attributes(brush)}
    return xr.Dataset(variables, {"time": ("time", times, {"units": "s"})}, about)
