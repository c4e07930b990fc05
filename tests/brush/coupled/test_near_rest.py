"""The disc at rest, and its derivatives against the contact law written once more."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import SolverError
from robustpolish.polishing import coupled as near_rest
from robustpolish.polishing.contact import rim_nodes
from robustpolish.polishing.coupled import REST_AXIS as AXIS
from robustpolish.polishing.coupled import REST_TURNING as TURNING
from robustpolish.polishing.coupled import BrushAtRest, brush_at_rest
from robustpolish.polishing.surfaces.surface import Surface


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
def test_derivatives_are_those_of_the_law(run):
    rest = brush_at_rest(rp.polishing.BrushParameters.for_run(run), 0.016, 0.0)
    nodes = rim_nodes(near_rest._FINER * near_rest.rim_points(rest.parameters))
    np.testing.assert_allclose(
        complex_load(rest, nodes, np.zeros(10, complex)).real, rest.load, atol=1e-9
    )
    step = 1e-30
    exact = np.column_stack(
        [complex_load(rest, nodes, 1j * step * unit).imag / step for unit in np.eye(10)]
    )
    size = np.abs(exact).max(axis=1, keepdims=True)
    np.testing.assert_allclose(rest.jacobian / size, exact / size, atol=2e-3)


def test_rest_carries_the_polishing_force_without_a_moment():
    for run in (1, 3):
        rest = brush_at_rest(rp.polishing.BrushParameters.for_run(run), 0.016, 0.0)
        assert rest.load[2] == pytest.approx(10.0, rel=1e-9)
        assert np.abs(rest.load[3:]).max() < 1e-8 * 10.0 * 0.01


def test_flat_ground_in_closed_form():
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


def test_any_place_can_be_asked():
    parameters = rp.polishing.BrushParameters()
    rest = brush_at_rest(parameters, 0.016, 0.0)
    same = BrushAtRest.at(parameters, rest.place, rest.axis)
    np.testing.assert_allclose(same.load, rest.load)


def test_no_rest_is_told():
    """A stiff disc askew in the trough stands on two points, which cannot balance its friction."""
    with pytest.raises(SolverError, match="finds no rest"):
        brush_at_rest(rp.polishing.BrushParameters.for_run(2), 0.013, 0.003)
