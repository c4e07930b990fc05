"""Listing D.1 integrated as the thesis did, and its forces at the stored states."""

from __future__ import annotations

from math import atan

import numpy as np
from numpy.typing import NDArray

from robustpolish.brush.dormand_prince import NODES, STAGES, inside_step, stage_state
from robustpolish.brush.listing import ode45
from robustpolish.brush.listing.defects import ListingDefects
from robustpolish.brush.listing.equations import (
    FORCE_P,
    UPRIGHT,
    brush_slope,
    impact,
    listing_constants,
)
from robustpolish.brush.parameters import BrushParameters
from robustpolish.brush.tool_path import tool_velocity
from robustpolish.compiling import njit
from robustpolish.errors import SolverError
from robustpolish.validation import described, invalid

STATES = 4  # theta, theta', psi, psi'


def listing_motion(
    parameters: BrushParameters,
    defects: ListingDefects,
    time: NDArray[np.float64],
    relative: float,
) -> tuple[NDArray[np.float64], tuple[int, int, int]]:
    """Integrate D.1 and store its states at equally spaced times from zero.

    Returns
    -------
    states : ndarray, shape (n, 4)
        theta, theta', psi, psi' [rad, rad/s].
    counts : tuple of int
        Steps taken, steps refused, and times that contact began between two steps.

    Raises
    ------
    InvalidInputError
        If the tool does not move: the listings place the contacts along its velocity.
    SolverError
        If the steps become too small to go on.
    """
    constants = listing_constants(parameters, defects)
    velocity = tool_velocity(0.0, parameters)
    speed = float(np.hypot(*velocity))
    if speed == 0.0:
        raise invalid(
            "parameters",
            described("a tool at rest"),
            "a feed or a circling, whose direction places C1 to C4",
            "Raise feed, or rotation_radius and rotation_rate.",
        )
    slope = velocity[0] * parameters.trough.curvatures[0] / speed
    place = parameters.rim_distance + parameters.rotation_radius
    start = np.array([atan(slope * place), 0.0, UPRIGHT, 0.0])
    store = np.empty((time.size, STATES))
    interval = float(time[1] - time[0])
    done, *counts = _integrate(start, interval, relative, constants, defects.as_flags(), store)
    if done < float(time[-2]):
        raise SolverError(
            f"The listing's equations could not be followed beyond {done:.4g} s at a relative "
            f"tolerance of {relative:g}. Raise the tolerance; the impact law is not well posed."
        )
    return store, (counts[0], counts[1], counts[2])


@njit(cache=True, error_model="numpy")
def _integrate(state, interval, relative, constants, flags, store):  # pragma: no cover - compiled
    """Run ode45 from time zero over all stored times; time reached and counts."""
    slopes = np.zeros((STAGES, STATES))
    stage, scale = np.zeros(STATES), np.zeros(STATES)
    end = (store.shape[0] - 1) * interval
    longest = 0.1 * end
    brush_slope(0.0, state, constants, flags, slopes[0])
    step = ode45.first_step(slopes[0], state, min(longest, interval), relative)
    time, following = 0.0, 1
    accepted, refused, impacts = 0, 0, 0
    touching = False
    store[0] = state
    while time < end:
        step = min(longest, max(ode45.shortest(time), step))
        last = 1.1 * step >= end - time
        step = end - time if last else step
        attempts = 0
        while True:
            for s in range(1, STAGES):
                stage_state(slopes, s, state, step, stage)
                brush_slope(time + NODES[s] * step, stage, constants, flags, slopes[s])
            error = ode45.relative_error(slopes, step, state, stage, relative, scale)
            if error <= relative:
                break
            if step <= ode45.shortest(time):
                return time, accepted, refused, impacts
            refused += 1
            attempts += 1
            last = False
            step = ode45.shorter(step, error, relative, attempts > 1)
            step = max(ode45.shortest(time), step)
        accepted += 1
        reached = end if last else time + step
        while following < store.shape[0] and following * interval <= reached:
            fraction = (following * interval - time) / step
            inside_step(slopes, state, step, fraction, 0, store[following])
            following += 1
        time = reached
        state[:] = stage
        slopes[0] = slopes[STAGES - 1]
        if attempts == 0:
            step = ode45.longer(step, error, relative)
        contact = impact(time, state[0], state[1], state[2], state[3], constants, flags)
        now = contact[5] or contact[6] or contact[7]
        if now and not touching:
            impacts += 1
        touching = now
    store[store.shape[0] - 1] = state
    return time, accepted, refused, impacts


def listing_forces(
    parameters: BrushParameters,
    defects: ListingDefects,
    time: NDArray[np.float64],
    states: NDArray[np.float64],
    divisor: float,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Evaluate the forces of D.2 at stored states, with the gates of the bearing open.

    Returns
    -------
    forces : ndarray, shape (n, 3)
        F_x, F_y, F_z [N]; the share of the impacts is divided by `divisor`.
    touching : ndarray of bool, shape (n, 4)
        C1, C2, C3, C4; the listings have one condition for C1 and C2.
    """
    forces = np.empty((time.size, 3))
    touching = np.empty((time.size, 4), dtype=np.bool_)
    constants = listing_constants(parameters, defects)
    _forces_along(time, states, constants, defects.as_flags(), divisor, forces, touching)
    return forces, touching


@njit(cache=True)
def forces_of_contact(contact, force_p, divisor):  # pragma: no cover - compiled
    """Return F_x, F_y, F_z of D.2 lines 133 to 135, from the result of `impact`."""
    alpha, beta, force_psi, force_theta = contact[1], contact[2], contact[3], contact[4]
    across = abs(force_theta) * np.cos(beta) + abs(force_psi) * np.cos(alpha)
    return (
        force_psi * np.sin(alpha) / divisor,
        force_theta * np.sin(beta) / divisor,
        force_p + across / divisor,
    )


@njit(cache=True)
def _forces_along(
    times, states, constants, flags, divisor, forces, touching
):  # pragma: no cover - compiled
    for i in range(times.size):
        w = states[i]
        contact = impact(times[i], w[0], w[1], w[2], w[3], constants, flags)
        forces[i] = forces_of_contact(contact, constants[FORCE_P], divisor)
        touching[i, 0] = touching[i, 1] = contact[5]
        touching[i, 2], touching[i, 3] = contact[6], contact[7]
