"""Riccati equations in long arithmetic."""

import flint
import numpy as np
import pytest
from scipy import linalg

from robustpolish.linear.arithmetic.balls import ball, midpoint, precision
from robustpolish.linear.proofs.riccati import (
    UndecidedError,
    has_eigenvalue_below,
    is_surely_not_semidefinite,
    is_surely_stable,
    largest,
    stabilising_solution,
)


def solved(A, R, Q, bits=512):
    with precision(bits):
        X = stabilising_solution(ball(A), ball(R), ball(Q))
        return None if X is None else midpoint(X)


@pytest.mark.parametrize("seed", range(4))
def test_the_solution_is_that_of_doubles(seed):
    draw = np.random.default_rng(seed).standard_normal
    A, B, C = draw((5, 5)), draw((5, 2)), draw((3, 5))
    expected = linalg.solve_continuous_are(A, B, C.T @ C, np.eye(2))
    assert solved(A, -B @ B.T, C.T @ C) == pytest.approx(expected, rel=1e-8)


def test_the_equation_holds_to_a_hundred_digits():
    rng = np.random.default_rng(1)
    with precision(768):
        A, B, C = (ball(rng.standard_normal(shape)) for shape in ((6, 6), (6, 1), (1, 6)))
        R, Q = -1 * B * B.transpose(), C.transpose() * C
        X = stabilising_solution(A, R, Q)
        rest = A.transpose() * X + X * A + X * R * X + Q
        assert largest(rest) < largest(Q) * flint.arb("1e-70")


def test_twins_have_equal_eigenvalues():
    A, B, C = np.array([[1.0, 1.0], [0.0, -2.0]]), np.array([[0.0], [1.0]]), np.array([[1.0, 0.5]])
    one = solved(A, -B @ B.T, C.T @ C)
    A, R, Q = (np.kron(np.eye(2), M) for M in (A, -B @ B.T, C.T @ C))
    assert solved(A, R, Q, 768) == pytest.approx(np.kron(np.eye(2), one), rel=1e-12)


def test_eigenvalues_on_the_axis_leave_no_solution():
    assert solved(np.array([[-1.0]]), np.array([[2.0]]), np.array([[1.0]])) is None


def test_nothing_to_be_paid_costs_nothing():
    A = np.array([[-1.0, 3.0], [0.0, -2.0]])
    assert solved(A, -np.eye(2), np.zeros((2, 2))) == pytest.approx(np.zeros((2, 2)))
    assert solved(np.zeros((0, 0)), np.zeros((0, 0)), np.zeros((0, 0))).shape == (0, 0)


def test_a_mode_that_nothing_moves_is_not_called_solved():
    with pytest.raises(UndecidedError), precision(256):
        stabilising_solution(ball([[1.0]]), ball([[0.0]]), ball([[1.0]]))


def test_signs_of_eigenvalues():
    with precision(300):
        M = ball(np.diag([3.0, 1.0, -1e-40]))
        assert has_eigenvalue_below(M, 0)
        assert has_eigenvalue_below(M, flint.arb("2"))
        assert not has_eigenvalue_below(M, flint.arb("-1e-39"))
        # Beside 3, that is rounding for a solution, and -1e-10 is not.
        assert not is_surely_not_semidefinite(M)
        assert is_surely_not_semidefinite(ball(np.diag([3.0, -1e-10])))


@pytest.mark.parametrize("states", range(1, 8))
def test_stability_is_that_of_the_eigenvalues(states):
    rng = np.random.default_rng(states)
    for _ in range(20):
        A = rng.standard_normal((states, states)) - rng.uniform(0, 3) * np.eye(states)
        with precision(300):
            assert is_surely_stable(ball(A)) == (np.linalg.eigvals(A).real.max() < 0)


def test_eigenvalues_are_on_the_axis_only_where_that_is_proven():
    """A simple pair is proven by a change of sign; of two equal ones there is none."""
    one, none = ball(np.eye(1)), ball(np.zeros((1, 1)))
    with precision(768):
        assert stabilising_solution(none, one, one) is None
        with pytest.raises(UndecidedError):
            stabilising_solution(ball(np.zeros((2, 2))), ball(np.eye(2)), ball(np.eye(2)))
