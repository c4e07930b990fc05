"""Steps of D-K iteration and of the descent: against analysis and output feedback."""

import numpy as np
import pytest
import uncertain_plants

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.synthesis.problem.matrices import (
    Controller,
    augmented,
    close_static_loop,
    controller_matrix,
)
from robustpolish.synthesis.uncertain.scaled_gain import (
    LoopResponses,
    ModalGain,
    MuBounds,
    RobustProblem,
    Scalings,
    grid,
)
from robustpolish.synthesis.uncertain.search import (
    ONE,
    MuDescent,
    k_step,
    scaled_plant,
    scalings_of,
)


@pytest.mark.parametrize(("name", "signals"), [("lag", 1), ("two_masses", 1), ("column", 2)])
def test_the_k_step_is_near_the_infimum_of_output_feedback(name, signals):
    problem = RobustProblem.of(getattr(uncertain_plants, name)(), signals, signals, 1.0)
    plant = scaled_plant(problem, [ONE] * len(problem.as_complex.blocks))
    K = k_step(plant, 1.0, Budget())
    loop = close_static_loop(augmented(plant, len(K.A)), controller_matrix(K))
    assert loop.stable
    omega = np.array([0.0, *np.geomspace(1e-6, 1e6, 600), np.inf])
    norm = np.linalg.norm(LoopResponses.of(loop, omega).M, 2, axis=(1, 2)).max()
    design = rp.output_feedback(problem.plant)
    assert norm <= design.lower_bound * 1.03


@pytest.fixture
def problem():
    return RobustProblem.of(uncertain_plants.lag(), 1, 1, 1.0)


@pytest.fixture
def K():
    return Controller(*(np.array([[x]]) for x in (-1.0, 0.3, 0.4, -0.5)))


def test_fitted_scalings_raise_the_levels_next_to_nothing(problem, K):
    loop = problem.loop(K)
    omega = grid([loop.poles])
    M = LoopResponses.of(loop, omega).M
    known = MuBounds.over(problem.as_complex, omega, M)
    filters = scalings_of(problem, known, M)
    loop = close_static_loop(augmented(scaled_plant(problem, filters), 1), controller_matrix(K))
    norms = np.linalg.norm(LoopResponses.of(loop, omega).M, 2, axis=(1, 2))
    assert norms.max() <= 1.02 * known.peak
    assert len(filters[-1].poles) == 0


@pytest.fixture
def start(problem, K):
    loop = problem.loop(K)
    omega = grid([loop.poles])
    found = MuBounds.over(problem.structure, omega, LoopResponses.of(loop, omega).M)
    scalings = Scalings(problem.structure)
    form, theta = ModalGain.of(K)
    descent = MuDescent(augmented(problem.matrices, 1), form, scalings, omega)
    return descent, (theta, scalings.of_bounds(found.found), found.peak)


def test_descent_lowers_the_level_and_keeps_the_loop_stable(start):
    descent, (theta, weights, level) = start
    theta, _, lowered = descent.lower((theta, weights, level), (30.0, 300.0), Budget(), 100)
    assert lowered < 0.9 * level
    assert descent.loop(theta).stable
