"""Normalised coprime factors."""

import control
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.synthesis.loop_shaping.coprime import (
    cayley,
    cayley_back,
    consistent_matrices,
    coprime,
    in_series,
    loop_plant,
)
from robustpolish.synthesis.problem.matrices import SystemMatrices


def response(system, s):
    A, B, C, D = system
    return C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D


def random_plant(seed, dt=0):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((4, 4))
    shapes = ((4, 2), (3, 4), (3, 2))
    return control.ss(A, *(rng.standard_normal(shape) for shape in shapes), dt)


@pytest.mark.parametrize("seed", range(4))
def test_factors_are_normalised_stable_and_give_the_plant(seed):
    G = random_plant(seed)
    found = coprime(loop_plant("plant", G))
    right, left = found.right(), found.left()
    for factors in (right, left):
        assert (np.linalg.eigvals(factors.A).real < 0).all()
    for s in (0.0, 0.4j, 3j, 50j):
        R, L, g = response(right, s), response(left, s), G(s)
        np.testing.assert_allclose(R.conj().T @ R, np.eye(2), atol=1e-9)
        np.testing.assert_allclose(L @ L.conj().T, np.eye(3), atol=1e-9)
        np.testing.assert_allclose(R[:3], g @ R[3:], atol=1e-9)
        np.testing.assert_allclose(L[:, 3:], -L[:, :3] @ g, atol=1e-9)
        np.testing.assert_allclose(L @ R, 0, atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_the_optimal_gamma_is_that_of_the_four_blocks(seed):
    # An H-infinity problem like any other, whose infimum is found by quite another way.
    plant = rp.GeneralizedPlant.from_loop(random_plant(seed))
    found = rp.output_feedback(plant)
    optimal = coprime(plant).optimal_gamma
    assert found.lower_bound == pytest.approx(optimal, rel=1e-3)
    assert found.certificate.achieved == pytest.approx(optimal, rel=6e-3)


def test_the_image_of_discrete_time_and_back():
    G = consistent_matrices(random_plant(7, 0.1))
    image = SystemMatrices(*cayley(*G))
    for z in (np.exp(0.3j), np.exp(2j)):
        np.testing.assert_allclose(response(image, (z - 1) / (z + 1)), response(G, z))
    for M, again in zip(G, cayley_back(image), strict=True):
        np.testing.assert_allclose(again, M, atol=1e-12)


def test_systems_in_series():
    one, two = random_plant(1), control.ss(random_plant(2).A, np.ones((4, 3)), np.ones((1, 4)), 0)
    both = in_series(consistent_matrices(one), consistent_matrices(two))
    np.testing.assert_allclose(response(both, 2j), np.atleast_2d(two(2j)) @ one(2j))


def test_the_part_of_a_plant_that_is_meant():
    plant = rp.GeneralizedPlant.from_loop(random_plant(0))
    assert loop_plant("plant", plant) is plant
    assert loop_plant("plant", random_plant(0)).nw == 0
    with pytest.raises(rp.InvalidInputError, match="plant: got 0 controls"):
        loop_plant("plant", rp.GeneralizedPlant(random_plant(0), 1, 0))
