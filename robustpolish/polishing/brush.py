"""Physical simulator of the brush, refined until impulses agree; datasets of both simulators."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import ceil, pi, sqrt
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from robustpolish.base.arrays import AnyArray, Array
from robustpolish.errors import RobustPolishWarning, SolverError
from robustpolish.polishing import contact
from robustpolish.polishing.contact import euler_angles, tilt_angles
from robustpolish.polishing.parameters import NUMBERS, BrushParameters
from robustpolish.polishing.surfaces.surface import Surface

# Position of the tool's centre: circling feed (eqs. 9.2 and 9.3), or a given path.


def tool_position(time: ArrayLike, parameters: BrushParameters) -> NDArray[np.float64]:
    """Place of the tool's centre: on the path of the parameters, or circling (eq. 9.2).

    Parameters
    ----------
    time : array_like
        Times [s].
    parameters : BrushParameters
        The path, or radius and rate of the circling, feed, and brush radius.

    Returns
    -------
    ndarray, shape (2, ...)
        x and y in world axes [m].

    Examples
    --------
    >>> import robustpolish as rp
    >>> from robustpolish.polishing import tool_position
    >>> tool_position(0.0, rp.polishing.BrushParameters()).round(4).tolist()
    [0.016, 0.0]
    """
    if parameters.path is not None:
        return parameters.path.position(time)
    moment = np.asarray(time, dtype=float)
    turn, circle = parameters.rotation_rate * moment, parameters.rotation_radius
    x = circle * np.cos(turn) + parameters.feed * moment + (parameters.radius + circle)
    return np.stack([x, circle * np.sin(turn)])


def tool_velocity(time: ArrayLike, parameters: BrushParameters) -> NDArray[np.float64]:
    """Velocity of the tool's centre: on the path of the parameters, or circling (eq. 9.3).

    Parameters
    ----------
    time : array_like
        Times [s].
    parameters : BrushParameters
        The path, or radius and rate of the circling, and feed.

    Returns
    -------
    ndarray, shape (2, ...)
        Components along x and y in world axes [m/s].

    Examples
    --------
    >>> import robustpolish as rp
    >>> from robustpolish.polishing import tool_velocity
    >>> tool_velocity(0.0, rp.polishing.BrushParameters()).round(4).tolist()
    [0.001, 0.0377]
    """
    if parameters.path is not None:
        return parameters.path.velocity(time)
    turn = parameters.rotation_rate * np.asarray(time, dtype=float)
    speed = parameters.rotation_radius * parameters.rotation_rate
    return np.stack([parameters.feed - speed * np.sin(turn), speed * np.cos(turn)])


Variable = tuple[Any, AnyArray, dict[str, Any]]

POINTS = ("C1", "C2", "C3", "C4")

_FORCE_TEXT = {
    "F_x": "force on the tool along -x",
    "F_y": "force on the tool along -y",
    "F_z": "force on the tool along +z, away from the surface",
    "F_p": "polishing force of the robot on the bearing, along -z",
}


def variable(values: AnyArray, units: str, text: str, dims: Any = "time") -> Variable:
    """Return one variable of a dataset: dimensions, values, attributes."""
    return dims, values, {"units": units, "long_name": text}


def force_variables(*forces: AnyArray) -> dict[str, Variable]:
    """Return F_x, F_y, F_z and F_p [N], with the signs of (8.45)."""
    named = zip(_FORCE_TEXT.items(), forces, strict=True)
    return {name: variable(force, "N", text) for (name, text), force in named}


def angle_variables(
    angles: tuple[AnyArray, AnyArray, AnyArray, AnyArray],
    names: tuple[str, str],
    level: float | None,
) -> dict[str, Variable]:
    """Return theta, psi and their rates; `level` is psi of a level disc, where it has one."""
    theta, psi, theta_rate, psi_rate = angles
    variables = {
        "theta": variable(theta, "rad", names[0]),
        "psi": variable(psi, "rad", names[1]),
        "theta_rate": variable(theta_rate, "rad/s", f"rate of {names[0]}"),
        "psi_rate": variable(psi_rate, "rad/s", f"rate of {names[1]}"),
    }
    if level is not None:
        variables["psi"][2]["level"] = level
    return variables


def path_variables(time: AnyArray, parameters: BrushParameters) -> dict[str, Variable]:
    """Return the tool path (9.2) and the surface under it (9.1, 9.4, 9.5)."""
    surface, (x, y) = parameters.surface, tool_position(time, parameters)
    along, across = tool_velocity(time, parameters)
    moving = np.hypot(along, across) > 0.0
    angle = np.zeros_like(x)
    angle[moving] = surface.elevation(x[moving], y[moving], (along[moving], across[moving]))
    text = "elevation of the surface in the direction of the tool's movement"
    return {
        "tool_x": variable(x, "m", "place of the tool's centre along the feed"),
        "tool_y": variable(y, "m", "place of the tool's centre across the feed"),
        "surface_height": variable(surface.height(x, y), "m", "surface under the tool's centre"),
        "elevation": variable(angle, "rad", text),
    }


def parameter_attributes(parameters: BrushParameters) -> dict[str, float | str]:
    """Return every parameter as an attribute that any file format can keep."""
    surface, path = parameters.surface, parameters.path
    told: dict[str, float | str] = {name: getattr(parameters, name) for name in NUMBERS}
    if isinstance(surface, Surface):
        told |= {"surface_along": surface.along, "surface_across": surface.across}
    else:
        told["surface"] = repr(surface)
    return told if path is None else {**told, "path": repr(path)}


def parameters_from_attributes(attributes: Mapping[Any, Any]) -> BrushParameters:
    """Undo `parameter_attributes`."""
    surface = Surface(attributes["surface_along"], attributes["surface_across"])
    return BrushParameters(**{name: attributes[name] for name in NUMBERS}, surface=surface)


def labelled(
    time: AnyArray, variables: Mapping[str, Variable], attributes: Mapping[str, Any]
) -> xr.Dataset:
    """Put variables along `time` and `point` together."""
    coordinates = {"time": ("time", time, {"units": "s"}), "point": list(POINTS)}
    return xr.Dataset(dict(variables), coordinates, dict(attributes))


# Constants, initial state, integration, and refinement of steps and nodes.

_FIRST_TOLERANCE = 1e-3  # error per step of the coarsest pass, in units of the static contact
_WINDOW = 0.01  # impulses are compared over windows of this length [s]
_RIM_POINTS = (96, 2048)  # fewest and most nodes of the coarsest pass


@dataclass(frozen=True, eq=False)
class PhysicalRun:
    """One integration of the disc, sampled.

    Attributes
    ----------
    time : ndarray, shape (n,)
        [s].
    track : ndarray, shape (n, STATES)
        States of `robustpolish.polishing.contact`.
    forces : ndarray, shape (n, 3)
        Contact force on the brush in world axes, averaged over each sample [N].
    loads : ndarray, shape (n, LOADS)
        Contact at the samples; column 0 is the share of the rim that touches.
    rim_points, steps, refused : int
        Nodes, steps taken, and steps that the error control refused.
    largest_step : float
        Bound of the step [s].
    """

    time: Array
    track: Array
    forces: Array
    loads: Array
    rim_points: int
    steps: int
    refused: int
    largest_step: float


def refined(
    attempt: Callable[[int], tuple[PhysicalRun | None, Any]],
    force: float,
    tolerance: float,
    max_passes: int,
    advice: str,
) -> tuple[PhysicalRun, Any, dict[str, Any]]:
    """Integrate at levels 0, 1, 2, ... until the contact impulses of two passes agree.

    Parameters
    ----------
    attempt : callable
        Returns the run of a level, None where the disc was lost, and what else belongs to it.
    force : float
        Polishing force in N, whose impulse is the measure.
    tolerance : float
        Of the difference of impulses.
    max_passes : int
    advice : str
        What to do where they do not agree, for the warning.

    Returns
    -------
    run : PhysicalRun
    more : object
        What else belongs to it.
    check : dict
        `passes` made; `impulse_error`, the largest difference of the contact impulse over any 10 ms
        between the last two passes, divided by the impulse of the polishing force; and whether it
        is `converged`, within the tolerance.
    """
    run, more = attempt(0)
    error, passes = np.inf, 1
    while passes < max_passes and not error <= tolerance:
        coarse = run
        run, more = attempt(passes)
        lost = coarse is None or run is None
        error = np.inf if lost else impulse_difference(coarse, run, force)
        passes += 1
    if run is None:
        raise SolverError(
            "Brush and machine swing up against each other until the disc tips over or leaves "
            "all bounds. Add damping to the loop or to the contact, or lower the friction."
        )
    if not error <= tolerance:
        warnings.warn(
            f"The contact impulses of the last two of {max_passes} passes differ by {error:.2g} of "
            f"the polishing force's, more than {tolerance:.2g}. {advice}",
            RobustPolishWarning,
            stacklevel=3,
        )
    check = {"passes": passes, "impulse_error": error, "converged": int(error <= tolerance)}
    return run, more, check


def integrate(
    parameters: BrushParameters,
    time: Array,
    level: int,
    *,
    three_angles: bool = False,
    landing: bool = False,
) -> PhysicalRun:
    """Integrate once, at refinement level 0, 1, 2, ...; `time` starts at zero, equally spaced.

    Raises
    ------
    SolverError
        If the disc tips over or the steps become too small to go on.
    """
    interval = float(time[1] - time[0])
    largest_step = interval / 2**level
    nodes = contact.rim_nodes(rim_points(parameters) * 2**level)
    constants, motion = contact_constants(parameters), motion_constants(parameters, three_angles)
    state = _start(parameters, constants, motion, nodes, landing)
    track, loads = (np.empty((time.size, n)) for n in (contact.STATES, contact.LOADS))
    midway = np.empty((time.size - 1, 3))
    scale = _error_scale(parameters, interval)
    tolerance = _FIRST_TOLERANCE / 10.0**level
    outcome, steps, refused, done = contact.advance(
        state, interval, largest_step, tolerance, scale, motion, constants, nodes, track, loads,
        midway,
    )  # fmt: skip
    if outcome != contact.RUNNING:
        what = "tipped over" if outcome == contact.TIPPED_OVER else "moves too fast to be followed"
        raise SolverError(
            f"The disc {what} after {done * interval:.4g} s. Lower the friction, use a "
            "flatter surface or a smaller spin, or raise the contact damping."
        )

    forces = average_forces(track, midway, interval)
    return PhysicalRun(time, track, forces, loads, nodes.shape[1], steps, refused, largest_step)


def contact_constants(parameters: BrushParameters) -> Array:
    """Return the constants of the contact, in the order of `rim_load`."""
    p, surface = parameters, parameters.surface
    # On any other surface, which is packed, the bends of the trough are not read.
    bends = surface.curvatures if isinstance(surface, Surface) else (0.0, 0.0)
    law = [p.contact_stiffness, p.contact_damping, p.friction, p.slip_scale]
    return np.concatenate([[*law, *bends, p.radius, 0.5 * p.height], surface.packed])


def motion_constants(parameters: BrushParameters, three_angles: bool) -> Array:
    """Return the constants of the disc and its path, in the order of `slope`."""
    p = parameters
    disc = [p.mass, p.polishing_force, p.tilt_inertia, p.spin_inertia, p.spin]
    drive = p.spindle_damping if three_angles else 0.0
    circle = [p.rotation_radius, p.rotation_rate, p.feed, p.radius + p.rotation_radius]
    course = np.empty(0) if p.path is None else p.path.packed
    return np.concatenate([[*disc, drive, *circle], course])


def static_depth(parameters: BrushParameters) -> tuple[float, float]:
    """Penetration [m] under the polishing force, and half the angle [rad] of a contact patch.

    The disc stands on two patches with parabolic penetration; on a plane, on its whole rim.
    """
    force, stiffness = parameters.polishing_force, parameters.contact_stiffness
    whole_rim = force / stiffness
    bend = parameters.radius**2 * parameters.surface.sharpest_bend
    depth = (0.75 * pi * force / stiffness * sqrt(0.5 * bend)) ** (2.0 / 3.0)
    if depth <= whole_rim:
        return whole_rim, pi
    return depth, min(pi, sqrt(2.0 * depth / bend))


def rim_points(parameters: BrushParameters) -> int:
    """Nodes of the coarsest pass: about six from the middle of a patch to its edge."""
    _, half_angle = static_depth(parameters)
    wanted = min(max(6.0 * 2.0 * pi / half_angle, _RIM_POINTS[0]), _RIM_POINTS[1])
    return contact.BLOCK * ceil(wanted / contact.BLOCK)


def _error_scale(parameters: BrushParameters, interval: float) -> Array:
    """Return the unit of error per state, from the static contact's depth and its frequency."""
    depth, _ = static_depth(parameters)
    rim_mass = parameters.tilt_inertia / parameters.rim_distance**2
    speed = depth * sqrt(1.5 * parameters.polishing_force / depth / rim_mass)
    scale = np.full(contact.STATES, np.inf)
    scale[contact.HEIGHT], scale[contact.CLIMB] = depth, speed
    scale[contact.AXES] = depth / parameters.radius
    scale[contact.TURNINGS] = scale[contact.SPIN] = speed / parameters.radius
    scale[contact.IMPULSES] = 10.0 * parameters.polishing_force * interval
    return scale


