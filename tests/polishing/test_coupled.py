"""Brush and machine that feel each other: linear machine, steps, rest of the disc, passes."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import SolverError
from robustpolish.polishing.coupled import (
    LinearMachine,
    brush_at_rest,
    guided_brush,
    integrate_coupled,
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


# Disc and machine in one step scheme.


@pytest.fixture(scope="module")
def guided():
    return guided_brush(rp.polishing.simulate_brush(run=2, duration=0.02))


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


# The disc at rest.


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
