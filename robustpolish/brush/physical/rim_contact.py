"""Unilateral contact with friction along the rim of a tilted, spinning disc.

The rim is a ring of nodes. A node below the surface by delta is pushed out along the normal
with stiffness and Hunt-Crossley damping, and dragged against the velocity with which the spinning
rim slips over the surface:

    lambda = (k_p / N) delta max(0, 1 + chi d(delta)/dt),       N nodes,
    normal = lambda (-df/dx, -df/dy, 1),
    friction = -mu |normal| v_slip / sqrt(|v_slip|^2 + v_0^2).

Penetration is measured vertically, so that without damping and friction the force has an
exact potential, k_p delta^2 / (2 N) per node. lambda is never negative: contact does not pull.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import njit

BLOCK = 16  # nodes that are looked at, or skipped, together

# Places in the load vector that `rim_load` fills, all acting on the brush, world axes.
FORCE = 0  # and 1, 2 [N]
MOMENT = 3  # and 4, 5, about the ball joint [N m]
FRICTION_POWER = 6  # turned into heat by friction [W]
DAMPING_POWER = 7  # turned into heat by contact damping [W]
SECTORS = 8  # and 9, 10, 11: normal force on the rim's quarters at +x, -x, +y, -y [N]
ENERGY = 12  # stored in the contact [J]
LOADS = 13

# Places in the vector of constants.
STIFFNESS, DAMPING, FRICTION, SLIP_SCALE, BEND_X, BEND_Y, RADIUS, HALF_HEIGHT = range(8)


def rim_nodes(count: int) -> np.ndarray:
    """Cosine and sine of the nodes' angles, shape (2, count); count is a multiple of BLOCK."""
    angle = 2.0 * np.pi * (np.arange(count) + 0.5) / count
    return np.stack([np.cos(angle), np.sin(angle)])


