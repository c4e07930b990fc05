"""The angles by which a disc's attitude is reported, from its axis and angular velocity."""

from __future__ import annotations

import numpy as np

from robustpolish.arrays import Array

_LEVEL = 1e-12  # tilt [rad] below which precession has no direction and is reported as at rest


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
    psi = np.unwrap(np.where(sine > _LEVEL, np.arctan2(kx, -ky), 0.0))
    node = np.stack([np.cos(psi), np.sin(psi), np.zeros_like(psi)], axis=1)
    theta_rate = np.einsum("ni,ni->n", turning, node)
    across = np.einsum("ni,ni->n", turning, np.cross(axis, node))
    psi_rate = np.divide(across, sine, out=np.zeros_like(sine), where=sine > _LEVEL)
    return theta, psi, theta_rate, psi_rate


def axis_and_turning(
    theta: float, psi: float, theta_rate: float, psi_rate: float, *, euler: bool
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
        axis = np.array([sine * side, -sine * level, cosine])
        moving = theta_rate * np.array([cosine * side, -cosine * level, -sine])
        moving += psi_rate * np.array([sine * level, sine * side, 0.0])
    else:
        axis = np.array([side, -sine * level, cosine * level])
        moving = theta_rate * np.array([0.0, -cosine * level, -sine * level])
        moving += psi_rate * np.array([level, sine * side, -cosine * side])
    return axis, np.cross(axis, moving)
