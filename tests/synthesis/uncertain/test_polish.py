import numpy as np
import pytest
import uncertain_plants

from robustpolish.base.budget import Budget
from robustpolish.synthesis.problem.matrices import Controller, augmented
from robustpolish.synthesis.uncertain.scaled_gain import (
    LoopResponses,
    ModalGain,
    RobustProblem,
    Scalings,
    grid,
    mu_bounds,
)
from robustpolish.synthesis.uncertain.search import MuDescent, MuDescentPoint, damping


@pytest.fixture
def start():
    problem = RobustProblem.of(uncertain_plants.lag(), 1, 1, 1.0)
    K = Controller(*(np.array([[x]]) for x in (-1.0, 0.3, 0.4, -0.5)))
    loop = problem.loop(K)
    omega = grid([loop.poles])
    found = mu_bounds(problem.structure, omega, LoopResponses.of(loop, omega).M)
    scalings = Scalings(problem.structure)
    weights = np.array([scalings.of_weights(f.x, found.space, 1.0) for f in found.found])
    form, theta = ModalGain.of(K)
    polish = MuDescent(augmented(problem.matrices, 1), form, scalings, omega)
    return polish, MuDescentPoint(theta, weights, found.peak)


def test_levels_of_the_start_are_those_of_the_analysis(start):
    polish, state = start
    squares = polish.squares(state.theta, state.weights)
    assert np.sqrt(squares.max()) == pytest.approx(state.level, rel=1e-9)


def test_derivatives_are_those_of_differences_with_the_fence_and_without(start):
    polish, state = start
    random, h = np.random.default_rng(0), 1e-6
    x = np.concatenate([state.theta, state.weights.ravel()])
    for each in (polish, MuDescent(polish.plant, polish.gain, polish.scalings, polish.omega, 2.0)):
        fence = each._stability_penalty(each.loop(state.theta))[0]
        assert (fence > 0) == (each.damping == 2.0)
        value, slope = each._value(x, len(state.theta), 20.0, state.level**2)
        step = random.standard_normal(len(x))
        ends = [
            each._value(x + sign * h * step, len(state.theta), 20.0, state.level**2)[0]
            for sign in (1, -1)
        ]
        assert np.isfinite(value)
        assert (ends[0] - ends[1]) / (2 * h) == pytest.approx(slope @ step, rel=1e-4)


def test_descent_lowers_the_level_and_keeps_the_loop_stable(start):
    polish, state = start
    found = polish.lower(state, (30.0, 300.0), Budget(), 100)
    assert found.level < 0.9 * state.level
    assert polish.loop(found.theta).stable


def test_unstable_controllers_have_no_value(start):
    polish, state = start
    x = np.concatenate([100 + state.theta, state.weights.ravel()])
    assert polish.loop(100 + state.theta) is None
    assert np.isinf(polish._value(x, len(state.theta), 20.0, 1.0)[0])
    assert np.isinf(polish.squares(100 + state.theta, state.weights)).all()


def test_damping_that_a_loop_has_is_not_asked_to_double(start):
    polish, state = start
    assert damping(polish.loop(state.theta)) == 0.05