def _start(
    parameters: BrushParameters, constants: Array, motion: Array, nodes: Array, landing: bool
) -> Array:
    """State at time zero: parallel to the surface, just touching it or pressed against it."""
    place, velocity, still = np.zeros(3), np.zeros(3), np.zeros(3)
    contact.joint_motion(0.0, motion, place, velocity)
    slope_x, slope_y = (float(part) for part in parameters.surface.gradient(place[0], place[1]))
    axis = np.array([-slope_x, -slope_y, 1.0]) / sqrt(1.0 + slope_x**2 + slope_y**2)
    load, found = np.zeros(contact.LOADS), contact.work_array(nodes.shape[1])
    ground = float(parameters.surface.height(place[0], place[1]))
    size = parameters.radius + parameters.height
    rise = 0.5 * parameters.surface.sharpest_bend * size**2
    low = ground - size - 2.0 * parameters.polishing_force / parameters.contact_stiffness
    high = ground + size * (1.0 + abs(slope_x) + abs(slope_y)) + 4.0 * rise
    for _ in range(200):
        place[2] = 0.5 * (low + high)
        touching = contact.rim_load(place, still, axis, still, 0.0, constants, nodes, found, load)
        too_low = touching > 0 if landing else load[contact.FORCE + 2] > parameters.polishing_force
        low, high = (place[2], high) if too_low else (low, place[2])
    state = np.zeros(contact.STATES)
    state[contact.HEIGHT], state[contact.SPIN] = high, parameters.spin
    state[contact.CLIMB] = slope_x * velocity[0] + slope_y * velocity[1]
    state[contact.AXES] = axis
    return state


