"""Contact along the rim and motion of the free disc, against plain evaluations and closed forms."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from robustpolish.polishing import contact as disc
from robustpolish.polishing.brush import contact_constants, motion_constants
from robustpolish.polishing.contact import euler_angles, tilt_angles
from robustpolish.polishing.parameters import BrushParameters
from robustpolish.polishing.surfaces.surface import Surface

# The compiled rim, against a plain evaluation of the law, and its energy.


def compiled_load(brush, count, state):
    load, nodes = np.zeros(disc.LOADS), disc.rim_nodes(count)
    found = disc.work_array(count)
    touching = disc.rim_load(*state, contact_constants(brush), nodes, found, load)
    return load, touching


def plain_load(brush, nodes, place, velocity, axis, turning, spin):
    """The law of the module's docstring with NumPy; force, moment, friction and damping power."""
    first = np.array([1.0, 0.0, 0.0]) - axis[0] * axis
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)
    angle = 2 * np.pi * (np.arange(nodes) + 0.5) / nodes
    arm = brush.radius * (np.outer(np.cos(angle), first) + np.outer(np.sin(angle), second))
    arm -= brush.height / 2 * axis
    point = place + arm
    depth = np.maximum(brush.surface.height(point[:, 0], point[:, 1]) - point[:, 2], 0.0)
    slope_x, slope_y = brush.surface.gradient(point[:, 0], point[:, 1])
    normal = np.stack([-slope_x, -slope_y, np.ones(nodes)], axis=1)
    still = velocity + np.cross(turning, arm)
    rate = -np.einsum("ni,ni->n", normal, still)
    elastic = brush.contact_stiffness / nodes * depth
    push = elastic * np.maximum(0.0, 1.0 + brush.contact_damping * rate)
    moving = velocity + np.cross(turning + spin * axis, arm)
    unit = normal / np.linalg.norm(normal, axis=1)[:, None]
    slip = moving - np.einsum("ni,ni->n", moving, unit)[:, None] * unit
    size = np.sqrt(np.sum(slip**2, axis=1) + brush.slip_scale**2)
    pressure = push * np.linalg.norm(normal, axis=1)
    friction = -brush.friction * (pressure / size)[:, None] * slip
    pushes = push[:, None] * normal
    powers = -np.sum(friction * slip), np.sum((push - elastic) * rate)
    # Pushes have moments across the axis only, for the spin changes no depth.
    moment = np.cross(arm, pushes) @ (np.eye(3) - np.outer(axis, axis)) + np.cross(arm, friction)
    return (pushes + friction).sum(axis=0), moment.sum(axis=0), *powers, (depth > 0).sum()


def _random_state(seed: int):
    source = np.random.default_rng(seed)
    axis = np.array([*source.normal(0.0, 0.3, 2), 1.0])
    axis /= np.linalg.norm(axis)
    turning = source.normal(0.0, 20.0, 3)
    turning -= turning @ axis * axis
    place = np.array([0.016, *source.normal(0.0, 0.002, 1), 0.0])
    place[2] = source.uniform(0.0, 0.012)
    return place, source.normal(0.0, 0.1, 3), axis, turning, source.uniform(-400.0, 400.0)


