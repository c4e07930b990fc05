"""Rigid-body motion and rim contact of the disc: equations of motion in compiled code.

The disc hangs in a ball joint, is pressed on the surface and led along the tool path.

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
from scipy.integrate import RK45

from robustpolish.base.arrays import ROUNDING, Array
from robustpolish.base.jit import njit
from robustpolish.polishing.surfaces.spline import BEND, expansion
from robustpolish.polishing.tool_path import evaluate_path

STAGES = 7

NODES = np.append(RK45.C, 1.0)

# Row s combines the slopes before stage s; the last row is the solution of order 5.
COUPLING = np.vstack([np.pad(RK45.A, ((0, 0), (0, 1))), RK45.B])

ERROR = -RK45.E  # solution of order 5 less that of order 4

# Powers 1 to 4 of the fraction of the step, per slope, for values inside the step.
DENSE = np.array(
    [
        [1.0, -183 / 64, 37 / 12, -145 / 128],
        [0.0, 0.0, 0.0, 0.0],
        [0.0, 1500 / 371, -1000 / 159, 1000 / 371],
        [0.0, -125 / 32, 125 / 12, -375 / 64],
        [0.0, 9477 / 3392, -729 / 106, 25515 / 6784],
        [0.0, -11 / 7, 11 / 3, -55 / 28],
        [0.0, 3 / 2, -4.0, 5 / 2],
    ]
)


@njit(cache=True)
def stage_state(slopes, stage, start, step, state):  # pragma: no cover - compiled
    """Write into `state` where stage `stage` evaluates; stage 6 is the end of the step."""
    for i in range(start.size):
        total = 0.0
        for s in range(stage):
            total += COUPLING[stage, s] * slopes[s, i]
        state[i] = start[i] + step * total


@njit(cache=True)
def step_error(slopes, step, scale):  # pragma: no cover - compiled
    """Return the largest error of the step, each divided by its scale; infinite if undefined."""
    largest = 0.0
    for i in range(scale.size):
        total = 0.0
        for s in range(STAGES):
            total += ERROR[s] * slopes[s, i]
        error = abs(step * total) / scale[i]
        if np.isnan(error):
            return np.inf
        largest = max(largest, error)
    return largest


@njit(cache=True)
def inside_step(slopes, start, step, fraction, first, state):  # pragma: no cover - compiled
    """Write into `state` the components from `first` on, at a fraction of the step."""
    for i in range(state.size):
        total = 0.0
        for s in range(STAGES):
            power = fraction
            weight = 0.0
            for p in range(4):
                weight += DENSE[s, p] * power
                power *= fraction
            total += weight * slopes[s, first + i]
        state[i] = start[first + i] + step * total


# Attitude angles of the disc, from its axis and angular velocity.


def tilt_angles(axis: Array, turning: Array) -> tuple[Array, Array, Array, Array]:
    """Tilts about x and y and their rates: the two-angle disc.

    Parameters
    ----------
    axis : ndarray, shape (n, 3)
        Unit axis k of the disc in world axes.
    turning : ndarray, shape (n, 3)
        Angular velocity across the axis [rad/s].

    Returns
    -------
    theta, psi, theta_rate, psi_rate : ndarray, shape (n,)
        k = (sin psi, -sin theta cos psi, cos theta cos psi) [rad, rad/s]. For small tilts the
        rates are the components of the angular velocity along x and y, as in (6.59) to (6.62).
    """
    kx, ky, kz = axis.T
    moving = np.cross(turning, axis).T
    across = np.hypot(ky, kz)
    theta = np.arctan2(-ky, kz)
    psi = np.arctan2(kx, across)
    theta_rate = (ky * moving[2] - kz * moving[1]) / across**2
    psi_rate = moving[0] / across
    return theta, psi, theta_rate, psi_rate


def euler_angles(axis: Array, turning: Array) -> tuple[Array, Array, Array, Array]:
    """Nutation and precession and their rates: the three-angle disc (6.10 to 6.14).

    Parameters
    ----------
    axis, turning : ndarray, shape (n, 3)
        As in `tilt_angles`.

    Returns
    -------
    theta, psi, theta_rate, psi_rate : ndarray, shape (n,)
        k = (sin theta sin psi, -sin theta cos psi, cos theta); psi is unwrapped [rad, rad/s].
        A level disc has no direction of precession; there psi_rate is reported as zero.
    """
    kx, ky, kz = axis.T
    sine = np.hypot(kx, ky)
    theta = np.arctan2(sine, kz)
    # tilt [rad] below which precession has no direction and is reported as at rest
    psi = np.unwrap(np.where(sine > ROUNDING, np.arctan2(kx, -ky), 0.0))
    node = np.stack([np.cos(psi), np.sin(psi), np.zeros_like(psi)], axis=1)
    theta_rate = np.einsum("ni,ni->n", turning, node)
    across = np.einsum("ni,ni->n", turning, np.cross(axis, node))
    psi_rate = np.divide(across, sine, out=np.zeros_like(sine), where=sine > ROUNDING)
    return theta, psi, theta_rate, psi_rate


def disc_axis(theta: Array, psi: Array, euler: bool) -> Array:
    """Return the axis of the disc, shape (3, ...), at nutation and precession, or at tilts."""
    sine, cosine = np.sin(theta), np.cos(theta)
    side, level = np.sin(psi), np.cos(psi)
    if euler:
        return np.stack([sine * side, -sine * level, cosine])
    return np.stack([side, -sine * level, cosine * level])


def axis_and_turning(
    theta: Array, psi: Array, theta_rate: Array, psi_rate: Array, *, euler: bool
) -> tuple[Array, Array]:
    """Undo `tilt_angles`, or `euler_angles`, at one instant.

    Parameters
    ----------
    theta, psi, theta_rate, psi_rate : float
        In rad and rad/s.
    euler : bool
        Whether they are nutation and precession instead of tilts.

    Returns
    -------
    axis, turning : ndarray, shape (3,)
        Unit axis, and angular velocity across it [rad/s].
    """
    sine, cosine = np.sin(theta), np.cos(theta)
    side, level = np.sin(psi), np.cos(psi)
    if euler:
        moving = theta_rate * np.array([cosine * side, -cosine * level, -sine])
        moving += psi_rate * np.array([sine * level, sine * side, 0.0])
    else:
        moving = theta_rate * np.array([0.0, -cosine * level, -sine * level])
        moving += psi_rate * np.array([level, sine * side, -cosine * side])
    axis = disc_axis(theta, psi, euler)
    return axis, np.cross(axis, moving)


# Unilateral contact with friction along the rim of a tilted, spinning disc.
#
# The rim is a ring of nodes. A node below the surface by delta is pushed out along the normal
# with stiffness and Hunt-Crossley damping, and dragged against the velocity with which the spinning
# rim slips over the surface:
#
#     lambda = (k_p / N) delta max(0, 1 + chi d(delta)/dt),       N nodes,
#     normal = lambda (-df/dx, -df/dy, 1),
#     friction = -mu |normal| v_slip / sqrt(|v_slip|^2 + v_0^2).
#
# Penetration is measured vertically, so that without damping and friction the force has an
# exact potential, k_p delta^2 / (2 N) per node. lambda is never negative: contact does not pull.
#
# Nodes tilt with the disc and do not spin: a body of revolution that spins keeps its gaps. So
#
#     d(delta)/dt = (df/dx, df/dy, -1) . (u + w x arm),    w across the axis k, without the spin,
#
# and by virtual work, lambda d(delta), the pushes do not turn the disc about k. Their arms give a
# moment about k: zero on a fine rim without damping, else a brake whose work no damper takes.
# The spin's equation leaves it out, so that
#
#     d/dt (kinetic + stored energy) = power of carriage and drive - friction - damping power.
#
# The surface is a trough, whose two bends stand among the constants, or a mould, packed as in
# `robustpolish.polishing.surfaces.spline`, which then follows the constants in the same array.

BLOCK = 16  # nodes that are looked at, or skipped, together

# Places in the load vector that `rim_load` fills, all acting on the brush, world axes.
FORCE = 0  # and 1, 2 [N]
MOMENT = 3  # and 4, 5, about the ball joint [N m]
FRICTION_POWER = 6  # turned into heat by friction [W]
DAMPING_POWER = 7  # turned into heat by contact damping [W]
SECTORS = 8  # and 9, 10, 11: normal force on the rim's quarters at +x, -x, +y, -y [N]
ENERGY = 12  # stored in the contact [J]
ABOUT = 13  # part about the axis of the pushes' moment, which the spin does not meet [N m]
LOADS = 14

# Places in the vector of constants.
STIFFNESS, DAMPING, FRICTION, SLIP_SCALE, BEND_X, BEND_Y, RADIUS, HALF_HEIGHT = range(8)
CONSTANTS = 8

# Rows of the scratch: what touches (cosine, sine, depth, slopes); where the mould was expanded
# last (place, height, slopes, second derivatives) per node, below the disc's centre, and in the
# middle of each block, there with the place at which the nodes of the block were expanded. The
# trough is one quadratic, which stands where the expansion below the centre does.
EXPANDED, CENTRE, MIDDLES, SCRATCH = 5, 13, 14, 15
PER_BLOCK = 10
NEAR = 1e-5  # m: the error there is the third derivative times 2e-16 m^3, 2e-12 m for 1e4 / m^2


def rim_nodes(count: int) -> np.ndarray:
    """Cosine and sine of the nodes' angles, shape (2, count); count is a multiple of BLOCK."""
    angle = 2.0 * np.pi * (np.arange(count) + 0.5) / count
    return np.stack([np.cos(angle), np.sin(angle)])


