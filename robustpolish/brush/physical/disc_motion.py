"""The disc that hangs in a ball joint, pressed on the surface and led along the tool path.

The joint's horizontal motion is prescribed (9.2, 9.3); free are its height, the direction k of
the disc's axis, the angular velocity w across the axis and, for the three-angle disc, the spin.
With angular momentum I_0 w + I omega_z k, equations (6.54) to (6.62) read, without the
singularity that Euler angles have when the disc lies level,

    m z'' = F_z - F_p,            k' = w x k,
    I_0 w' = M - (M . k) k - I omega_z (w x k),
    I omega_z' = M . k - c (omega_z - p)     three angles; two angles: omega_z = p.
"""

from __future__ import annotations

from math import cos, sin, sqrt

import numpy as np

from robustpolish.brush.dormand_prince import (
    NODES,
    STAGES,
    inside_step,
    stage_state,
    step_error,
)
from robustpolish.brush.paths.packed import follow
from robustpolish.brush.physical.rim_contact import (
    DAMPING_POWER,
    FORCE,
    FRICTION_POWER,
    LOADS,
    MOMENT,
    rim_load,
    scratch,
)
from robustpolish.compiling import njit

# Places in the state vector.
HEIGHT, CLIMB, AXIS, TURNING, SPIN, TWIST, IMPULSE, FRICTION_HEAT, DAMPING_HEAT = (
    0, 1, 2, 5, 8, 9, 10, 13, 14,
)  # fmt: skip
STATES = 15
AXES, TURNINGS, IMPULSES = slice(2, 5), slice(5, 8), slice(10, 13)

# Places in the vector of constants of the motion.
MASS, FORCE_P, TILT_INERTIA, SPIN_INERTIA, SPIN_NOMINAL, SPIN_DRIVE = range(6)
CIRCLE, RATE, FEED, START = range(6, 10)
COURSE = 10  # from here on a packed path, if the tool does not circle

RUNNING, TIPPED_OVER, STUCK = 0, 1, 2
LOWEST_AXIS = 0.2  # cosine of the tilt from which the disc counts as tipped over


@njit(cache=True)
def lead(time, motion, place, velocity):  # pragma: no cover - compiled
    """Write the joint's horizontal place and velocity at a time (eqs. 9.2 and 9.3, or a path)."""
    if motion.size > COURSE:
        follow(time, motion[COURSE:], place, velocity)
        return
    turn = motion[RATE] * time
    place[0] = motion[CIRCLE] * cos(turn) + motion[FEED] * time + motion[START]
    place[1] = motion[CIRCLE] * sin(turn)
    velocity[0] = motion[FEED] - motion[CIRCLE] * motion[RATE] * sin(turn)
    velocity[1] = motion[CIRCLE] * motion[RATE] * cos(turn)


@njit(cache=True, error_model="numpy")
def slope(time, state, motion, contact, nodes, found, room, result):  # pragma: no cover - compiled
    """Write the time derivative of the state; `room` is scratch of shape (3, LOADS)."""
    place, velocity, load = room[0], room[1], room[2]
    lead(time, motion, place, velocity)
    place[2], velocity[2] = state[HEIGHT], state[CLIMB]
    axis, turning = state[AXIS : AXIS + 3], state[TURNING : TURNING + 3]
    rim_load(place, velocity, axis, turning, state[SPIN], contact, nodes, found, load)
    result[HEIGHT] = state[CLIMB]
    result[CLIMB] = (load[FORCE + 2] - motion[FORCE_P]) / motion[MASS]
    turn(state, load, motion, result)


@njit(cache=True, error_model="numpy")
def turn(state, load, motion, result):  # pragma: no cover - compiled
    """Write the time derivative of all but the height, under given loads."""
    axis, turning = state[AXIS : AXIS + 3], state[TURNING : TURNING + 3]
    result[AXIS] = turning[1] * axis[2] - turning[2] * axis[1]
    result[AXIS + 1] = turning[2] * axis[0] - turning[0] * axis[2]
    result[AXIS + 2] = turning[0] * axis[1] - turning[1] * axis[0]
    about = load[MOMENT] * axis[0] + load[MOMENT + 1] * axis[1] + load[MOMENT + 2] * axis[2]
    gyro = motion[SPIN_INERTIA] * state[SPIN]
    for i in range(3):
        across = load[MOMENT + i] - about * axis[i] - gyro * result[AXIS + i]
        result[TURNING + i] = across / motion[TILT_INERTIA]
        result[IMPULSE + i] = load[FORCE + i]
    if motion[SPIN_DRIVE] > 0.0:
        drive = motion[SPIN_DRIVE] * (motion[SPIN_NOMINAL] - state[SPIN])
        result[SPIN] = (about + drive) / motion[SPIN_INERTIA]
    else:
        result[SPIN] = 0.0
    result[TWIST] = state[SPIN]
    result[FRICTION_HEAT] = load[FRICTION_POWER]
    result[DAMPING_HEAT] = load[DAMPING_POWER]