def average_forces(track: Array, midway: Array, interval: float) -> Array:
    """Return the forces at the samples, averaged over half an interval to either side.

    Joined by straight lines they have exactly the impulse of the contact.
    """
    impulse = track[:, contact.IMPULSES]
    bounds = np.vstack([impulse[:1], midway, impulse[-1:]])
    length = np.full((len(track), 1), interval)
    length[0] = length[-1] = 0.5 * interval
    return np.diff(bounds, axis=0) / length


def impulse_difference(coarse: Any, fine: Any, force: float) -> float:
    """Largest difference of window impulses of two runs over the polishing force's impulse."""
    interval = float(fine.time[1] - fine.time[0])
    samples = max(1, min(round(_WINDOW / interval), fine.time.size - 1))
    difference = fine.track[:, contact.IMPULSES] - coarse.track[:, contact.IMPULSES]
    window = difference[samples:] - difference[:-samples]
    return float(np.max(np.abs(window))) / (force * samples * interval)


# Labelled dataset of a run.


def attitude_variables(track: Array, three_angles: bool) -> dict[str, Variable]:
    """Return the angles of the disc and their rates; with three angles its spin too."""
    axis, turning = track[:, contact.AXES], track[:, contact.TURNINGS]
    spin, twist = track[:, contact.SPIN], track[:, contact.TWIST]
    if three_angles:
        angles = euler_angles(axis, turning)
        theta, psi, _, psi_rate = angles
        precessed = np.cumsum(0.5 * np.diff(psi) * (np.cos(theta[1:]) + np.cos(theta[:-1])))
        phi = twist - np.concatenate([[0.0], precessed])
        rate = spin - psi_rate * np.cos(theta)
        return {
            **angle_variables(angles, ("nutation", "precession"), level=None),
            "phi": variable(phi, "rad", "rotation of the tool about its axis"),
            "phi_rate": variable(rate, "rad/s", "rate of phi"),
            "omega_z": variable(spin, "rad/s", "angular velocity about the axis of the disc"),
        }
    names = ("tilt about x", "tilt about y")
    return angle_variables(tilt_angles(axis, turning), names, level=0.0)