@njit(cache=True, error_model="numpy", fastmath=True)
def _touching_nodes(place, axis, constants, span, nodes, found):  # pragma: no cover - compiled
    """List the nodes below the surface: cosine, sine and depth [m] into `found`; their number.

    Blocks of nodes whose deepest node cannot reach the surface are skipped: with a the angle
    from a node of the block, depth(a) <= depth + |depth'| a + max|depth''| a^2 / 2.
    """
    bend_x, bend_y = constants[BEND_X], constants[BEND_Y]
    low_x = place[0] - constants[HALF_HEIGHT] * axis[0]
    low_y = place[1] - constants[HALF_HEIGHT] * axis[1]
    low_z = place[2] - constants[HALF_HEIGHT] * axis[2]
    ax, ay, az, by, bz = span
    # Amplitudes of the first and second harmonic of the depth along the rim.
    first = abs(bend_x * low_x * ax + bend_y * low_y * ay - az) + abs(bend_y * low_y * by - bz)
    second = 0.25 * abs(bend_x * ax * ax + bend_y * (ay * ay - by * by))
    second += 0.5 * abs(bend_y * ay * by)
    count = nodes.shape[1]
    reach = 2.0 * np.pi * (BLOCK // 2) / count
    spare = 0.5 * reach * reach * (first + 4.0 * second)
    touching = 0
    for block in range(0, count, BLOCK):
        cosine, sine = nodes[0, block + BLOCK // 2], nodes[1, block + BLOCK // 2]
        x, y = low_x + ax * cosine, low_y + ay * cosine + by * sine
        depth = 0.5 * (bend_x * x * x + bend_y * y * y) - (low_z + az * cosine + bz * sine)
        steepness = bend_y * y * (by * cosine - ay * sine) - bend_x * x * ax * sine
        steepness -= bz * cosine - az * sine
        if depth + abs(steepness) * reach + spare <= 0.0:
            continue
        for node in range(block, block + BLOCK):
            cosine, sine = nodes[0, node], nodes[1, node]
            x, y = low_x + ax * cosine, low_y + ay * cosine + by * sine
            depth = 0.5 * (bend_x * x * x + bend_y * y * y) - (low_z + az * cosine + bz * sine)
            if depth > 0.0:
                found[0, touching] = cosine
                found[1, touching] = sine
                found[2, touching] = depth
                touching += 1
    return touching


@njit(cache=True, error_model="numpy", fastmath=True)
def rim_load(
    place, velocity, axis, turning, spin, constants, nodes, found, load
):  # pragma: no cover - compiled
    """Add up the contact loads on the brush.

    Parameters
    ----------
    place, velocity : ndarray, shape (3,)
        Of the ball joint [m, m/s].
    axis, turning : ndarray, shape (3,)
        Unit axis of the disc, and angular velocity across it [rad/s].
    spin : float
        Angular velocity about the axis [rad/s].
    constants, nodes : ndarray
        See the module.
    found : ndarray, shape (3, nodes)
        Scratch.
    load : ndarray, shape (LOADS,)
        Filled.

    Returns
    -------
    int
        Number of nodes that touch.
    """
    kx, ky, kz = axis[0], axis[1], axis[2]
    px, py = place[0], place[1]
    ux, uy, uz = velocity[0], velocity[1], velocity[2]
    wx, wy, wz = turning[0], turning[1], turning[2]
    bend_x, bend_y, half = constants[BEND_X], constants[BEND_Y], constants[HALF_HEIGHT]
    damping, friction = constants[DAMPING], constants[FRICTION]
    least_slip = constants[SLIP_SCALE] * constants[SLIP_SCALE]
    share = constants[STIFFNESS] / nodes.shape[1]
    # Two directions across the axis span the rim: the first is x made orthogonal to the axis.
    norm = sqrt(1.0 - kx * kx)
    scale = constants[RADIUS] / norm
    ax, ay, az = norm * constants[RADIUS], -kx * ky * scale, -kx * kz * scale
    by, bz = kz * scale, -ky * scale
    touching = _touching_nodes(place, axis, constants, (ax, ay, az, by, bz), nodes, found)
    force_x = force_y = force_z = moment_x = moment_y = moment_z = 0.0
    friction_power = damping_power = energy = front = back = left = right = 0.0
    for node in range(touching):
        cosine, sine, depth = found[0, node], found[1, node], found[2, node]
        arm_x = ax * cosine - half * kx
        arm_y = ay * cosine + by * sine - half * ky
        arm_z = az * cosine + bz * sine - half * kz
        slope_x, slope_y = bend_x * (px + arm_x), bend_y * (py + arm_y)
        # Velocity of the rim without the spin, which moves it along itself.
        vx = ux + wy * arm_z - wz * arm_y
        vy = uy + wz * arm_x - wx * arm_z
        vz = uz + wx * arm_y - wy * arm_x
        rate = slope_x * vx + slope_y * vy - vz
        push = share * depth * max(0.0, 1.0 + damping * rate)
        damping_power += (push - share * depth) * rate
        energy += 0.5 * share * depth * depth
        vx += spin * (ky * arm_z - kz * arm_y)
        vy += spin * (kz * arm_x - kx * arm_z)
        vz += spin * (kx * arm_y - ky * arm_x)
        stretch = 1.0 + slope_x * slope_x + slope_y * slope_y
        into = (vz - slope_x * vx - slope_y * vy) / stretch
        vx += into * slope_x
        vy += into * slope_y
        vz -= into
        slip = vx * vx + vy * vy + vz * vz
        normal = push * sqrt(stretch)
        drag = friction * normal / sqrt(slip + least_slip)
        friction_power += drag * slip
        fx = -push * slope_x - drag * vx
        fy = -push * slope_y - drag * vy
        fz = push - drag * vz
        force_x += fx
        force_y += fy
        force_z += fz
        moment_x += arm_y * fz - arm_z * fy
        moment_y += arm_z * fx - arm_x * fz
        moment_z += arm_x * fy - arm_y * fx
        front += normal if cosine > abs(sine) else 0.0
        back += normal if -cosine > abs(sine) else 0.0
        left += normal if sine >= abs(cosine) else 0.0
        right += normal if -sine >= abs(cosine) else 0.0
    load[FORCE], load[FORCE + 1], load[FORCE + 2] = force_x, force_y, force_z
    load[MOMENT], load[MOMENT + 1], load[MOMENT + 2] = moment_x, moment_y, moment_z
    load[FRICTION_POWER], load[DAMPING_POWER], load[ENERGY] = friction_power, damping_power, energy
    load[SECTORS], load[SECTORS + 1] = front, back
    load[SECTORS + 2], load[SECTORS + 3] = left, right
    return touching
