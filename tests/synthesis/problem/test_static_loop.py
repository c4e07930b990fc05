"""Loops with a constant matrix, as the plant connects them, and gradients on their way back."""

import control
import numpy as np
import pytest
from hard_plants import random_plant
from small_plants import static_plant

from robustpolish.synthesis.problem.matrices import (
    PlantMatrices,
    augmented,
    close_static_loop,
    controller_loop,
)

POINTS = (0.0, 1j, 0.5 - 3j)


def same_response(loop, system):
    assert loop is not None
    for s in POINTS:
        own = control.StateSpace(loop.A, loop.B, loop.C, loop.D)(s)
        np.testing.assert_allclose(own, system(s), rtol=1e-8)


def drawn(*shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


@pytest.mark.parametrize("feedthrough", [False, True])
def test_a_static_loop_is_that_of_the_plant(feedthrough):
    plant, K = random_plant(4, 0, feedthrough=feedthrough), drawn(2, 2)
    same_response(close_static_loop(PlantMatrices.of(plant), K), plant.closed_loop(K))


@pytest.mark.parametrize("feedthrough", [False, True])
@pytest.mark.parametrize("order", [0, 2])
def test_a_static_gain_around_integrators_is_a_dynamic_controller(order, feedthrough):
    plant, K = random_plant(3, 1, feedthrough=feedthrough), drawn(order + 2, order + 2)
    parts = K[:order, :order], K[:order, order:], K[order:, :order], K[order:, order:]
    loop = close_static_loop(augmented(PlantMatrices.of(plant), order), K)
    same_response(loop, plant.closed_loop(control.StateSpace(*parts)))


def test_a_controller_alone_is_measured_between_weights():
    K, left, right = drawn(4, 5), drawn(3, 2, seed=1), drawn(3, 1, seed=2)
    loop = close_static_loop(controller_loop(2, left, right, discrete=True), K)
    assert loop is not None
    assert loop.plant.discrete
    alone = control.StateSpace(K[:2, :2], K[:2, 2:], K[2:, :2], K[2:, 2:], True)
    for z in (1.0, 1j):
        own = control.StateSpace(loop.A, loop.B, loop.C, loop.D, True)(z)
        np.testing.assert_allclose(own, left @ alone(z) @ right, rtol=1e-9)


def test_a_loop_that_is_not_well_posed_is_none():
    plant = PlantMatrices.of(random_plant(3, 0)).replace(D22=np.diag([0.5, 0.0]))
    assert close_static_loop(plant, np.diag([2.0, 1.0])) is None
    assert close_static_loop(plant, np.diag([np.nan, 1.0])) is None
    assert close_static_loop(plant, np.diag([1.0, 1.0])) is not None


def test_stability_is_strict_in_continuous_and_discrete_time():
    for discrete, stable, marginal in ((False, -0.5, 0.0), (True, -0.999, -1.0)):
        for pole, expected in ((stable, True), (marginal, False), (np.inf, False)):
            plant = static_plant(np.diag([pole, 0.1 * stable]), [[1.0], [0]], [[1.0, 0]], discrete)
            loop = close_static_loop(plant, np.zeros((1, 1)))
            assert loop is not None
            assert loop.stable == expected


def test_a_gradient_comes_back_through_the_feedthrough():
    plant, K = PlantMatrices.of(random_plant(3, 2)), 0.3 * drawn(2, 2)
    weight = drawn(2, 2, seed=5)

    def objective(K):
        return float(np.sum(weight * (K @ np.linalg.inv(np.eye(2) - plant.D22 @ K))))

    loop = close_static_loop(plant, K)
    assert loop is not None
    step = 1e-6
    for i, j in np.ndindex(2, 2):
        move = np.zeros((2, 2))
        move[i, j] = step
        slope = (objective(K + move) - objective(K - move)) / (2 * step)
        assert loop.back(weight)[i, j] == pytest.approx(slope, rel=1e-6)
    # Without D22 there is nothing to come back through.
    bare = close_static_loop(plant.without_d22(), K)
    assert bare is not None
    assert bare.back(weight) is weight
