"""Contact along the rim and motion of the free disc, against plain evaluations and closed forms."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from robustpolish.errors import InvalidInputError, SolverError
from robustpolish.polishing import contact as disc
from robustpolish.polishing.brush import contact_constants, motion_constants
from robustpolish.polishing.contact import euler_angles, tilt_angles
from robustpolish.polishing.parameters import BrushParameters
from robustpolish.polishing.simulate import simulate_disc
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
    force = push[:, None] * normal + friction
    powers = -np.sum(friction * slip), np.sum((push - elastic) * rate)
    return force.sum(axis=0), np.cross(arm, force).sum(axis=0), *powers, (depth > 0).sum()


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


# The disc under given moments.


def test_without_a_moment_the_disc_keeps_its_axis():
    """Section 9.3, figure 9.5: over 5 s of the path, on which the surface rises and falls."""
    time = np.linspace(0.0, 5.0, 501)
    run = simulate_disc(time, np.zeros((501, 3)), initial=(0.2, -0.1, 0.0, 0.0))
    np.testing.assert_allclose(run.theta, 0.2, atol=1e-12)
    np.testing.assert_allclose(run.psi, -0.1, atol=1e-12)
    assert np.ptp(run.surface_height.values) > 5e-5
    assert np.ptp(run.elevation.values) > 0.01


def test_a_steady_moment_precesses_a_level_disc():
    """(6.59) to (6.62) with M^x: theta = a (1 - cos vt), psi = a (vt - sin vt), v = p I/I_0."""
    time, moment = np.linspace(0.0, 0.1, 1001), 1e-5
    nutation = BRUSH.spin * BRUSH.spin_inertia / BRUSH.tilt_inertia
    size, turn = moment / (BRUSH.tilt_inertia * nutation**2), nutation * time
    run = simulate_disc(time, np.tile([moment, 0.0, 0.0], (1001, 1)))
    np.testing.assert_allclose(run.theta, size * (1 - np.cos(turn)), atol=1e-6 * size)
    np.testing.assert_allclose(run.psi, size * (turn - np.sin(turn)), atol=1e-6 * size)


def test_a_moment_along_the_nodes_keeps_a_steady_precession():
    """(6.44) at constant nutation, with the moment that goes round with the precession."""
    nutation, rate, time = 0.4, 3.0, np.linspace(0.0, 1.0, 5001)
    moment = BRUSH.spin_inertia * BRUSH.spin - BRUSH.tilt_inertia * rate * np.cos(nutation)
    nodes = np.stack([np.cos(rate * time), np.sin(rate * time), 0.0 * time], axis=1)
    moments = moment * rate * np.sin(nutation) * nodes
    run = simulate_disc(time, moments, disc="three-angle", initial=(nutation, 0.0, 0.0, rate))
    np.testing.assert_allclose(run.theta, nutation, atol=1e-7)
    np.testing.assert_allclose(run.psi, rate * time, atol=1e-7)
    np.testing.assert_allclose(run.omega_z, BRUSH.spin, atol=1e-7)


def test_a_moment_about_the_axis_slows_the_spin_against_the_drive():
    """I w' = M + c (p - w), with M = -g t: (p - w) c/g = t - b (1 - exp(-t / b)), b = I/c."""
    time, drive = np.linspace(0.0, 0.01, 51), BRUSH.spindle_damping
    lag, moments = BRUSH.spin_inertia / drive, np.outer(time, [0.0, 0.0, -10.0])
    run = simulate_disc(time, moments, disc="three-angle")
    slowed = 10.0 / drive * (time - lag * (1.0 - np.exp(-time / lag)))
    np.testing.assert_allclose(run.omega_z, BRUSH.spin - slowed, rtol=1e-10)


def test_disc_follows_the_euler_angle_equations() -> None:
    """(6.54) to (6.58), moments along the nodes and across them given in world axes."""
    spin, ratio, first = 100.0, BRUSH.spin_inertia / BRUSH.tilt_inertia, (0.6, 0.0, 3.0, 20.0)
    along, across = np.array([0.004, -0.003]) / BRUSH.tilt_inertia

    def euler(_, q):
        theta, _, theta_rate, psi_rate = q
        sine, cosine = np.sin(theta), np.cos(theta)
        nutation = along + psi_rate**2 * sine * cosine - ratio * psi_rate * sine * spin
        precession = across - 2 * psi_rate * theta_rate * cosine + ratio * theta_rate * spin
        return [theta_rate, psi_rate, nutation, precession / sine]

    time = np.linspace(0.0, 0.2, 4001)
    expected = solve_ivp(
        euler, (0.0, 0.2), first, t_eval=time, rtol=1e-11, atol=1e-12, method="DOP853"
    ).y
    axis, psi = disc.disc_axis(expected[0], expected[1], True), expected[1]
    nodes = np.stack([np.cos(psi), np.sin(psi), np.zeros_like(psi)])
    moments = BRUSH.tilt_inertia * (along * nodes + across * np.cross(axis, nodes, axis=0))
    given = {"parameters": BrushParameters(spin=spin), "disc": "three-angle", "initial": first}
    run = simulate_disc(time, moments.T, **given)
    for name, values in zip(("theta", "psi", "theta_rate", "psi_rate"), expected, strict=True):
        np.testing.assert_allclose(run[name], values, atol=1e-5 * np.ptp(values))


@pytest.mark.parametrize(
    "wrong",
    [{"time": [0.0, 0.0]}, {"time": [0.0, np.inf]}, {"moment": np.zeros((3, 3))},
     {"initial": (0.1, 0.2)}, {"disc": "flat"}, {"parameters": 3.0}],
)  # fmt: skip
def test_wrong_arguments_of_a_driven_disc_are_named(wrong):
    with pytest.raises(InvalidInputError, match=next(iter(wrong))):
        simulate_disc(**{"time": [0.0, 1.0], "moment": np.zeros((2, 3)), **wrong})
    with pytest.raises(SolverError, match="too fast"):
        simulate_disc([0.0, 1.0], np.full((2, 3), 1e200))


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
