"""Listings D.1 to D.3 of the thesis, right-hand side and forces, mistakes included.

Variable names follow the listings where that helps to compare line by line.
"""

from __future__ import annotations

from math import atan, atan2, cos, hypot, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from robustpolish.brush.listing.defects import ListingDefects
from robustpolish.brush.parameters import BrushParameters
from robustpolish.compiling import njit

# Places in the vector of switches: the order of the fields of ListingDefects.
(
    INTERPOLATION_WEIGHT,
    BEARING_GATE,
    GRAVITY_TERMS,
    POLISHING_FORCE_DROPPED,
    TILT_COSINE,
    INERTIA_RADIUS,
    IMPACT_MASS,
    PULLING_SURFACE,
    FEED_FRICTION,
) = range(9)

# Places in the vector of constants.
(
    RADIUS,
    RIM_DISTANCE,
    HALF_HEIGHT,
    CIRCLE,
    RATE,
    FEED,
    SPIN,
    IMPACT_WEIGHT,  # mass that hits
    MASS,
    TILT_INERTIA,
    SPIN_INERTIA,
    FRICTION,
    STIFFNESS,
    IMPACT_DURATION,
    FORCE_P,
    BEND_X,
    BEND_Y,
) = range(17)

LAYER = 0.001  # depth [m] of the liquid layer in which C1 and C2 move freely (D.1, line 86)
UPRIGHT = 0.5 * pi  # psi_0

# On a plane without friction the pushes of C1 and C2 are 0/0, as in the listings, and no error.
# Said here, for Numba takes it from the first caller else: the order of calls would decide.


def listing_constants(parameters: BrushParameters, defects: ListingDefects) -> NDArray[np.float64]:
    """Return the constants of the listings, in SI units."""
    r = parameters.rim_distance
    inertia_radius = r if defects.inertia_radius else parameters.radius
    tilt = parameters.mass * (3.0 * inertia_radius**2 + parameters.height**2) / 12.0
    hitting = parameters.mass if defects.impact_mass else tilt / r**2
    return np.array(
        [
            parameters.radius,
            r,
            0.5 * parameters.height,
            parameters.rotation_radius,
            parameters.rotation_rate,
            parameters.feed,
            parameters.spin,
            hitting,
            parameters.mass,
            tilt,
            0.5 * parameters.mass * inertia_radius**2,
            parameters.friction,
            parameters.contact_stiffness,
            parameters.impact_duration,
            parameters.polishing_force,
            *parameters.trough.curvatures,
        ]
    )


@njit(cache=True)
def _height(x, y, c):  # pragma: no cover - compiled
    return 0.5 * (c[BEND_X] * x * x + c[BEND_Y] * y * y)


@njit(cache=True)
def _elevation(nx, ny, x, y, c):  # pragma: no cover - compiled
    """Angle of elevation along the unit vector n (9.4, 9.5)."""
    return atan(nx * c[BEND_X] * x + ny * c[BEND_Y] * y)