@njit(cache=True)
def work_array(count):  # pragma: no cover - compiled
    """Return room for `rim_load` to work in, with expansions that are far from everywhere."""
    return np.full((SCRATCH, count), 1e9)


@njit(cache=True, error_model="numpy", fastmath=True)
def _expand(x, y, mould, flat, place, stride):  # pragma: no cover - compiled
    """Write place, height, slopes and bends of the mould from a place of the scratch on."""
    height, slope_x, slope_y, xx, xy, yy = expansion(x, y, mould)
    for value in (x, y, height, slope_x, slope_y, xx, xy, yy):
        flat[place] = value
        place += stride


@njit(cache=True, error_model="numpy", fastmath=True)
def _is_far(x, y, flat, place):  # pragma: no cover - compiled
    """Whether what stands at a place of the scratch is too far away to be used at x and y."""
    dx, dy = x - flat[place], y - flat[place + 1]
    return dx * dx + dy * dy > NEAR * NEAR


@njit(cache=True, error_model="numpy", fastmath=True)
def _expanded(x, y, flat, place, stride):  # pragma: no cover - compiled
    """Return height and slopes at x and y of the quadratic from a place of the scratch on."""
    dx, dy = x - flat[place], y - flat[place + stride]
    rise_x, rise_y = flat[place + 3 * stride], flat[place + 4 * stride]
    slope_x = rise_x + flat[place + 5 * stride] * dx + flat[place + 6 * stride] * dy
    slope_y = rise_y + flat[place + 6 * stride] * dx + flat[place + 7 * stride] * dy
    # Half the slope's rise is the bend's part of the height.
    bent = 0.5 * ((rise_x + slope_x) * dx + (rise_y + slope_y) * dy)
    return flat[place + 2 * stride] + bent, slope_x, slope_y


