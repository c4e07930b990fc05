"""Unilateral contact with friction along the rim of a tilted, spinning disc.

The rim is a ring of nodes. A node below the surface by delta is pushed out along the normal
with stiffness and Hunt-Crossley damping, and dragged against the velocity with which the spinning
rim slips over the surface:

    lambda = (k_p / N) delta max(0, 1 + chi d(delta)/dt),       N nodes,
    normal = lambda (-df/dx, -df/dy, 1),
    friction = -mu |normal| v_slip / sqrt(|v_slip|^2 + v_0^2).

Penetration is measured vertically, so that without damping and friction the force has an
exact potential, k_p delta^2 / (2 N) per node. lambda is never negative: contact does not pull.

The surface is a trough, whose two bends stand among the constants, or a mould, packed as in
`robustpolish.brush.surfaces.uniform_spline`, which then follows the constants in the same array.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from robustpolish.brush.surfaces.uniform_spline import BEND, expansion
from robustpolish.compiling import njit

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
CONSTANTS = 8

# Rows of the scratch: what touches (cosine, sine, depth, slopes); where the mould was expanded
# last (place, height, slopes, second derivatives) per node, below the disc's centre, and in the
# middle of each block, there with the place at which the nodes of the block were expanded.
EXPANDED, CENTRE, MIDDLES, SCRATCH = 5, 13, 14, 15
PER_BLOCK = 10
NEAR = 1e-5  # m: the error there is the third derivative times 2e-16 m^3, 2e-12 m for 1e4 / m^2


def rim_nodes(count: int) -> np.ndarray:
    """Cosine and sine of the nodes' angles, shape (2, count); count is a multiple of BLOCK."""
    angle = 2.0 * np.pi * (np.arange(count) + 0.5) / count
    return np.stack([np.cos(angle), np.sin(angle)])


@njit(cache=True)
def scratch(count):  # pragma: no cover - compiled
    """Return room for `rim_load` to work in, with expansions that are far from everywhere."""
    return np.full((SCRATCH, count), 1e9)


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
def _expand(x, y, mould, found, row, column, stride):  # pragma: no cover - compiled
    """Write place, height, slopes and bends of the mould from a place of the scratch on."""
    height, slope_x, slope_y, xx, xy, yy = expansion(x, y, mould)
    place = row * found.shape[1] + column
    flat = found.ravel()
    for value in (x, y, height, slope_x, slope_y, xx, xy, yy):
        flat[place] = value
        place += stride


@njit(cache=True, error_model="numpy", fastmath=True)
def _touching_on_mould(place, axis, constants, span, nodes, found):  # pragma: no cover - compiled
    """Do the same on a mould, and write its slopes at the nodes into rows 3 and 4 of `found`.

    The mould's height is a cubic spline. Next to where it was expanded last, its two derivatives
    give it as well, and a node stays next to there for many steps.

    Along the rim |depth''| is at most the first harmonic over the tangent plane under the disc's
    centre and 2 R^2 times the mould's largest bend, which bounds both the bend along the rim and
    how far its slopes differ from those of that plane.
    """
    mould = constants[CONSTANTS:]
    low_x = place[0] - constants[HALF_HEIGHT] * axis[0]
    low_y = place[1] - constants[HALF_HEIGHT] * axis[1]
    low_z = place[2] - constants[HALF_HEIGHT] * axis[2]
    ax, ay, az, by, bz = span
    count = nodes.shape[1]
    reach = 2.0 * np.pi * (BLOCK // 2) / count
    bound = 2.0 * constants[RADIUS] * constants[RADIUS] * mould[BEND]
    middles, centre = found[MIDDLES], found[CENTRE]
    dx, dy = low_x - centre[0], low_y - centre[1]
    if dx * dx + dy * dy > NEAR * NEAR:
        _expand(low_x, low_y, mould, found, CENTRE, 0, 1)
        dx = dy = 0.0
    slope_x = centre[3] + centre[5] * dx + centre[6] * dy
    slope_y = centre[4] + centre[6] * dx + centre[7] * dy
    bound += abs(slope_x * ax + slope_y * ay - az) + abs(slope_y * by - bz)
    spare = 0.5 * reach * reach * bound
    touching = 0
    for block in range(0, count, BLOCK):
        middle = block + BLOCK // 2
        cosine, sine = nodes[0, middle], nodes[1, middle]
        x, y = low_x + ax * cosine, low_y + ay * cosine + by * sine
        b = block // BLOCK * PER_BLOCK
        dx, dy = x - middles[b], y - middles[b + 1]
        if dx * dx + dy * dy > NEAR * NEAR:
            _expand(x, y, mould, found, MIDDLES, b, 1)
            dx = dy = 0.0
        slope_x = middles[b + 3] + middles[b + 5] * dx + middles[b + 6] * dy
        slope_y = middles[b + 4] + middles[b + 6] * dx + middles[b + 7] * dy
        # Half the slope's rise is the bend's part of the height.
        depth = middles[b + 2] - (low_z + az * cosine + bz * sine)
        depth += 0.5 * ((middles[b + 3] + slope_x) * dx + (middles[b + 4] + slope_y) * dy)
        steepness = slope_y * (by * cosine - ay * sine) - slope_x * ax * sine
        steepness -= bz * cosine - az * sine
        if depth + abs(steepness) * reach + spare <= 0.0:
            continue
        dx, dy = x - middles[b + 8], y - middles[b + 9]
        if dx * dx + dy * dy > NEAR * NEAR:
            middles[b + 8], middles[b + 9] = x, y
            for node in range(block, block + BLOCK):
                cosine, sine = nodes[0, node], nodes[1, node]
                x, y = low_x + ax * cosine, low_y + ay * cosine + by * sine
                _expand(x, y, mould, found, EXPANDED, node, count)
        for node in range(block, block + BLOCK):
            cosine, sine = nodes[0, node], nodes[1, node]
            dx = low_x + ax * cosine - found[EXPANDED, node]
            dy = low_y + ay * cosine + by * sine - found[EXPANDED + 1, node]
            rise_x, rise_y = found[EXPANDED + 3, node], found[EXPANDED + 4, node]
            xy = found[EXPANDED + 6, node]
            slope_x = rise_x + found[EXPANDED + 5, node] * dx + xy * dy
            slope_y = rise_y + xy * dx + found[EXPANDED + 7, node] * dy
            depth = found[EXPANDED + 2, node] - (low_z + az * cosine + bz * sine)
            depth += 0.5 * ((rise_x + slope_x) * dx + (rise_y + slope_y) * dy)
            if depth > 0.0:
                found[0, touching] = cosine
                found[1, touching] = sine
                found[2, touching] = depth
                found[3, touching] = slope_x
                found[4, touching] = slope_y
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
    found : ndarray, shape (SCRATCH, nodes)
        From `scratch`, to be used again; three rows of anything will do for a trough.
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
    on_mould = constants.size > CONSTANTS
    if on_mould:
        touching = _touching_on_mould(place, axis, constants, (ax, ay, az, by, bz), nodes, found)
    else:
        touching = _touching_nodes(place, axis, constants, (ax, ay, az, by, bz), nodes, found)
    force_x = force_y = force_z = moment_x = moment_y = moment_z = 0.0
    friction_power = damping_power = energy = front = back = left = right = 0.0
    for node in range(touching):
        cosine, sine, depth = found[0, node], found[1, node], found[2, node]
        arm_x = ax * cosine - half * kx
        arm_y = ay * cosine + by * sine - half * ky
        arm_z = az * cosine + bz * sine - half * kz
        if on_mould:
            slope_x, slope_y = found[3, node], found[4, node]
        else:
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