@njit(cache=True, error_model="numpy")
def impact(t, theta, theta_rate, psi, psi_rate, c, flags):  # pragma: no cover - compiled
    """Contacts of the brush: D.1 lines 51 to 118, D.2 lines 64 to 126.

    Returns
    -------
    tuple
        theta_0, alpha, beta [rad]; F_psi and F_theta [N] as D.2 has them, the latter as if its
        gate were open; whether C1 and C2, C3, and C4 touch.
    """
    omega, r_rot, rd, r = c[RATE], c[CIRCLE], c[RADIUS], c[RIM_DISTANCE]
    cosine, sine = cos(omega * t), sin(omega * t)
    centre = c[FEED] * t + rd + r_rot
    x, y = r_rot * cosine + centre, r_rot * sine
    vx, vy = c[FEED] - omega * r_rot * sine, omega * r_rot * cosine
    speed = hypot(vx, vy)
    nx, ny = vx / speed, vy / speed
    theta0 = _elevation(nx, ny, r + r_rot, 0.0, c)
    reach = rd * (abs(cos(theta) - theta0) if flags[TILT_COSINE] else cos(theta - theta0))
    x1, y1, x2, y2 = x + reach * nx, y + reach * ny, x - reach * nx, y - reach * ny
    side = rd * abs(cos(psi - UPRIGHT))
    x3, y3 = (r_rot - side) * cosine + centre, (r_rot - side) * sine
    x4, y4 = (r_rot + side) * cosine + centre, (r_rot + side) * sine
    xi1, xi2 = _elevation(nx, ny, x1, y1, c), _elevation(nx, ny, x2, y2, c)
    middle = 0.5 * (_height(x1, y1, c) + _height(x2, y2, c))
    dh3, dh4 = middle - _height(x3, y3, c), middle - _height(x4, y4, c)
    mu = c[FRICTION]
    if not flags[FEED_FRICTION]:
        mu *= speed / hypot(speed, c[SPIN] * rd)
    sigma = atan(mu)
    alpha, beta = abs(xi2) - sigma, abs(xi1) + sigma
    lift = r * sin(psi - UPRIGHT)
    v0, v1 = psi_rate * r, theta_rate * r
    impulse = c[IMPACT_WEIGHT] * v0 / c[IMPACT_DURATION]
    near = sqrt(c[MASS] / c[STIFFNESS]) * abs(v0)
    force_psi = 0.0
    if dh3 > 0.0:
        touch3 = dh3 - abs(lift) <= near and psi > UPRIGHT
        if touch3:
            force_psi = abs(impulse)
    else:
        touch3 = dh3 - lift < near and psi_rate > 0.0
        if touch3:
            force_psi = impulse
    if dh4 > 0.0:
        touch4 = abs(dh4) - abs(lift) <= near and psi < UPRIGHT
        if touch4:
            force_psi = -abs(impulse)
    else:
        touch4 = dh4 + lift < near and psi_rate < 0.0
        if touch4:
            force_psi = -impulse
    touch1 = abs(theta - theta0 - xi1) > atan(LAYER / r)
    force_theta = -c[IMPACT_WEIGHT] * v1 / c[IMPACT_DURATION] if touch1 else 0.0
    return theta0, alpha, beta, force_psi, force_theta, touch1, touch3, touch4


@njit(cache=True, error_model="numpy")
def brush_slope(t, w, c, flags, result):  # pragma: no cover - compiled
    """Right-hand side of D.1, w = (theta, theta', psi, psi')."""
    theta, theta_rate, psi, psi_rate = w[0], w[1], w[2], w[3]
    theta0, alpha, beta, _, _, touch1, touch3, touch4 = impact(
        t, theta, theta_rate, psi, psi_rate, c, flags
    )
    r, rd = c[RIM_DISTANCE], c[RADIUS]
    weight, inertia, duration = c[IMPACT_WEIGHT], c[TILT_INERTIA], c[IMPACT_DURATION]
    v0, v1 = psi_rate * r, theta_rate * r
    moment_i, moment_j = 0.0, 0.0
    # The impulse is that of the velocity before; the velocity is overwritten all the same.
    if touch3 or touch4:
        moment_j = -weight * v0 * r / duration
        psi_rate = -weight * v0 * rd / (inertia * abs(cos(psi - UPRIGHT)))
    if touch1 and theta_rate != 0.0:
        moment_i = -weight * v1 * r / duration
        theta_rate = -weight * theta_rate * r * rd / (inertia * abs(cos(theta - theta0)))
    lean = UPRIGHT - atan2(rd, c[HALF_HEIGHT])
    force2 = c[FORCE_P] * sin(beta) / sin(alpha + beta)
    force1 = c[FORCE_P] / cos(beta) * (1.0 - cos(alpha) * sin(beta) / sin(alpha + beta))
    if not flags[PULLING_SURFACE]:
        force1, force2 = max(0.0, force1), max(0.0, force2)
    moment_i += (force1 * cos(beta + lean) - force2 * cos(alpha + lean)) * r
    gyro = c[SPIN_INERTIA] * c[SPIN] / inertia
    result[0] = theta_rate
    result[1] = moment_i / inertia - gyro * psi_rate
    result[2] = psi_rate
    result[3] = moment_j / inertia + gyro * theta_rate
