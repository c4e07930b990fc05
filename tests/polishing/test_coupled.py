"""Brush and machine that feel each other: linear machine, steps, rest of the disc, passes."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError, RobustPolishWarning, SolverError
from robustpolish.polishing import coupled as near_rest
from robustpolish.polishing.brush import rim_points
from robustpolish.polishing.contact import rim_nodes
from robustpolish.polishing.coupled import REST_AXIS as AXIS
from robustpolish.polishing.coupled import REST_TURNING as TURNING
from robustpolish.polishing.coupled import (
    BrushAtRest,
    LinearMachine,
    brush_at_rest,
    guided_brush,
    integrate_coupled,
    run_coupled,
)
from robustpolish.polishing.surfaces.surface import Surface

# The machine as contact sees it: rest, stiffness, and steps that are exact.

MASS, STIFF, DAMP = 0.2, np.array([1e5, 2e5, 4e6]), 30.0


def springs(steady=(0.0, 0.0, 0.0)):
    A, B, C = np.zeros((6, 6)), np.zeros((6, 3)), np.zeros((3, 6))
    for i, k in enumerate(STIFF):
        A[2 * i, 2 * i + 1] = 1.0
        A[2 * i + 1, 2 * i : 2 * i + 2] = -k / MASS, -DAMP / MASS
        B[2 * i + 1, i], C[i, 2 * i] = 1 / MASS, 1.0
    return LinearMachine(A, B, B @ steady, C)


def test_rest_and_stiffness_and_what_is_refused():
    machine = springs((0.0, 0.0, -10.0))
    np.testing.assert_allclose(machine.stiffness, STIFF, rtol=1e-9)
    rest = machine.rest(np.array([3.0, 0.0, 10.0]))
    np.testing.assert_allclose(machine.C @ rest, [3.0 / STIFF[0], 0.0, 0.0], atol=1e-18)
    loose = springs()
    A = loose.A.copy()
    A[1, 0] = 0.0
    with pytest.raises(InvalidInputError, match="pole at zero"):
        LinearMachine(A, loose.B, loose.g, loose.C).rest(np.ones(3))
    with pytest.raises(InvalidInputError, match="with a mass"):
        LinearMachine(-np.eye(3), np.eye(3), np.zeros(3), np.eye(3))


# Disc and machine in one step scheme: order four, and the rigid machine of the plain brush.


@pytest.fixture(scope="module")
def guided():
    return guided_brush(rp.polishing.simulate_brush(run=2, duration=0.02))


def test_steps_are_of_fourth_order(guided):
    """Halving takes most of a factor of sixteen; kinks where points touch cost some."""
    runs = [integrate_coupled(guided, springs(), steps)[1] for steps in (2, 4, 32)]
    errors = [np.abs(run[-1] - runs[-1][-1])[::2].max() for run in runs[:-1]]
    assert errors[1] < errors[0] / 6


def test_impulses_and_momentum_of_the_machine(guided):
    """What the contact gives to the disc it takes from the machine: an audit by the trapezium."""
    machine = springs()
    run, states = integrate_coupled(guided, machine, 8)
    assert run is not None
    place, speed = states[:, ::2], states[:, 1::2]
    springs_and_dampers = 30.0 * place + machine.stiffness * np.cumsum(
        np.vstack([np.zeros(3), 0.5 * np.diff(guided.time)[:, None] * (place[1:] + place[:-1])]),
        axis=0,
    )
    change = 0.2 * (speed - speed[0]) + springs_and_dampers - springs_and_dampers[0]
    impulse = run.track[:, 10:13]
    np.testing.assert_allclose(change, impulse, atol=2e-4 * np.abs(impulse).max())


# Coupled runs: the rigid limit, complaints, and what the check says.


def test_passes_agree_and_are_counted(guided):
    good = springs()
    _, states, check = run_coupled(guided, good, tolerance=1e-3, max_passes=4)
    assert (check["converged"], check["passes"]) == (1, 2)
    assert states.shape == (401, 6)
    with pytest.warns(RobustPolishWarning, match="passes differ"):
        run_coupled(guided, good, tolerance=1e-14, max_passes=2)
    A = good.A.copy()
    A[1::2, 1::2] = 2e5 * np.eye(3)  # unstable
    with pytest.raises(SolverError, match="swing up"):
        run_coupled(guided, LinearMachine(A, good.B, good.g, good.C), tolerance=1e-3, max_passes=2)


# The disc at rest, and its derivatives against the contact law written once more.


def complex_load(rest, nodes, change):
    """The law of rim_contact for complex numbers, which differentiate it without differences."""
    p = rest.parameters
    tilt, turning = change[AXIS], change[TURNING]
    root = np.sqrt(1 - tilt @ tilt)
    axis = tilt @ rest.across + root * rest.axis
    turns = turning @ rest.across - (turning @ tilt) / root * rest.axis
    norm = np.sqrt(1 - axis[0] ** 2)
    first = np.array([norm, -axis[0] * axis[1] / norm, -axis[0] * axis[2] / norm])
    second = np.array([0, axis[2] / norm, -axis[1] / norm])
    arms = p.radius * (np.outer(nodes[0], first) + np.outer(nodes[1], second))
    arms = arms - 0.5 * p.height * axis
    at = rest.place + change[:3] + arms
    bend = np.array(p.surface.curvatures)
    depth = 0.5 * (at[:, :2] ** 2) @ bend - at[:, 2]
    touching = depth.real > 0
    arms, at, depth = arms[touching], at[touching], depth[touching]
    slope = at[:, :2] * bend
    flat = change[3:6] + np.cross(np.broadcast_to(turns, arms.shape), arms)
    rate = (slope * flat[:, :2]).sum(1) - flat[:, 2]
    push = p.contact_stiffness / nodes.shape[1] * depth * (1 + p.contact_damping * rate)
    spun = flat + p.spin * np.cross(np.broadcast_to(axis, arms.shape), arms)
    normal = np.column_stack([-slope, np.ones(len(slope))])
    length = (normal**2).sum(1)
    slip = spun - ((spun * normal).sum(1) / length)[:, None] * normal
    drag = p.friction * push * np.sqrt(length) / np.sqrt((slip**2).sum(1) + p.slip_scale**2)
    force = push[:, None] * normal - drag[:, None] * slip
    moment = np.cross(arms, force).sum(0)
    return np.concatenate([force.sum(0), rest.across @ (moment - (moment @ axis) * axis)])


@pytest.mark.parametrize("run", [1, 2, 3, 4])
def test_rest_carries_the_polishing_force_and_derivatives_are_those_of_the_law(run):
    rest = brush_at_rest(rp.polishing.BrushParameters.for_run(run), 0.016, 0.0)
    assert rest.load[2] == pytest.approx(10.0, rel=1e-9)
    assert np.abs(rest.load[3:]).max() < 1e-8 * 10.0 * 0.01
    again = BrushAtRest.at(rest.parameters, rest.place, rest.axis)
    np.testing.assert_allclose(again.load, rest.load)
    nodes = rim_nodes(near_rest._FINER * rim_points(rest.parameters))
    np.testing.assert_allclose(
        complex_load(rest, nodes, np.zeros(10, complex)).real, rest.load, atol=1e-9
    )
    step = 1e-30
    exact = np.column_stack(
        [complex_load(rest, nodes, 1j * step * unit).imag / step for unit in np.eye(10)]
    )
    size = np.abs(exact).max(axis=1, keepdims=True)
    np.testing.assert_allclose(rest.jacobian / size, exact / size, atol=2e-3)


def test_flat_ground_in_closed_form_and_where_there_is_no_rest():
    """k_p down, mu F_p / (2 r p) along the ground, k_p r^2 / 2 against tilts; chi F_p down."""
    plane = rp.polishing.BrushParameters(
        surface=Surface.flat(), contact_stiffness=1e6, slip_scale=1e-6
    )
    rest = brush_at_rest(plane, 0.0, 0.0)
    np.testing.assert_allclose(rest.axis, [0, 0, 1], atol=1e-9)
    assert rest.stiffness == pytest.approx(1e6, rel=1e-6)
    # Of the slip's two directions the one along the rim turns with friction, the other does not.
    along = plane.friction * 10.0 / (2 * plane.radius * plane.spin)
    np.testing.assert_allclose(rest.damping, [along, along, 50.0 * 10.0], rtol=1e-3)
    # A stiff disc askew in the trough stands on two points, which cannot balance its friction.
    with pytest.raises(SolverError, match="finds no rest"):
        brush_at_rest(rp.polishing.BrushParameters.for_run(2), 0.013, 0.003)
