"""Balls and powers of two: nothing is rounded unseen."""

import flint
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.linear import is_positive_definite
from robustpolish.linear.arithmetic import exact as exponents
from robustpolish.linear.arithmetic.balls import (
    UndecidedError,
    ball,
    identity,
    is_definite,
    is_surely_stable,
    midpoint,
    precision,
    stabilising_solution,
    zeros,
)
from robustpolish.linear.arithmetic.exact import FloatRangeError, rescaled, scaled
from robustpolish.linear.systems import Realisation

# Matrices that carry proven bounds on their rounding errors.


# Powers of two as factors.


def test_factors_whose_product_no_double_holds():
    M = np.array([[3.0, -0.1], [0.0, 1e-300]])
    assert np.array_equal(scaled(M, 2.0**1000, 2.0**1000, 2.0**-1000, 2.0**-1001), M / 2)


@pytest.mark.parametrize(
    ("value", "factor"),
    [(1e300, 2.0**100), (1e-300, 2.0**-100), (3 * 2.0**-1074, 0.5), (1.0, 0.0), (1.0, np.inf)],
)
def test_what_would_be_lost_is_refused(value, factor):
    # Overflow, underflow, a lost bit of a denormal number, and factors that are none.
    with pytest.raises(FloatRangeError):
        scaled(np.array([[value]]), factor)


@pytest.mark.parametrize("value", [1e101, 1e-101, np.inf, np.nan])
def test_extreme_matrices_are_refused(value):
    with pytest.raises(rp.InvalidInputError, match="units"):
        exponents.refuse_extreme("system", {"A": np.array([[value]])})


# State-space matrices in scaled units.


def test_what_would_lose_bits_is_refused():
    A = np.array([[-1e300, 1e-20], [1e-20, -1e300]])  # over 1e300 no double holds 1e-20
    one = np.ones((2, 2))
    with pytest.raises(InvalidInputError, match="double precision can hold"):
        rescaled(Realisation(A, one, one, 0 * one, False))


# Proofs: definite matrices, systems in balls, Riccati equations, linear matrix inequalities.


# Balls, and systems of them.


def test_definiteness_is_proven_far_beyond_doubles():
    """The least eigenvalue of the Hilbert matrix of order 12 is between 1e-16 and 2e-16."""
    with precision(300):
        n, small = 12, flint.arb(10) ** -16
        hilbert = flint.arb_mat([[1 / flint.arb(i + j + 1) for j in range(n)] for i in range(n)])
        assert is_definite(hilbert - identity(n) * small)
        assert not is_definite(hilbert - identity(n) * (2 * small))


def test_an_enclosure_that_holds_an_indefinite_matrix_is_not_proven():
    wide = flint.arb(1, 2)  # between -1 and 3
    assert not is_definite(flint.arb_mat([[wide]]))
    assert not is_definite(ball([[1.0, 2.0], [2.0, 1.0]]))
    assert is_definite(zeros(0, 0))


# Definite matrices, decided by rational numbers.


def test_the_last_bit_decides():
    assert is_positive_definite([[1, 1], [1, 1 + 2.0**-52]])
    assert not is_positive_definite([[1, 1], [1, 1]])
    assert not is_positive_definite([[1, 1], [1, 1 - 2.0**-53]])


def test_random_matrices():
    rng = np.random.default_rng(0)
    for _ in range(50):
        Q = rng.standard_normal((6, 6))
        shift = rng.uniform(-1, 1)
        M = Q @ Q.T + shift * np.eye(6)
        M = (M + M.T) / 2
        assert is_positive_definite(M) == (np.linalg.eigvalsh(M).min() > 0)


def test_any_scale():
    assert is_positive_definite(np.diag([1e-300, 1e300]))
    assert not is_positive_definite(np.diag([1.0, -1e-300]))
    assert is_positive_definite(np.zeros((0, 0)))


def test_bad_input_is_refused():
    with pytest.raises(InvalidInputError, match=r"M: .*symmetric"):
        is_positive_definite([[1, 2], [2.0000001, 5]])


# Riccati equations in long arithmetic.


def solved(A, R, Q, bits=512):
    with precision(bits):
        X = stabilising_solution(ball(A), ball(R), ball(Q))
        return None if X is None else midpoint(X)


def test_eigenvalues_on_the_axis_leave_no_solution():
    assert solved(np.array([[-1.0]]), np.array([[2.0]]), np.array([[1.0]])) is None


def test_a_mode_that_nothing_moves_is_not_called_solved():
    with pytest.raises(UndecidedError), precision(256):
        stabilising_solution(ball([[1.0]]), ball([[0.0]]), ball([[1.0]]))


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
