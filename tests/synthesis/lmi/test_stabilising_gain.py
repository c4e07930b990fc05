"""Cone complementarity finds stabilising gains."""

import numpy as np
import pytest
from small_plants import static_plant

from robustpolish.base.budget import Budget
from robustpolish.synthesis.lmi.program import ProgramSolver, stabilising_gain
from robustpolish.synthesis.problem.matrices import close_static_loop

solver = ProgramSolver("cvxpy", None, Budget(), accuracy=1e-7)


@pytest.mark.parametrize("discrete", [False, True])
def test_finds_a_stabilising_gain(discrete):
    rng = np.random.default_rng(5)
    for _ in range(3):
        A = rng.normal(size=(4, 4))
        if discrete:
            A /= 0.8 * np.abs(np.linalg.eigvals(A)).max()
        plant = static_plant(A, rng.normal(size=(4, 2)), rng.normal(size=(3, 4)), discrete)
        K = stabilising_gain(plant, np.ones((2, 3), bool), solver)
        assert close_static_loop(plant, K).stable


def test_respects_a_pattern():
    plant = static_plant(np.diag([0.5, 0.3]), np.eye(2), [[1.0, 0.2], [0.1, 1.0]])
    mask = np.eye(2, dtype=bool)
    K = stabilising_gain(plant, mask, solver)
    assert (K[~mask] == 0).all()
    assert close_static_loop(plant, K).stable
