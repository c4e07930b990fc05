"""A plant with its controller."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from tests.models.plant.random_plants import random_plant


@pytest.mark.parametrize("dt", [0, 0.1])
def test_closed_loop_is_the_linear_fractional_transformation(dt):
    rng = np.random.default_rng(1)
    plant = random_plant(rng, dt=dt)
    controller = control.ss(
        rng.standard_normal((3, 3)),
        rng.standard_normal((3, 2)),
        rng.standard_normal((3, 3)),
        rng.standard_normal((3, 2)) * 0.1,
        dt,
    )
    loop = plant.closed_loop(controller)
    for s in (0.3 + 2j, -0.7 + 0.1j, 5.0 + 0j):
        P, K = plant.system(s), controller(s)
        expected = P[:2, :2] + P[:2, 2:] @ K @ np.linalg.solve(np.eye(2) - P[2:, 2:] @ K, P[2:, :2])
        np.testing.assert_allclose(loop(s), expected, rtol=1e-9)


def test_controller_states_get_names_of_their_own():
    plant = random_plant(np.random.default_rng(4))
    same_names = control.ss(-np.eye(2), np.ones((2, 2)), np.ones((3, 2)), 0, states=["x1", "x2"])
    loop = plant.closed_loop(same_names)
    assert len(set(loop.state_labels)) == 6


def test_ill_posed_loop_is_refused():
    plant = rp.GeneralizedPlant.from_matrices(-1, 1, 1, 1, 1, D22=2)
    with pytest.raises(InvalidInputError, match="well-posed"):
        plant.closed_loop([[0.5]])


def test_controller_must_fit():
    plant = random_plant(np.random.default_rng(6))
    with pytest.raises(InvalidInputError, match=r"shape \(3, 2\)"):
        plant.closed_loop(np.zeros((2, 3)))
    with pytest.raises(InvalidInputError, match="sampling time"):
        plant.closed_loop(control.ss(0.5, np.ones((1, 2)), np.ones((3, 1)), 0, 0.1))
