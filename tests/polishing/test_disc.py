"""Contact along the rim and motion of the free disc, against plain evaluations and closed forms."""

import numpy as np
import pytest

from robustpolish.polishing import contact as disc
from robustpolish.polishing import contact as rim
from robustpolish.polishing.contact import euler_angles, rim_nodes, tilt_angles
from robustpolish.polishing.parameters import BrushParameters
from robustpolish.polishing.surfaces.surface import Surface

# The compiled rim, against a plain evaluation of the law, and its energy.


def _constants(brush: BrushParameters) -> np.ndarray:
    return np.array(
        [
            brush.contact_stiffness,
            brush.contact_damping,
            brush.friction,
            brush.slip_scale,
            *brush.surface.curvatures,
            brush.radius,
            brush.height / 2,
        ]
    )


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
    force = push[:, None] * normal + friction
    return (
        force.sum(axis=0),
        np.cross(arm, force).sum(axis=0),
        -np.sum(friction * slip),
        np.sum((push - elastic) * rate),
        (depth > 0).sum(),
    )


def _random_state(seed: int):
    source = np.random.default_rng(seed)
    axis = np.array([*source.normal(0.0, 0.3, 2), 1.0])
    axis /= np.linalg.norm(axis)
    turning = source.normal(0.0, 20.0, 3)
    turning -= turning @ axis * axis
    place = np.array([0.016, *source.normal(0.0, 0.002, 1), 0.0])
    place[2] = source.uniform(0.0, 0.012)
    return place, source.normal(0.0, 0.1, 3), axis, turning, source.uniform(-400.0, 400.0)


