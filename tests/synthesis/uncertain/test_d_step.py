import numpy as np
import pytest
import uncertain_plants

from robustpolish.synthesis.problem.matrices import Controller, augmented, close_static_loop
from robustpolish.synthesis.uncertain.dk_iteration import (
    Filter,
    scaled_plant,
    scalings_of,
    unit_scalings,
)
from robustpolish.synthesis.uncertain.scaled_gain import (
    LoopResponses,
    RobustProblem,
    controller_matrix,
    grid,
    mu_bounds,
)


@pytest.fixture
def problem():
    return RobustProblem.of(uncertain_plants.lag(), 1, 1, 1.0)


@pytest.fixture
def K():
    return Controller(*(np.array([[x]]) for x in (-1.0, 0.3, 0.4, -0.5)))


def test_loop_of_the_scaled_plant_is_the_scaled_loop(problem, K):
    filters = [Filter(2.0, np.array([0.5]), np.array([3.0])), unit_scalings(problem)[-1]]
    omega = np.array([0.0, 0.4, 7.0, np.inf])
    loop = close_static_loop(augmented(scaled_plant(problem, filters), 1), controller_matrix(K))
    M = LoopResponses.of(problem.loop(K), omega).M
    d = np.exp(filters[0].sizes(omega))
    nz, nw = problem.structure.shape
    left, right = np.ones((4, nz)), np.ones((4, nw))
    left[:, 0], right[:, 0] = d, d
    expected = np.linalg.norm(left[:, :, None] * M / right[:, None, :], 2, axis=(1, 2))
    scaled = np.linalg.norm(LoopResponses.of(loop, omega).M, 2, axis=(1, 2))
    assert scaled == pytest.approx(expected)


def test_fitted_scalings_raise_the_levels_next_to_nothing(problem, K):
    loop = problem.loop(K)
    omega = grid([loop.poles])
    M = LoopResponses.of(loop, omega).M
    known = mu_bounds(problem.as_complex, omega, M)
    filters = scalings_of(problem, known, M)
    loop = close_static_loop(augmented(scaled_plant(problem, filters), 1), controller_matrix(K))
    norms = np.linalg.norm(LoopResponses.of(loop, omega).M, 2, axis=(1, 2))
    assert norms.max() <= 1.02 * known.peak
    assert len(filters[-1].poles) == 0
