import numpy as np
import pytest
import uncertain_plants

from robustpolish.synthesis.problem.matrices import Controller
from robustpolish.synthesis.uncertain.dk_iteration import mu_bound_with, reduced_controllers
from robustpolish.synthesis.uncertain.scaled_gain import (
    LoopResponses,
    RobustProblem,
    grid,
    mu_bounds,
)


def test_shorter_controllers_are_stable_and_come_near():
    problem = RobustProblem.of(uncertain_plants.lag(), 1, 1, 1.0)
    # The second state is fast and weak.
    K = Controller(
        np.diag([-1.0, -300.0]), np.array([[0.3], [0.2]]), np.array([[0.4, 0.1]]), -np.eye(1)
    )
    loop = problem.loop(K)
    omega = grid([loop.poles])
    known = mu_bounds(problem.structure, omega, LoopResponses.of(loop, omega).M)
    assert mu_bound_with(problem, K, known) == pytest.approx(known.peak, rel=1e-9)
    found = list(reduced_controllers(problem, K, 1))
    assert all(len(one.A) == 1 for one in found)
    assert min(mu_bound_with(problem, one, known) for one in found) < 1.01 * known.peak
    assert list(reduced_controllers(problem, K, 5)) == [K]
