"""Where the tool's centre is: on a circling feed (eqs. 9.2 and 9.3), or on a path given for it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robustpolish.brush.parameters import BrushParameters


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
    >>> from robustpolish.brush import tool_position
    >>> tool_position(0.0, rp.BrushParameters()).round(4).tolist()
    [0.016, 0.0]
    """
    if parameters.path is not None:
        return parameters.path.position(time)
    moment = np.asarray(time, dtype=float)
    turn = parameters.rotation_rate * moment
    start = parameters.radius + parameters.rotation_radius
    return np.stack(
        [
            parameters.rotation_radius * np.cos(turn) + parameters.feed * moment + start,
            parameters.rotation_radius * np.sin(turn),
        ]
    )


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
    >>> from robustpolish.brush import tool_velocity
    >>> tool_velocity(0.0, rp.BrushParameters()).round(4).tolist()
    [0.001, 0.0377]
    """
    if parameters.path is not None:
        return parameters.path.velocity(time)
    moment = np.asarray(time, dtype=float)
    turn = parameters.rotation_rate * moment
    speed = parameters.rotation_radius * parameters.rotation_rate
    return np.stack([parameters.feed - speed * np.sin(turn), speed * np.cos(turn)])