@njit(cache=True)
def straighten(state):  # pragma: no cover - compiled
    """Bring the axis back to length 1 and the turning back across it; both drift by rounding."""
    kx, ky, kz = state[AXIS], state[AXIS + 1], state[AXIS + 2]
    length = sqrt(kx * kx + ky * ky + kz * kz)
    along = 0.0
    for i in range(AXIS, AXIS + 3):
        state[i] /= length
        along += state[i] * state[i - AXIS + TURNING]
    for i in range(3):
        state[TURNING + i] -= along * state[AXIS + i]


@njit(cache=True, error_model="numpy")
def advance(
    state, interval, largest_step, tolerance, scale, motion, contact, nodes, track, midway
):  # pragma: no cover - compiled
    """Integrate from time zero over intervals of equal length and record their ends.

    Parameters
    ----------
    state : ndarray, shape (STATES,)
        At time zero; overwritten.
    interval : float
        Length of an interval [s].
    largest_step : float
        No step is longer than this [s], nor than an interval, so that contact is not passed by.
    tolerance : float
        Allowed error per step, in units of `scale`.
    scale : ndarray, shape (STATES,)
        What counts as one unit of error per state.
    motion, contact, nodes : ndarray
        Constants.
    track : ndarray, shape (count + 1, STATES)
        Filled with the state at the ends of the intervals.
    midway : ndarray, shape (count, 3)
        Filled with the impulses in the middle of the intervals.

    Returns
    -------
    tuple of int
        Outcome (RUNNING is success), steps taken, steps refused, intervals done.
    """
    slopes = np.zeros((STAGES, STATES))
    stage = np.zeros(STATES)
    room = np.zeros((3, LOADS))
    found = scratch(nodes.shape[1])
    accepted, refused = 0, 0
    wish = largest_step
    track[0] = state
    slope(0.0, state, motion, contact, nodes, found, room, slopes[0])
    for i in range(midway.shape[0]):
        time, end = i * interval, (i + 1) * interval
        middle = time + 0.5 * interval
        half_done = False
        while time < end:
            left = end - time
            parts = np.ceil(left / min(wish, largest_step) * (1.0 - 1e-9))
            step = left / parts if parts < 3.0 else min(wish, largest_step)
            for s in range(1, STAGES):
                stage_state(slopes, s, state, step, stage)
                slope(time + NODES[s] * step, stage, motion, contact, nodes, found, room, slopes[s])
            error = step_error(slopes, step, scale) / tolerance
            if not error <= 1.0:
                refused += 1
                wish = step * (max(0.2, 0.9 * error**-0.2) if error < 1e30 else 0.2)
                if wish < 1e-9 * interval:
                    return STUCK, accepted, refused, i
                continue
            accepted += 1
            wish = step * min(5.0, 0.9 * max(error, 1e-10) ** -0.2)
            if not half_done and time + step >= middle:
                inside_step(slopes, state, step, (middle - time) / step, IMPULSE, midway[i])
                half_done = True
            time = end if parts <= 1.0 else time + step
            state[:] = stage
            slopes[0] = slopes[STAGES - 1]
            if state[AXIS + 2] < LOWEST_AXIS:
                return TIPPED_OVER, accepted, refused, i
        straighten(state)
        track[i + 1] = state
    return RUNNING, accepted, refused, midway.shape[0]


@njit(cache=True, error_model="numpy")
def loads_along(time, track, motion, contact, nodes, loads):  # pragma: no cover - compiled
    """Evaluate the contact at recorded states; the share of the rim that touches in column 0."""
    place, velocity = np.zeros(3), np.zeros(3)
    found = scratch(nodes.shape[1])
    for i in range(time.size):
        state = track[i]
        lead(time[i], motion, place, velocity)
        place[2], velocity[2] = state[HEIGHT], state[CLIMB]
        touching = rim_load(
            place,
            velocity,
            state[AXIS : AXIS + 3],
            state[TURNING : TURNING + 3],
            state[SPIN],
            contact,
            nodes,
            found,
            loads[i],
        )
        loads[i, 0] = touching / nodes.shape[1]
