"""Factors that round nothing, and refusals where doubles end."""

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.linear.arithmetic import powers_of_two as exponents
from robustpolish.linear.arithmetic.powers_of_two import FloatRangeError, bracket, scaled


def test_factors_whose_product_no_double_holds():
    M = np.array([[3.0, -0.1], [0.0, 1e-300]])
    assert np.array_equal(scaled(M, 2.0**1000, 2.0**1000, 2.0**-1000, 2.0**-1001), M / 2)


def test_factors_of_rows_and_columns():
    rows, columns = np.array([[2.0], [4.0]]), np.array([0.5, 8.0])
    assert np.array_equal(scaled(np.ones((2, 2)), rows, columns), rows * columns)
    assert scaled(np.zeros((2, 0)), rows).shape == (2, 0)


@pytest.mark.parametrize(
    ("value", "factor"),
    [(1e300, 2.0**100), (1e-300, 2.0**-100), (3 * 2.0**-1074, 0.5), (1.0, 0.0), (1.0, np.inf)],
)
def test_what_would_be_lost_is_refused(value, factor):
    # Overflow, underflow, a lost bit of a denormal number, and factors that are none.
    with pytest.raises(FloatRangeError):
        scaled(np.array([[value]]), factor)


def test_denormal_numbers_come_up_exactly():
    assert scaled(np.array([5e-324]), 2.0**1000, 2.0**74) == [1.0]


def test_bounds_enclose_below_normal_doubles():
    value, lower, upper = bracket(3.0, 2.0, 4.0, 2.0**-1074)
    assert lower == 0.0
    assert upper == np.finfo(float).tiny
    assert 0.0 <= value <= upper
    assert bracket(0.0, 0.0, 0.0, 1.0) == (0.0, 0.0, 0.0)
    assert bracket(np.inf, np.inf, np.inf, 0.5) == (np.inf, np.inf, np.inf)
    with pytest.raises(FloatRangeError):
        bracket(1e300, 1e300, 1e300, 1e10)


def test_errors_name_the_entries():
    matrices = {"A": np.array([[1.0, 0.0]]), "B": np.array([[1e-120], [1e200]])}
    with (
        pytest.raises(rp.InvalidInputError, match=r"plant: got entries from 1e-120 \(B\[0, 0\]\)"),
        exponents.range_errors_as_input_errors("plant", matrices),
    ):
        raise FloatRangeError


@pytest.mark.parametrize("value", [1e101, 1e-101, np.inf, np.nan])
def test_extreme_matrices_are_refused(value):
    with pytest.raises(rp.InvalidInputError, match="units"):
        exponents.refuse_extreme("system", {"A": np.array([[value]])})


def test_small_entries_beside_ordinary_ones_pass():
    # exp(-500) in the transition of a fast pole is no mistake.
    exponents.refuse_extreme("system", {"A": np.diag([0.5, 7e-218]), "B": np.zeros((2, 1))})
