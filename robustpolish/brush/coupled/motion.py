"""The disc on a machine that yields, in steps of the exponential Runge-Kutta method.

The joint is where the robot leads it, plus what the machine yields,

    place = reference(t) + C (x - x_0),    velocity = reference'(t) + C A x,

and the contact force at that place drives the machine, x' = A x + B f + g. The machine is taken
exactly, however stiff; for the disc alone the method is the classical Runge-Kutta method.
"""

from __future__ import annotations

import numpy as np

from robustpolish.brush.physical.disc_motion import (
    AXIS,
    CLIMB,
    HEIGHT,
    LOWEST_AXIS,
    RUNNING,
    SPIN,
    STATES,
    STUCK,
    TIPPED_OVER,
    TURNING,
    straighten,
    turn,
)
from robustpolish.brush.physical.rim_contact import FORCE, LOADS, rim_load, scratch
from robustpolish.compiling import njit

CONTACT_IMPULSE = slice(10, 13)


@njit(cache=True)
def _led(track, rate, interval, index, within, place, velocity):  # pragma: no cover - compiled
    """Write the reference between two samples, the cubic through places and velocities."""
    s = within / interval
    for i in range(3):
        before, after = track[index, i], track[index + 1, i]
        start, end = interval * rate[index, i], interval * rate[index + 1, i]
        bend = 3.0 * (after - before) - 2.0 * start - end
        twist = 2.0 * (before - after) + start + end
        place[i] = before + s * (start + s * (bend + s * twist))
        velocity[i] = (start + s * (2.0 * bend + 3.0 * s * twist)) / interval


@njit(cache=True, error_model="numpy")
def _rates(
    reference, rate, interval, index, within, outputs, origin, x, disc, motion, contact, nodes,
    found, room, result, push,
):  # pragma: no cover - compiled  # fmt: skip
    """Write the disc's derivative and the push (f, 1) on the machine; nodes that touch."""
    place, velocity, load = room[0], room[1], room[2]
    _led(reference, rate, interval, index, within, place, velocity)
    for i in range(3):
        yielded, speed = -origin[i], 0.0
        for j in range(x.size):
            yielded += outputs[i, j] * x[j]
            speed += outputs[3 + i, j] * x[j]
        place[i] += yielded
        velocity[i] += speed
    axis, turning = disc[AXIS : AXIS + 3], disc[TURNING : TURNING + 3]
    touching = rim_load(place, velocity, axis, turning, disc[SPIN], contact, nodes, found, load)
    disc[HEIGHT], disc[CLIMB] = place[2], velocity[2]
    result[HEIGHT] = result[CLIMB] = 0.0
    turn(disc, load, motion, result)
    push[0], push[1], push[2], push[3] = load[FORCE], load[FORCE + 1], load[FORCE + 2], 1.0
    return touching


@njit(cache=True)
def _apply(matrix, x, result):  # pragma: no cover - compiled
    for i in range(result.size):
        total = 0.0
        for j in range(x.size):
            total += matrix[i, j] * x[j]
        result[i] = total


@njit(cache=True, error_model="numpy")
def advance_coupled(
    disc, x, reference, rate, interval, steps, outputs, half, whole, gains, motion, contact, nodes,
    track, machine, loads, midway,
):  # pragma: no cover - compiled  # fmt: skip
    """Integrate disc and machine over all intervals of the reference.

    Parameters
    ----------
    disc : ndarray, shape (STATES,)
        At the first sample; overwritten.
    x : ndarray, shape (n,)
        Of the machine, at the first sample, where the reference was laid; overwritten.
    reference, rate : ndarray, shape (count + 1, 3)
        Places and velocities of the joint at the samples on a rigid machine [m, m/s].
    interval : float
        Between samples [s].
    steps : int
        Per interval; even.
    outputs : ndarray, shape (6, n)
        C and C A.
    half, whole, gains : ndarray
        From `LinearMachine.step_matrices`; gains of shape (4, n, 4).
    motion, contact, nodes : ndarray
        Constants of the disc and of the contact.
    track, machine, loads : ndarray, shape (count + 1, ...)
        Filled with disc, machine and contact loads at the samples.
    midway : ndarray, shape (count, 3)
        Filled with the impulses in the middle of the intervals.

    Returns
    -------
    tuple of int
        Outcome (RUNNING is success), and intervals done.
    """
    n = x.size
    step = interval / steps
    room, found = np.zeros((3, LOADS)), scratch(nodes.shape[1])
    slopes, push = np.zeros((4, STATES)), np.zeros((4, 4))
    stage, stage_x = np.zeros(STATES), np.zeros(n)
    first_x, free, again = np.zeros(n), np.zeros(n), np.zeros(n)
    origin = np.zeros(3)
    _apply(outputs[:3], x, origin)
    count = midway.shape[0]
    for i in range(count + 1):
        index, start = (i, 0.0) if i < count else (i - 1, interval)
        touching = _rates(
            reference, rate, interval, index, start, outputs, origin, x, disc, motion, contact,
            nodes, found, room, slopes[0], push[0],
        )  # fmt: skip
        track[i] = disc
        machine[i] = x
        loads[i] = room[2]
        loads[i, 0] = touching / nodes.shape[1]
        if i == count:
            break
        for part in range(steps):
            within = part * step
            if part > 0:
                _rates(
                    reference, rate, interval, i, within, outputs, origin, x, disc, motion,
                    contact, nodes, found, room, slopes[0], push[0],
                )  # fmt: skip
            _apply(half, x, free)
            for s in range(1, 4):
                if s == 3:
                    _apply(half, first_x, again)
                for k in range(STATES):
                    if s == 3:
                        stage[k] = disc[k] + step * slopes[2, k]
                    else:
                        stage[k] = disc[k] + 0.5 * step * slopes[s - 1, k]
                for k in range(n):
                    total = again[k] if s == 3 else free[k]
                    for j in range(4):
                        drive = push[s - 1, j]
                        if s == 3:
                            drive = 2.0 * push[2, j] - push[0, j]
                        total += gains[0, k, j] * drive
                    stage_x[k] = total
                if s == 1:
                    first_x[:] = stage_x
                at = within + (step if s == 3 else 0.5 * step)
                _rates(
                    reference, rate, interval, i, at, outputs, origin, stage_x, stage, motion,
                    contact, nodes, found, room, slopes[s], push[s],
                )  # fmt: skip
            _apply(whole, x, free)
            for k in range(n):
                total = free[k]
                for j in range(4):
                    middle = 2.0 * (push[1, j] + push[2, j])
                    total += gains[1, k, j] * push[0, j] + gains[2, k, j] * middle
                    total += gains[3, k, j] * push[3, j]
                x[k] = total
            for k in range(STATES):
                middle = 2.0 * (slopes[1, k] + slopes[2, k])
                disc[k] += step / 6.0 * (slopes[0, k] + middle + slopes[3, k])
            if 2 * (part + 1) == steps:
                midway[i] = disc[CONTACT_IMPULSE]
        straighten(disc)
        if not np.isfinite(disc[AXIS + 2] + x[0]):
            return STUCK, i
        if disc[AXIS + 2] < LOWEST_AXIS:
            return TIPPED_OVER, i
    return RUNNING, count
