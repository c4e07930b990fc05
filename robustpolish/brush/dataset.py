"""Simulated runs as labelled signals with units."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from robustpolish.brush import disc_motion as disc
from robustpolish.brush import rim_contact as rim
from robustpolish.brush.angles import euler_angles, tilt_angles
from robustpolish.brush.parameters import BrushParameters
from robustpolish.brush.physical import PhysicalRun, Refinement
from robustpolish.brush.tool_path import tool_position, tool_velocity

Array = NDArray[np.float64]

SECTORS = ("C1", "C2", "C3", "C4")

_FORCE_TEXT = {
    "F_x": "force on the tool along -x",
    "F_y": "force on the tool along -y",
    "F_z": "force on the tool along +z, away from the surface",
    "F_p": "polishing force of the robot on the bearing, along -z",
}


def quantity(values: Array, units: str, text: str, dims: Any = "time") -> tuple[Any, Array, dict]:
    """One variable of a dataset: dimensions, values, and attributes."""
    return dims, values, {"units": units, "long_name": text}


def force_variables(forces: dict[str, Array]) -> dict[str, tuple]:
    """F_x, F_y, F_z and F_p [N] with the signs of (8.45)."""
    return {name: quantity(forces[name], "N", text) for name, text in _FORCE_TEXT.items()}


def path_variables(time: Array, parameters: BrushParameters) -> dict[str, tuple]:
    """Tool path (9.2) and the surface under it (9.1, 9.5)."""
    x, y = tool_position(time, parameters)
    along, across = tool_velocity(time, parameters)
    surface = parameters.surface
    variables = {
        "tool_x": quantity(x, "m", "place of the tool's centre along the feed"),
        "tool_y": quantity(y, "m", "place of the tool's centre across the feed"),
        "surface_height": quantity(surface.height(x, y), "m", "surface under the tool's centre"),
    }
    if np.all(np.hypot(along, across) > 0.0):
        angle = surface.elevation(x, y, (along, across))
        variables["elevation"] = quantity(
            angle, "rad", "elevation of the surface in the direction of the tool's movement"
        )
    return variables


def time_coordinate(time: Array) -> tuple[str, Array, dict]:
    """Return the dimension that all signals share."""
    return "time", time, {"units": "s"}


def parameter_attributes(parameters: BrushParameters) -> dict[str, float]:
    """Contact, friction and surface, as attributes that any file format can keep."""
    return {
        "contact_stiffness": parameters.contact_stiffness,
        "contact_damping": parameters.contact_damping,
        "friction": parameters.friction,
        "polishing_force": parameters.polishing_force,
        "surface_along": parameters.surface.along,
        "surface_across": parameters.surface.across,
    }


def physical_dataset(
    run: PhysicalRun, check: Refinement, parameters: BrushParameters, three_angles: bool
) -> xr.Dataset:
    """Label a run of the physical simulator."""
    fx, fy, fz = run.forces.T
    forces = {"F_x": -fx, "F_y": -fy, "F_z": fz}
    forces["F_p"] = np.full_like(fz, parameters.polishing_force)
    sectors = run.loads[:, rim.SECTORS : rim.SECTORS + len(SECTORS)]
    variables = {
        **_angle_variables(run, three_angles),
        **force_variables(forces),
        "contact_share": quantity(run.loads[:, 0], "1", "share of the rim that touches"),
        "contact_force": quantity(
            sectors, "N", "normal force on a quarter of the rim", ("time", "point")
        ),
        "friction_power": quantity(
            run.loads[:, rim.FRICTION_POWER], "W", "power that friction turns into heat"
        ),
        "damping_power": quantity(
            run.loads[:, rim.DAMPING_POWER], "W", "power that contact damping turns into heat"
        ),
        "contact_energy": quantity(run.loads[:, rim.ENERGY], "J", "energy stored in the contact"),
        "tool_z": quantity(run.track[:, disc.HEIGHT], "m", "height of the ball joint"),
        **path_variables(run.time, parameters),
    }
    attributes = {
        "simulator": "physical",
        "disc": "three-angle" if three_angles else "two-angle",
        **parameter_attributes(parameters),
        "passes": check.passes,
        "impulse_error": check.impulse_error,
        "converged": int(check.converged),
        "largest_step": run.largest_step,
        "steps": run.steps,
        "refused_steps": run.refused,
        "rim_points": run.rim_points,
        "friction_heat": float(run.track[-1, disc.FRICTION_HEAT]),
        "damping_heat": float(run.track[-1, disc.DAMPING_HEAT]),
    }
    coordinates = {"time": time_coordinate(run.time), "point": list(SECTORS)}
    return xr.Dataset(variables, coordinates, attributes)


def _angle_variables(run: PhysicalRun, three_angles: bool) -> dict[str, tuple]:
    axis = run.track[:, disc.AXIS : disc.AXIS + 3]
    turning = run.track[:, disc.TURNING : disc.TURNING + 3]
    if not three_angles:
        theta, psi, theta_rate, psi_rate = tilt_angles(axis, turning)
        names = ("tilt about x", "tilt about y")
        extra = {}
    else:
        theta, psi, theta_rate, psi_rate = euler_angles(axis, turning)
        names = ("nutation", "precession")
        spin = run.track[:, disc.SPIN]
        precessed = np.cumsum(0.5 * np.diff(psi) * (np.cos(theta[1:]) + np.cos(theta[:-1])))
        phi = run.track[:, disc.TWIST] - np.concatenate([[0.0], precessed])
        extra = {
            "phi": quantity(phi, "rad", "rotation of the tool about its axis"),
            "phi_rate": quantity(spin - psi_rate * np.cos(theta), "rad/s", "rate of phi"),
            "omega_z": quantity(spin, "rad/s", "angular velocity about the axis of the disc"),
        }
    return {
        "theta": quantity(theta, "rad", names[0]),
        "psi": quantity(psi, "rad", names[1]),
        "theta_rate": quantity(theta_rate, "rad/s", f"rate of {names[0]}"),
        "psi_rate": quantity(psi_rate, "rad/s", f"rate of {names[1]}"),
        **extra,
    }
