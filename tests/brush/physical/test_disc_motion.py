"""The disc in its joint: led along the path, falling, turning."""

import numpy as np
import pytest

from robustpolish.polishing import contact as disc
from robustpolish.polishing.contact import LOADS, rim_nodes
from robustpolish.polishing.dataset import tool_position, tool_velocity
from robustpolish.polishing.parameters import BrushParameters

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


def slope(state, motion=MOTION):
    result, room = np.zeros(disc.STATES), np.zeros((3, LOADS))
    disc.slope(0.0, state, motion, CONTACT, NODES, np.zeros((3, 64)), room, result)
    return result


def test_the_joint_is_led_along_the_path_of_the_tool():
    place, velocity = np.zeros(3), np.zeros(3)
    for time in (0.0, 0.1, 2.7):
        disc.joint_motion(time, MOTION, place, velocity)
        np.testing.assert_allclose(place[:2], tool_position(time, BRUSH), rtol=1e-14)
        np.testing.assert_allclose(velocity[:2], tool_velocity(time, BRUSH), rtol=1e-12)


def test_aloft_only_the_polishing_force_acts():
    found = slope(aloft())
    expected = np.zeros(disc.STATES)
    expected[disc.CLIMB] = -BRUSH.polishing_force / BRUSH.mass
    expected[disc.TWIST] = BRUSH.spin
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_a_spinning_disc_yields_sideways():
    """A turn about x moves the axis towards -y; the spin answers about y."""
    state = aloft()
    state[disc.TURNING] = 2.0
    found = slope(state)
    np.testing.assert_allclose(found[disc.AXES], [0.0, -2.0, 0.0])
    gyro = BRUSH.spin_inertia * BRUSH.spin / BRUSH.tilt_inertia
    np.testing.assert_allclose(found[disc.TURNINGS], [0.0, 2.0 * gyro, 0.0])


def test_the_drive_brings_a_lost_spin_back():
    state, motion = aloft(), MOTION.copy()
    motion[disc.SPIN_DRIVE] = 0.01
    state[disc.SPIN] = BRUSH.spin - 3.0
    assert slope(state, motion)[disc.SPIN] == pytest.approx(0.03 / BRUSH.spin_inertia)


def advance(state, count=50):
    track, midway = np.empty((count + 1, disc.STATES)), np.empty((count, 3))
    outcome = disc.advance(
        state, 1e-3, 1e-3, 1e-8, np.ones(disc.STATES), MOTION, CONTACT, NODES, track, midway
    )
    return outcome, track, midway


def test_it_falls_in_a_parabola_and_stays_a_disc():
    state = aloft()
    state[disc.TURNINGS] = [1.0, -2.0, 0.0]
    (outcome, steps, refused, done), track, midway = advance(state)
    assert (outcome, done) == (disc.RUNNING, 50)
    assert steps + refused >= 50
    time = 1e-3 * np.arange(51)
    fallen = 0.5 * BRUSH.polishing_force / BRUSH.mass * time**2
    np.testing.assert_allclose(100.0 - track[:, disc.HEIGHT], fallen, atol=1e-10)
    axis, turning = track[:, disc.AXES], track[:, disc.TURNINGS]
    np.testing.assert_allclose(np.linalg.norm(axis, axis=1), 1.0, rtol=1e-14)
    np.testing.assert_allclose(np.sum(axis * turning, axis=1), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(turning, axis=1), np.sqrt(5.0), rtol=1e-6)
    assert not midway.any()


def test_a_disc_that_tips_over_ends_the_run():
    state = aloft()
    state[disc.AXES] = [np.sqrt(0.99), 0.0, 0.1]
    assert advance(state)[0] == (disc.TIPPED_OVER, 1, 0, 0)


def test_nothing_touches_aloft():
    loads = np.full((2, LOADS), np.nan)
    track = np.array([aloft(), aloft()])
    disc.loads_along(np.array([0.0, 1.0]), track, MOTION, CONTACT, NODES, loads)
    np.testing.assert_array_equal(loads, np.zeros((2, LOADS)))


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