@njit(cache=True, error_model="numpy", fastmath=True)
def _touching_nodes(place, axis, constants, span, nodes, found):  # pragma: no cover - compiled
    """List the nodes below the surface: cosine, sine, depth [m], slopes into `found`; their number.

    Blocks of nodes whose deepest node cannot reach the surface are skipped: with a the angle
    from a node of the block, depth(a) <= depth + |depth'| a + max|depth''| a^2 / 2.

    A mould's height is a cubic spline. Next to where it was expanded last, its two derivatives
    give it as well, and a node stays next to there for many steps.

    Along the rim |depth''| is at most the first harmonic over the tangent plane under the disc's
    centre and, on the trough, four times the second; on a mould 2 R^2 times its largest bend, which
    bounds both the bend along the rim and how far its slopes differ from those of that plane.
    """
    mould, on_mould = constants[CONSTANTS:], constants.size > CONSTANTS
    low_x = place[0] - constants[HALF_HEIGHT] * axis[0]
    low_y = place[1] - constants[HALF_HEIGHT] * axis[1]
    low_z = place[2] - constants[HALF_HEIGHT] * axis[2]
    ax, ay, az, by, bz = span
    count, flat = nodes.shape[1], found.ravel()
    centre = CENTRE * count
    if on_mould:
        if _is_far(low_x, low_y, flat, centre):
            _expand(low_x, low_y, mould, flat, centre, 1)
        bound = 2.0 * constants[RADIUS] * constants[RADIUS] * mould[BEND]
    else:
        bend_x, bend_y = constants[BEND_X], constants[BEND_Y]
        flat[centre : centre + 8] = 0.0
        flat[centre + 5], flat[centre + 7] = bend_x, bend_y
        bound = abs(bend_x * ax * ax + bend_y * (ay * ay - by * by)) + 2.0 * abs(bend_y * ay * by)
    _, slope_x, slope_y = _expanded(low_x, low_y, flat, centre, 1)
    bound += abs(slope_x * ax + slope_y * ay - az) + abs(slope_y * by - bz)
    reach = 2.0 * np.pi * (BLOCK // 2) / count
    spare = 0.5 * reach * reach * bound
    touching = 0
    for block in range(0, count, BLOCK):
        cosine, sine = nodes[0, block + BLOCK // 2], nodes[1, block + BLOCK // 2]
        x, y = low_x + ax * cosine, low_y + ay * cosine + by * sine
        middle = MIDDLES * count + block // BLOCK * PER_BLOCK if on_mould else centre
        if on_mould and _is_far(x, y, flat, middle):
            _expand(x, y, mould, flat, middle, 1)
        height, slope_x, slope_y = _expanded(x, y, flat, middle, 1)
        depth = height - (low_z + az * cosine + bz * sine)
        steepness = slope_y * (by * cosine - ay * sine) - slope_x * ax * sine
        steepness -= bz * cosine - az * sine
        if depth + abs(steepness) * reach + spare <= 0.0:
            continue
        anew = on_mould and _is_far(x, y, flat, middle + 8)
        if anew:
            flat[middle + 8], flat[middle + 9] = x, y
        for node in range(block, block + BLOCK):
            cosine, sine = nodes[0, node], nodes[1, node]
            x, y = low_x + ax * cosine, low_y + ay * cosine + by * sine
            own, stride = (EXPANDED * count + node, count) if on_mould else (centre, 1)
            if anew:
                _expand(x, y, mould, flat, own, stride)
            height, slope_x, slope_y = _expanded(x, y, flat, own, stride)
            depth = height - (low_z + az * cosine + bz * sine)
            if depth > 0.0:
                found[0, touching], found[1, touching] = cosine, sine
                found[2, touching] = depth
                found[3, touching], found[4, touching] = slope_x, slope_y
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
        From `work_array`, to be used again.
    load : ndarray, shape (LOADS,)
        Filled.

    Returns
    -------
    int
        Number of nodes that touch.
    """
    kx, ky, kz = axis[0], axis[1], axis[2]
    ux, uy, uz = velocity[0], velocity[1], velocity[2]
    wx, wy, wz = turning[0], turning[1], turning[2]
    half, damping, friction = constants[HALF_HEIGHT], constants[DAMPING], constants[FRICTION]
    least_slip = constants[SLIP_SCALE] * constants[SLIP_SCALE]
    share = constants[STIFFNESS] / nodes.shape[1]
    # Two directions across the axis span the rim: the first is x made orthogonal to the axis.
    norm = sqrt(1.0 - kx * kx)
    scale = constants[RADIUS] / norm
    ax, ay, az = norm * constants[RADIUS], -kx * ky * scale, -kx * kz * scale
    by, bz = kz * scale, -ky * scale
    touching = _touching_nodes(place, axis, constants, (ax, ay, az, by, bz), nodes, found)
    force_x = force_y = force_z = moment_x = moment_y = moment_z = 0.0
    friction_power = damping_power = energy = about = front = back = left = right = 0.0
    for node in range(touching):
        cosine, sine, depth = found[0, node], found[1, node], found[2, node]
        arm_x = ax * cosine - half * kx
        arm_y = ay * cosine + by * sine - half * ky
        arm_z = az * cosine + bz * sine - half * kz
        slope_x, slope_y = found[3, node], found[4, node]
        # Velocity of the node, without the spin.
        vx = ux + wy * arm_z - wz * arm_y
        vy = uy + wz * arm_x - wx * arm_z
        vz = uz + wx * arm_y - wy * arm_x
        rate = slope_x * vx + slope_y * vy - vz
        push = share * depth * max(0.0, 1.0 + damping * rate)
        damping_power += (push - share * depth) * rate
        energy += 0.5 * share * depth * depth
        # The spin moves the node along k x arm; n . (k x arm) = k . (arm x n).
        tx, ty = ky * arm_z - kz * arm_y, kz * arm_x - kx * arm_z
        tz = kx * arm_y - ky * arm_x
        about += push * (tz - slope_x * tx - slope_y * ty)
        vx += spin * tx
        vy += spin * ty
        vz += spin * tz
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
    load[ABOUT] = about
    load[FRICTION_POWER], load[DAMPING_POWER], load[ENERGY] = friction_power, damping_power, energy
    load[SECTORS], load[SECTORS + 1] = front, back
    load[SECTORS + 2], load[SECTORS + 3] = left, right
    return touching


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
def joint_motion(time, motion, place, velocity):  # pragma: no cover - compiled
    """Write the joint's horizontal place and velocity at a time (eqs. 9.2 and 9.3, or a path)."""
    if motion.size > COURSE:
        evaluate_path(time, motion[COURSE:], place, velocity)
        return
    turn = motion[RATE] * time
    place[0] = motion[CIRCLE] * cos(turn) + motion[FEED] * time + motion[START]
    place[1] = motion[CIRCLE] * sin(turn)
    velocity[0] = motion[FEED] - motion[CIRCLE] * motion[RATE] * sin(turn)
    velocity[1] = motion[CIRCLE] * motion[RATE] * cos(turn)


@njit(cache=True, error_model="numpy")
def slope(time, state, motion, contact, nodes, found, room, result):  # pragma: no cover - compiled
    """Write the time derivative of the state, and the loads into `room[2]`; nodes that touch."""
    place, velocity, load = room[0], room[1], room[2]
    joint_motion(time, motion, place, velocity)
    place[2], velocity[2] = state[HEIGHT], state[CLIMB]
    axis, turning = state[AXIS : AXIS + 3], state[TURNING : TURNING + 3]
    touching = rim_load(place, velocity, axis, turning, state[SPIN], contact, nodes, found, load)
    result[HEIGHT] = state[CLIMB]
    result[CLIMB] = (load[FORCE + 2] - motion[FORCE_P]) / motion[MASS]
    disc_derivative(state, load, motion, result)
    return touching


@njit(cache=True, error_model="numpy")
def disc_derivative(state, load, motion, result):  # pragma: no cover - compiled
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
        result[SPIN] = (about - load[ABOUT] + drive) / motion[SPIN_INERTIA]
    else:
        result[SPIN] = 0.0
    result[TWIST] = state[SPIN]
    result[FRICTION_HEAT] = load[FRICTION_POWER]
    result[DAMPING_HEAT] = load[DAMPING_POWER]


@njit(cache=True)
def renormalise_axis(state):  # pragma: no cover - compiled
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
    state, interval, largest_step, tolerance, scale, motion, contact, nodes, track, loads, midway
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
    loads : ndarray, shape (count + 1, LOADS)
        Filled with the loads there, the share of the rim that touches in column 0.
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
    found = work_array(nodes.shape[1])
    accepted, refused = 0, 0
    wish = largest_step
    touching = slope(0.0, state, motion, contact, nodes, found, room, slopes[0])
    track[0], loads[0] = state, room[2]
    loads[0, 0] = touching / nodes.shape[1]
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
                at = time + NODES[s] * step
                touching = slope(at, stage, motion, contact, nodes, found, room, slopes[s])
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
        renormalise_axis(state)
        track[i + 1], loads[i + 1] = state, room[2]
        loads[i + 1, 0] = touching / nodes.shape[1]
    return RUNNING, accepted, refused, midway.shape[0]


@njit(cache=True, error_model="numpy")
def advance_free(state, time, moments, tolerance, scale, motion, track):  # pragma: no cover
    """Integrate the disc alone under moments that are straight lines between the times.

    Parameters are those of `advance`, but for the moments, shape (n, 3), at the times [N m].

    Returns
    -------
    int
        Times reached: all n, or fewer where the steps became too small to go on.
    """
    slopes, stage, load = np.zeros((STAGES, STATES)), state.copy(), np.zeros(LOADS)
    wish, track[0] = time[1] - time[0], state
    for i in range(time.size - 1):
        interval = time[i + 1] - time[i]
        left = interval
        while left > 0.0:
            step = min(wish, left)
            for s in range(STAGES):
                stage_state(slopes, s, state, step, stage)
                share = 1.0 - (left - NODES[s] * step) / interval
                for j in range(3):
                    load[MOMENT + j] = (1.0 - share) * moments[i, j] + share * moments[i + 1, j]
                disc_derivative(stage, load, motion, slopes[s])
            error = step_error(slopes, step, scale) / tolerance
            if error <= 1.0:
                state[:] = stage
                left -= step
            elif step < 1e-9 * interval:
                return i + 1
            wish = step * min(5.0, max(0.2, 0.9 * max(error, 1e-10) ** -0.2))
        renormalise_axis(state)
        track[i + 1] = state
    return time.size
