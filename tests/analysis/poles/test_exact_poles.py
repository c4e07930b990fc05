"""Poles by exact arithmetic."""

import numpy as np
import pytest
from flint import fmpz_poly

from robustpolish.linear.arithmetic.rational import rational
from robustpolish.linear.stability import (
    count_poles,
    eigenvalues,
    poles_by_side,
    positive_roots,
    unreachable_poles,
)

TINY = 2.0**-200


def test_the_side_is_decided_to_the_last_bit():
    found = count_poles(rational(np.diag([TINY, 0.0, -TINY, -1.0])), discrete=False)
    assert found.unstable == (complex(TINY),)
    assert found.marginal == (0j,)


def test_multiple_poles_on_the_axis_are_counted():
    swing = np.array([[0.0, 1.0], [-4.0, 0.0]])
    both = np.kron(np.eye(2), swing)
    found = count_poles(rational(both), discrete=False)
    assert found.unstable == ()
    assert sorted(pole.imag for pole in found.marginal) == pytest.approx([-2, -2, 2, 2])


def test_the_unit_circle():
    A = np.diag([1.0, -1.0, 1.0 + 2.0**-52, 1.0 - 2.0**-53, 0.0])
    sides = sorted(side for _, side in poles_by_side(rational(A), discrete=True))
    assert sides == [-1, -1, 0, 0, 1]


def test_poles_that_no_input_reaches():
    A = np.array([[1.0, 0.0, 0.0], [5.0, -2.0, 0.0], [0.0, 1.0, -3.0]])
    B = np.array([[0.0], [1.0], [0.0]])
    assert unreachable_poles(rational(A), rational(B), False) == [(1 + 0j, False)]
    assert unreachable_poles(rational(A), rational(np.eye(3)), False) == []
    every = unreachable_poles(rational(A), rational(np.zeros((3, 1))), False)
    assert sorted(stable for _, stable in every) == [False, True, True]


def test_eigenvalues_to_double_precision():
    """A companion matrix with roots 1, 2, ..., 12: doubles lose half of the digits."""
    polynomial = np.poly(np.arange(1.0, 13.0))
    companion = np.diag(np.ones(11), -1)
    companion[0] = -polynomial[1:]
    found = sorted(eigenvalues(rational(companion)), key=lambda value: value.real)
    assert found == [complex(k) for k in range(1, 13)]


def test_real_roots_from_zero_on():
    polynomial = fmpz_poly([0, 0, -6, 1, 1])  # x^2 (x - 2) (x + 3)
    assert [(complex(root), times) for root, times in positive_roots(polynomial)] == [
        (0j, 2), (2 + 0j, 1),
    ]  # fmt: skip
    assert positive_roots(fmpz_poly([7])) == []