def physical_dataset(
    run: PhysicalRun, check: dict[str, Any], parameters: BrushParameters, three_angles: bool
) -> xr.Dataset:
    """Label a run, and tell in the attributes how it was checked."""
    loads, both = run.loads, ("time", "point")
    fx, fy, fz = run.forces.T
    normal = loads[:, contact.SECTORS : contact.SECTORS + len(POINTS)]
    friction, damping = loads[:, contact.FRICTION_POWER], loads[:, contact.DAMPING_POWER]
    variables = {
        **attitude_variables(run.track, three_angles),
        **force_variables(-fx, -fy, fz, np.full_like(fz, parameters.polishing_force)),
        "contact": variable(normal > 0.0, "1", "whether the quarter of the rim touches", both),
        "contact_force": variable(normal, "N", "normal force on the quarter of the rim", both),
        "contact_share": variable(loads[:, 0], "1", "share of the rim that touches"),
        "contact_energy": variable(loads[:, contact.ENERGY], "J", "energy stored in the contact"),
        "friction_power": variable(friction, "W", "power that friction turns into heat"),
        "damping_power": variable(damping, "W", "power that contact damping turns into heat"),
        "tool_z": variable(run.track[:, contact.HEIGHT], "m", "height of the ball joint"),
        "tool_z_rate": variable(run.track[:, contact.CLIMB], "m/s", "rate of the height"),
        **path_variables(run.time, parameters),
    }
    attributes = {
        "simulator": "physical",
        "disc": "three-angle" if three_angles else "two-angle",
        **parameter_attributes(parameters),
        **check,
        "largest_step": run.largest_step,
        "steps": run.steps,
        "refused_steps": run.refused,
        "rim_points": run.rim_points,
        "friction_heat": float(run.track[-1, contact.FRICTION_HEAT]),
        "damping_heat": float(run.track[-1, contact.DAMPING_HEAT]),
    }
    return labelled(run.time, variables, attributes)