@pytest.mark.parametrize("across", [0.0, 2.5, 5.0])
def test_compiled_rim_equals_the_plain_law(across: float) -> None:
    brush, contacts = BrushParameters(surface=Surface(0.1, across)), 0
    for seed in range(40):
        state = _random_state(seed)
        load, touching = compiled_load(brush, 256, state)
        force, moment, friction, damping, expected = plain_load(brush, 256, *state)
        assert touching == expected
        contacts += touching > 0
        np.testing.assert_allclose(load[0:3], force, rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(load[3:6], moment, rtol=1e-10, atol=1e-12)
        assert load[disc.FRICTION_POWER] == pytest.approx(friction, rel=1e-10, abs=1e-12)
        assert load[disc.DAMPING_POWER] == pytest.approx(damping, rel=1e-9, abs=1e-10)
        assert load[disc.FRICTION_POWER] >= 0.0
        assert load[disc.DAMPING_POWER] >= 0.0
        assert np.all(load[disc.SECTORS : disc.SECTORS + 4] >= 0.0)
    assert contacts >= (20 if across == 2.5 else 1)  # else it would pass for want of contact


def test_force_without_friction_and_damping_has_the_stored_energy_as_potential() -> None:
    brush = BrushParameters(friction=0.0, contact_damping=0.0)
    axis, still = np.array([0.1, -0.2, np.sqrt(1 - 0.05)]), np.zeros(3)

    def load_at(place: np.ndarray) -> np.ndarray:
        return compiled_load(brush, 256, (place, still, axis, still, 0.0))[0]

    place, step = np.array([0.016, 0.001, 0.006]), 1e-7
    load = load_at(place)
    assert load[disc.ENERGY] > 0.0
    for i, shift in enumerate(step * np.eye(3)):
        rise = load_at(place + shift)[disc.ENERGY] - load_at(place - shift)[disc.ENERGY]
        assert load[i] == pytest.approx(-rise / (2 * step), rel=1e-5)


# The disc without moments.

BRUSH = BrushParameters()


def free(seconds, three_angles, axis, turning, spin, *, count=200):
    """Follow the disc far above the ground, without a moment, at the integrator's finest."""
    state, motion = np.zeros(disc.STATES), motion_constants(BRUSH, False)
    motion[disc.SPIN_NOMINAL], motion[disc.SPIN_DRIVE] = spin, 1e-300 if three_angles else 0.0
    state[disc.HEIGHT], state[disc.SPIN] = 100.0, spin
    state[disc.AXES], state[disc.TURNINGS] = axis, turning
    track, loads = np.empty((count + 1, disc.STATES)), np.empty((count + 1, disc.LOADS))
    step, scale = seconds / count, np.ones(disc.STATES)
    constants, nodes = contact_constants(BRUSH), disc.rim_nodes(64)
    outcome = disc.advance(
        state, step, 0.1 * step, 1e-12, scale, motion, constants, nodes, track, loads,
        np.empty((count, 3)),
    )  # fmt: skip
    assert outcome[0] == disc.RUNNING
    assert not loads.any()
    return track[:, disc.AXES], track[:, disc.TURNINGS], track[:, disc.SPIN]


def tilted(tilt, turning):
    axis = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    return axis, np.cross(axis, [0.0, *turning])


@pytest.mark.parametrize("three_angles", [False, True])
def test_without_a_moment_energy_and_momentum_stay(three_angles):
    """Sections 6.4 and 9.3: both models keep them to 1e-9, whatever tilt and speed."""
    axis, turning, spin = free(0.1, three_angles, *tilted(0.4, (5.0, -8.0)), 60.0)
    # The spin's energy is a constant, and so large that it would hide any change of the other.
    tilting = np.sum(turning**2, axis=1)
    np.testing.assert_allclose(tilting, tilting[0], rtol=1e-9)
    np.testing.assert_allclose(spin, 60.0, rtol=1e-15)
    momentum = BRUSH.tilt_inertia * turning + BRUSH.spin_inertia * spin[:, None] * axis
    size = np.linalg.norm(momentum[0])
    np.testing.assert_allclose(momentum, np.tile(momentum[0], (201, 1)), atol=1e-9 * size)
    # The axis goes round the angular momentum H at H / I_0, at a constant angle to it.
    pole = momentum[0] / size
    np.testing.assert_allclose(axis @ pole, axis[0] @ pole, atol=1e-9)
    first = axis[0] - (axis[0] @ pole) * pole
    angle = np.unwrap(np.arctan2(axis @ np.cross(pole, first), axis @ first))
    rate = size / BRUSH.tilt_inertia
    np.testing.assert_allclose(angle, rate * np.linspace(0.0, 0.1, 201), atol=1e-8)


def test_without_a_moment_a_disc_at_rest_stays():
    """Section 9.3, figure 9.5: the spinning disc keeps its axis."""
    axis, *_ = free(0.1, False, *tilted(0.2, (0.0, 0.0)), 100 * np.pi)
    np.testing.assert_allclose(axis, np.tile(axis[0], (201, 1)), atol=1e-12)


def test_free_disc_follows_the_euler_angle_equations() -> None:
    """Far above the surface the motion is that of (6.54) to (6.58) without moments."""
    spin, ratio = 100.0, BRUSH.spin_inertia / BRUSH.tilt_inertia

    def euler(_, q):
        theta, theta_rate, _, psi_rate = q
        sine, cosine = np.sin(theta), np.cos(theta)
        return [
            theta_rate,
            psi_rate**2 * sine * cosine - ratio * psi_rate * sine * spin,
            psi_rate,
            (-2 * psi_rate * theta_rate * cosine + ratio * theta_rate * spin) / sine,
        ]

    theta, theta_rate, psi_rate = 0.6, 3.0, 20.0
    axis = np.array([0.0, -np.sin(theta), np.cos(theta)])
    across = np.cross(axis, [1.0, 0.0, 0.0])
    turning = theta_rate * np.eye(3)[0] + psi_rate * np.sin(theta) * across
    found = euler_angles(*free(0.2, False, axis, turning, spin)[:2])
    times, start = np.linspace(0.0, 0.2, 201), [theta, theta_rate, 0.0, psi_rate]
    expected = solve_ivp(
        euler, (0.0, 0.2), start, t_eval=times, rtol=1e-11, atol=1e-12, method="DOP853"
    ).y
    for values, reference in zip(found, expected[[0, 2, 1, 3]], strict=True):
        np.testing.assert_allclose(values, reference, rtol=1e-6, atol=1e-7)


# Angles of a disc from its axis, there and back, and their rates.

THETA, PSI = np.array([0.3, 0.2, 0.5]), np.array([-0.4, 0.1, 0.6])


@pytest.mark.parametrize(("angles", "euler"), [(tilt_angles, False), (euler_angles, True)])
def test_angles_come_back_and_rates_are_their_derivatives(angles, euler):
    """The axis moves by w x k; only the part of w across k counts."""
    axis = disc.disc_axis(THETA, PSI, euler).T
    turning = np.random.default_rng(0).standard_normal((3, 3))
    turning -= np.sum(turning * axis, axis=1)[:, None] * axis
    step = 1e-6 * np.cross(turning, axis)
    ahead, behind = angles(axis + step, turning), angles(axis - step, turning)
    theta, psi, theta_rate, psi_rate = angles(axis, turning)
    np.testing.assert_allclose([theta, psi], [THETA, PSI])
    np.testing.assert_allclose(theta_rate, (ahead[0] - behind[0]) / 2e-6, rtol=1e-6)
    np.testing.assert_allclose(psi_rate, (ahead[1] - behind[1]) / 2e-6, rtol=1e-6)
    at_first = [part[0] for part in (theta, psi, theta_rate, psi_rate)]
    again = disc.axis_and_turning(*at_first, euler=euler)
    np.testing.assert_allclose(again, [axis[0], turning[0]], atol=1e-12)


def test_level_discs_turn_about_x_and_y_and_have_no_precession():
    level, turning = np.array([[0.0, 0.0, 1.0]]), np.array([[3.0, -2.0, 0.0]])
    assert [float(part[0]) for part in tilt_angles(level, turning)] == [0.0, 0.0, 3.0, -2.0]
    assert [float(part[0]) for part in euler_angles(level, turning)] == [0.0, 0.0, 3.0, 0.0]
