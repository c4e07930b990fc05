"""Datasets of both brush simulators: tool path, names, units, signs, and attributes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from robustpolish.base.arrays import AnyArray as Array
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


Variable = tuple[Any, Array, dict[str, Any]]

POINTS = ("C1", "C2", "C3", "C4")

_FORCE_TEXT = {
    "F_x": "force on the tool along -x",
    "F_y": "force on the tool along -y",
    "F_z": "force on the tool along +z, away from the surface",
    "F_p": "polishing force of the robot on the bearing, along -z",
}


def quantity(values: Array, units: str, text: str, dims: Any = "time") -> Variable:
    """Return one variable of a dataset: dimensions, values, attributes."""
    return dims, values, {"units": units, "long_name": text}


def force_variables(*forces: Array) -> dict[str, Variable]:
    """Return F_x, F_y, F_z and F_p [N], with the signs of (8.45)."""
    named = zip(_FORCE_TEXT.items(), forces, strict=True)
    return {name: quantity(force, "N", text) for (name, text), force in named}


def angle_variables(
    angles: tuple[Array, Array, Array, Array], names: tuple[str, str], level: float | None
) -> dict[str, Variable]:
    """Return theta, psi and their rates; `level` is psi of a level disc, where it has one."""
    theta, psi, theta_rate, psi_rate = angles
    variables = {
        "theta": quantity(theta, "rad", names[0]),
        "psi": quantity(psi, "rad", names[1]),
        "theta_rate": quantity(theta_rate, "rad/s", f"rate of {names[0]}"),
        "psi_rate": quantity(psi_rate, "rad/s", f"rate of {names[1]}"),
    }
    if level is not None:
        variables["psi"][2]["level"] = level
    return variables


def path_variables(time: Array, parameters: BrushParameters) -> dict[str, Variable]:
    """Return the tool path (9.2) and the surface under it (9.1, 9.4, 9.5)."""
    surface, (x, y) = parameters.surface, tool_position(time, parameters)
    along, across = tool_velocity(time, parameters)
    moving = np.hypot(along, across) > 0.0
    angle = np.zeros_like(x)
    angle[moving] = surface.elevation(x[moving], y[moving], (along[moving], across[moving]))
    text = "elevation of the surface in the direction of the tool's movement"
    return {
        "tool_x": quantity(x, "m", "place of the tool's centre along the feed"),
        "tool_y": quantity(y, "m", "place of the tool's centre across the feed"),
        "surface_height": quantity(surface.height(x, y), "m", "surface under the tool's centre"),
        "elevation": quantity(angle, "rad", text),
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
    time: Array, variables: Mapping[str, Variable], attributes: Mapping[str, Any]
) -> xr.Dataset:
    """Put variables along `time` and `point` together."""
    coordinates = {"time": ("time", time, {"units": "s"}), "point": list(POINTS)}
    return xr.Dataset(dict(variables), coordinates, dict(attributes))
