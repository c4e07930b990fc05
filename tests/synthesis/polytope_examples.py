"""Small polytopes of which something is known."""

import numpy as np

from robustpolish.base.budget import Budget
from robustpolish.linear.arithmetic import balls
from robustpolish.linear.arithmetic.balls import BallSystem
from robustpolish.synthesis.lmi.program import ProgramSolver
from tests.synthesis.small_plants import priced


def solver():
    return ProgramSolver("cvxpy", None, Budget(1e6, 120.0), 1e-9)


def oscillator(stiffness, damping=0.5):
    """A mass on a spring, pushed, seen."""
    matrices = ([[0, 1], [-stiffness, -damping]], [[0], [1.0]], [[1.0, 0]], [[0.0]])
    return BallSystem(*(balls.ball(np.array(M, float)) for M in matrices))


def sampled(gain):
    matrices = ([[0.5, gain], [-gain, 0.3]], [[0], [1.0]], [[1.0, 0]], [[0.2]])
    return BallSystem(*(balls.ball(np.array(M, float)) for M in matrices))


def held_mass(stiffness, mass=1.0, price=0.3):
    """A mass on a spring with a force as disturbance and one as control, which has a price."""
    A, push = [[0, 1], [-stiffness / mass, -0.1 / mass]], [[0], [1 / mass]]
    return priced(A, push, push, [[1, 0]], [[1, 0]], price)


def two_masses(stiffness):
    """Two masses joined by a spring; the first is pushed by u, the second by w, and seen."""
    k, seen = stiffness, np.eye(4)[[1]]
    A = [[0, 0, 1, 0], [0, 0, 0, 1], [-k, k, -0.01, 0], [k, -k, 0, -0.01]]
    return priced(A, np.eye(4)[:, [3]], np.eye(4)[:, [2]], seen, seen)
