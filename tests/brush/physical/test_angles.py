"""Angles of a disc from its axis, there and back, and their rates."""

import numpy as np
import pytest

from robustpolish.polishing.contact import euler_angles, tilt_angles

THETA, PSI = np.array([0.3, -0.2, 0.5]), np.array([-0.4, 0.1, 0.6])


def tilted(theta, psi):
    return np.stack(
        [np.sin(psi), -np.sin(theta) * np.cos(psi), np.cos(theta) * np.cos(psi)], axis=1
    )


def precessed(theta, psi):
    return np.stack(
        [np.sin(theta) * np.sin(psi), -np.sin(theta) * np.cos(psi), np.cos(theta)], axis=1
    )


def test_tilts_come_back():
    theta, psi, *_ = tilt_angles(tilted(THETA, PSI), np.zeros((3, 3)))
    np.testing.assert_allclose(theta, THETA)
    np.testing.assert_allclose(psi, PSI)


def test_nutation_and_precession_come_back():
    theta, psi, *_ = euler_angles(precessed(abs(THETA), PSI), np.zeros((3, 3)))
    np.testing.assert_allclose(theta, abs(THETA))
    np.testing.assert_allclose(psi, PSI)


@pytest.mark.parametrize(("angles", "axis_of"), [(tilt_angles, tilted), (euler_angles, precessed)])
def test_rates_are_the_derivatives(angles, axis_of):
    """The axis moves by w x k; only the part of w across k counts."""
    axis = axis_of(abs(THETA), PSI)
    turning = np.random.default_rng(0).standard_normal((3, 3))
    turning -= np.sum(turning * axis, axis=1)[:, None] * axis
    step = 1e-6 * np.cross(turning, axis)
    ahead, behind = angles(axis + step, turning), angles(axis - step, turning)
    theta_rate, psi_rate = angles(axis, turning)[2:]
    np.testing.assert_allclose(theta_rate, (ahead[0] - behind[0]) / 2e-6, rtol=1e-6)
    np.testing.assert_allclose(psi_rate, (ahead[1] - behind[1]) / 2e-6, rtol=1e-6)


def test_small_tilts_turn_about_x_and_y():
    turning = np.array([[3.0, -2.0, 0.0]])
    _, _, theta_rate, psi_rate = tilt_angles(np.array([[0.0, 0.0, 1.0]]), turning)
    assert (theta_rate[0], psi_rate[0]) == (3.0, -2.0)


def test_a_level_disc_has_no_direction_of_precession():
    level = np.array([[0.0, 0.0, 1.0]])
    theta, psi, theta_rate, psi_rate = euler_angles(level, np.array([[1.0, 2.0, 0.0]]))
    assert (theta[0], psi[0], theta_rate[0], psi_rate[0]) == (0.0, 0.0, 1.0, 0.0)