@pytest.mark.parametrize("seed", range(40))
@pytest.mark.parametrize("across", [0.0, 2.5, 5.0])
def test_compiled_rim_equals_the_plain_law(seed: int, across: float) -> None:
    brush, count = BrushParameters(surface=Surface(0.1, across)), 256
    state = _random_state(seed)
    load, scratch = np.zeros(rim.LOADS), np.zeros((3, count))
    touching = rim.rim_load(*state, _constants(brush), rim.rim_nodes(count), scratch, load)
    force, moment, friction, damping, expected = plain_load(brush, count, *state)
    assert touching == expected
    np.testing.assert_allclose(load[0:3], force, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(load[3:6], moment, rtol=1e-10, atol=1e-12)
    assert load[rim.FRICTION_POWER] == pytest.approx(friction, rel=1e-10, abs=1e-12)
    assert load[rim.DAMPING_POWER] == pytest.approx(damping, rel=1e-9, abs=1e-10)
    assert load[rim.FRICTION_POWER] >= 0.0
    assert load[rim.DAMPING_POWER] >= 0.0
    assert np.all(load[rim.SECTORS : rim.SECTORS + 4] >= 0.0)


def test_at_least_half_of_the_random_states_touch() -> None:
    """Keeps the comparison above from passing for want of contact."""
    brush = BrushParameters()
    touching = [plain_load(brush, 256, *_random_state(seed))[4] > 0 for seed in range(40)]
    assert sum(touching) >= 20


def test_force_without_friction_and_damping_has_the_stored_energy_as_potential() -> None:
    brush = BrushParameters(friction=0.0, contact_damping=0.0)
    nodes, scratch = rim.rim_nodes(256), np.zeros((3, 256))
    axis, still = np.array([0.1, -0.2, np.sqrt(1 - 0.05)]), np.zeros(3)

    def load_at(place: np.ndarray) -> np.ndarray:
        load = np.zeros(rim.LOADS)
        rim.rim_load(place, still, axis, still, 0.0, _constants(brush), nodes, scratch, load)
        return load

    place, step = np.array([0.016, 0.001, 0.006]), 1e-7
    load = load_at(place)
    assert load[rim.ENERGY] > 0.0
    for i in range(3):
        shift = step * np.eye(3)[i]
        rise = load_at(place + shift)[rim.ENERGY] - load_at(place - shift)[rim.ENERGY]
        assert load[i] == pytest.approx(-rise / (2 * step), rel=1e-5)


# The disc without moments.

BRUSH = BrushParameters()
MOTION = np.array([
    BRUSH.mass, BRUSH.polishing_force, BRUSH.tilt_inertia, BRUSH.spin_inertia, BRUSH.spin, 0.0,
    BRUSH.rotation_radius, BRUSH.rotation_rate, BRUSH.feed, BRUSH.radius + BRUSH.rotation_radius,
])  # fmt: skip
CONTACT = np.array([1e4, 50.0, 0.35, 0.01, 0.3, 80.0, 0.01, 0.005])
NODES = rim_nodes(64)


def aloft():
    state = np.zeros(disc.STATES)
    state[disc.HEIGHT], state[disc.SPIN] = 100.0, BRUSH.spin
    state[disc.AXES] = [0.0, 0.0, 1.0]
    return state


def free(seconds, three_angles, *, tilt, turning, spin, count=200):
    """Follow the disc far above the ground, without a moment, at the integrator's finest."""
    state, motion = aloft(), MOTION.copy()
    motion[disc.SPIN_NOMINAL], motion[disc.SPIN_DRIVE] = spin, 1e-300 if three_angles else 0.0
    state[disc.AXES] = [np.sin(tilt), 0.0, np.cos(tilt)]
    state[disc.TURNINGS] = np.cross(state[disc.AXES], [0.0, turning[0], turning[1]])
    state[disc.SPIN] = spin
    track, midway = np.empty((count + 1, disc.STATES)), np.empty((count, 3))
    step = seconds / count
    outcome = disc.advance(
        state, step, 0.1 * step, 1e-12, np.ones(disc.STATES), motion, CONTACT, NODES, track, midway
    )
    assert outcome[0] == disc.RUNNING
    return track


@pytest.mark.parametrize("three_angles", [False, True])
def test_without_a_moment_energy_and_momentum_stay(three_angles):
    """Sections 6.4 and 9.3: both models keep them to 1e-9, whatever tilt and speed."""
    track = free(0.1, three_angles, tilt=0.4, turning=(5.0, -8.0), spin=60.0)
    axis, turning, spin = track[:, disc.AXES], track[:, disc.TURNINGS], track[:, disc.SPIN]
    # The spin's energy is a constant, and so large that it would hide any change of the other.
    tilting = np.sum(turning**2, axis=1)
    np.testing.assert_allclose(tilting, tilting[0], rtol=1e-9)
    np.testing.assert_allclose(spin, 60.0, rtol=1e-15)
    momentum = BRUSH.tilt_inertia * turning + BRUSH.spin_inertia * spin[:, None] * axis
    size = np.linalg.norm(momentum[0])
    np.testing.assert_allclose(momentum, np.tile(momentum[0], (201, 1)), atol=1e-9 * size)


@pytest.mark.parametrize("three_angles", [False, True])
def test_without_a_moment_precession_is_steady(three_angles):
    """The axis goes round the angular momentum H at H / I_0, at a constant angle to it."""
    track = free(0.1, three_angles, tilt=0.3, turning=(4.0, 6.0), spin=60.0)
    axis, turning, spin = track[:, disc.AXES], track[:, disc.TURNINGS], track[:, disc.SPIN]
    momentum = BRUSH.tilt_inertia * turning[0] + BRUSH.spin_inertia * spin[0] * axis[0]
    rate = np.linalg.norm(momentum) / BRUSH.tilt_inertia
    pole = momentum / np.linalg.norm(momentum)
    np.testing.assert_allclose(axis @ pole, axis[0] @ pole, atol=1e-9)
    first = axis[0] - (axis[0] @ pole) * pole
    second = np.cross(pole, first)
    angle = np.unwrap(np.arctan2(axis @ second, axis @ first))
    np.testing.assert_allclose(angle, rate * np.linspace(0.0, 0.1, 201), atol=1e-8)


def test_without_a_moment_a_disc_at_rest_stays():
    """Section 9.3, figure 9.5: the spinning disc keeps its axis."""
    track = free(0.1, False, tilt=0.2, turning=(0.0, 0.0), spin=100 * np.pi)
    np.testing.assert_allclose(track[:, disc.AXES], np.tile(track[0, disc.AXES], (201, 1)),
                               atol=1e-12)  # fmt: skip


# Angles of a disc from its axis, there and back, and their rates.

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
