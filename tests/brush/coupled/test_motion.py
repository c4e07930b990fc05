"""Disc and machine in one step scheme: order four, and the rigid machine of the plain brush."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.polishing.coupled import guided_brush, integrate_coupled
from tests.brush.coupled.test_machine import springs


@pytest.fixture(scope="module")
def guided():
    return guided_brush(rp.simulate_brush(run=2, duration=0.02))


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
