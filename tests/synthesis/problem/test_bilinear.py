"""A sampled plant and its continuous image have the same responses, with any controller."""

import control
import numpy as np
import pytest
from hard_plants import random_plant

from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.synthesis.problem.matrices import Controller, to_continuous, to_discrete


def sampled(seed, eigenvalues=None):
    plant = random_plant(4, seed)
    A = plant.A / np.abs(np.linalg.eigvals(plant.A)).max() * 1.1
    if eigenvalues is not None:
        A = np.linalg.solve(plant.A, np.diag(eigenvalues) @ plant.A)
    names = ("B1", "B2", "C1", "C2", "D11", "D12", "D21", "D22")
    matrices = (getattr(plant, name) for name in names)
    return GeneralizedPlant.from_matrices(A, *matrices, dt=0.1)


def drawn_controller():
    rng = np.random.default_rng(3)
    return Controller(*(rng.standard_normal((2, 2)) for _ in range(4)))


def images(plant):
    gain = np.ones((plant.nu, plant.ny))
    return to_continuous(plant, np.ones(plant.nx), gain)


@pytest.mark.parametrize("eigenvalues", [None, (-1.0, 0.5, 0.2, -0.3), (-1.0, -1.0, 0.9, 2.0)])
def test_loops_with_both_respond_alike(eigenvalues):
    plant, K = sampled(1, eigenvalues), drawn_controller()
    image, feedback = images(plant)
    assert not image.is_discrete
    assert feedback.any() == (eigenvalues is not None)  # only a pole at -1 has to be moved
    discrete = to_discrete(K, feedback, plant.D22)
    assert discrete is not None
    own = plant.closed_loop(control.StateSpace(*discrete, plant.dt))
    loop = image.closed_loop(control.StateSpace(*K))
    for angle in (0.3, 1.0, 2.5):
        z = np.exp(1j * angle)
        np.testing.assert_allclose(own(z), loop((z - 1) / (z + 1)), rtol=1e-6)


def test_a_controller_with_a_pole_at_one_has_no_sampled_one():
    K = drawn_controller()
    pole = K._replace(A=np.diag([1.0, -3.0]))
    assert to_discrete(pole, np.zeros((2, 2)), np.zeros((2, 2))) is None


def test_a_static_controller_only_gets_the_feedback_added():
    nothing = np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0))
    feedback = np.diag([0.1, -0.2])
    found = to_discrete(Controller(*nothing, np.eye(2)), feedback, np.zeros((2, 2)))
    assert found is not None
    np.testing.assert_array_equal(found.D, np.eye(2) + feedback)
    assert found.A.shape == (0, 0)
