"""Linear models of nonlinear ones near an equilibrium."""

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError, SolverError
from robustpolish.plants.linearization import linearize


def duffing(q, u):
    position, speed = q
    return [speed, -4.0 * position - position**3 - 0.1 * speed + u[0]]


def test_equilibrium_and_jacobian_of_a_duffing_oscillator():
    """At rest under u = 5 the position is 1, where the stiffness is 4 + 3."""
    answer = linearize(
        duffing, [0.8, 0.1], [5.0], states=["q", "dq"], inputs=["F"], outputs=["a", "b"]
    )
    np.testing.assert_allclose(answer.state, [1, 0], atol=1e-10)
    np.testing.assert_allclose(answer.system.A, [[0, 1], [-7, -0.1]], atol=1e-8)
    np.testing.assert_allclose(answer.system.B, [[0], [1]], atol=1e-8)
    assert answer.system.state_labels == ["q", "dq"]


def test_output_map():
    answer = linearize(duffing, [1, 0], [5.0], output=lambda q, u: [q[0] ** 2, u[0] * q[1]])
    np.testing.assert_allclose(answer.system.C, [[2, 0], [0, 5]], atol=1e-8)
    np.testing.assert_allclose(answer.system.D, [[0], [0]], atol=1e-8)


def test_small_states_need_their_scale():
    """sin(q / 1e-9) has its slope at the scale of nanometres."""
    answer = linearize(lambda q, u: u - np.sin(q / 1e-9), [1e-12], [0.0], scale=[1e-9, 1.0])
    np.testing.assert_allclose(answer.system.A, [[-1e9]], rtol=1e-8)


def test_a_point_that_is_no_equilibrium_is_refused():
    with pytest.raises(InvalidInputError, match="state: got a state with relative residual"):
        linearize(duffing, [1, 0], [0.0], find_equilibrium=False)


def test_a_model_without_equilibrium_is_refused():
    with pytest.raises((SolverError, InvalidInputError), match="state:"):
        linearize(lambda q, u: np.exp(q) + u, [0.0], [1.0])


def test_bad_shapes_are_named():
    with pytest.raises(InvalidInputError, match="dynamics: got a result of shape"):
        linearize(lambda q, u: [1.0], [0.0, 0.0])
    with pytest.raises(InvalidInputError, match="scale: got"):
        linearize(duffing, [1, 0], [5.0], scale=[1.0])
    with pytest.raises(InvalidInputError, match="control_value: got"):
        linearize(lambda q, u: -q, [0.0])
