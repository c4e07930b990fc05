"""A loop as the brush sees it: signals by name, signs, complaints."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.polishing.coupled_loops import carrier


def springs(stiffness, ratio=1.0, mass=0.2):
    """A mass on three springs with dampers, signs as (8.45)."""
    damping = 2 * ratio * np.sqrt(stiffness * mass)
    A = np.kron(np.eye(3), [[0.0, 1.0], [-stiffness / mass, -damping / mass]])
    B = np.kron(np.diag([-1.0, -1.0, 1.0]) / mass, [[0.0], [1.0]])
    C = np.kron(np.eye(3), [[1.0, 0.0]])
    return control.ss(A, B, C, 0, inputs=["F_x", "F_y", "F_z"], outputs=["x", "y", "z"])


def test_the_air_bearing_yields_as_its_springs_say():
    p = rp.polishing.AirBearingParameters()
    carried = carrier(rp.air_bearing(p), 10.0)
    sideways = 1 / (1 / p.k_t + 1 / p.k_x)
    along = 1 / (1 / p.k_A + 1 / p.k_z)
    np.testing.assert_allclose(carried.machine.stiffness, [sideways, sideways, along], rtol=1e-6)
    rest = carried.machine.C @ carried.machine.rest(np.array([1.0, 2.0, 10.0]))
    # Contact pushes along its force; F_p on the bearing and F_z on the brush stretch the spindle.
    np.testing.assert_allclose(rest, [1 / sideways, 2 / sideways, 10 / p.k_z], rtol=1e-6)


def test_inputs_have_the_signs_of_the_thesis():
    carried = carrier(rp.air_bearing(), 10.0)
    given = carried.inputs(np.array([[1.0, 2.0, 3.0]]), 10.0)
    assert given.tolist() == [[-1.0, -2.0, 3.0, 10.0]]


def test_loops_that_do_not_fit_are_refused():
    good = springs(1e6)
    with pytest.raises(InvalidInputError, match="F_z is missing"):
        carrier(control.ss(good, inputs=["F_x", "F_y", "push"]), 10.0)
    with pytest.raises(InvalidInputError, match="z is missing"):
        carrier(control.ss(good, outputs=["x", "y", "q"]), 10.0)
    with pytest.raises(InvalidInputError, match="discrete time"):
        carrier(control.c2d(good, 1e-4), 10.0)
    gain = np.kron(np.eye(6), [[-1e6, -200.0]])
    design = rp.given_controller(rp.air_bearing(actuation="force"), gain)
    with pytest.raises(InvalidInputError, match="a sampled design"):
        carrier(design.discretize(1e-5), 10.0)
    at_once = control.ss(
        good.A, good.B, good.C, np.eye(3), inputs=["F_x", "F_y", "F_z"], outputs=["x", "y", "z"]
    )
    with pytest.raises(InvalidInputError, match="with a mass"):
        carrier(at_once, 10.0)
