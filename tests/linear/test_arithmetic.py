"""Balls and powers of two: nothing is rounded unseen."""

import flint
import numpy as np
import pytest

import robustpolish as rp
from robustpolish.errors import InvalidInputError
from robustpolish.linear.arithmetic import powers_of_two as exponents
from robustpolish.linear.arithmetic.balls import (
    ball,
    identity,
    magnitude,
    precision,
)
from robustpolish.linear.arithmetic.powers_of_two import FloatRangeError, bracket, scaled
from robustpolish.linear.arithmetic.realisation import (
    Realisation,
    rescaled,
)

# Matrices that carry proven bounds on their rounding errors.


def test_the_precision_is_restored_even_by_an_error():
    before = flint.ctx.prec
    with pytest.raises(ZeroDivisionError), precision(999):
        assert flint.ctx.prec == 999
        raise ZeroDivisionError
    assert flint.ctx.prec == before


def test_a_sum_in_balls_holds_the_exact_one():
    """(1 + 2^-80) - 1 is lost in doubles and kept, or covered by the radius, in balls."""
    for bits in (53, 200):
        with precision(bits):
            tiny = ball([[2.0**-80]])
            rest = identity(1) + tiny - identity(1)
            assert rest[0, 0].contains(flint.arb(2) ** -80)
            assert magnitude(rest)[0, 0] >= 2.0**-80


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


def test_bounds_enclose_below_normal_doubles():
    value, lower, upper = bracket(3.0, 2.0, 4.0, 2.0**-1074)
    assert lower == 0.0
    assert upper == np.finfo(float).tiny
    assert 0.0 <= value <= upper
    assert bracket(0.0, 0.0, 0.0, 1.0) == (0.0, 0.0, 0.0)
    assert bracket(np.inf, np.inf, np.inf, 0.5) == (np.inf, np.inf, np.inf)
    with pytest.raises(FloatRangeError):
        bracket(1e300, 1e300, 1e300, 1e10)


@pytest.mark.parametrize("value", [1e101, 1e-101, np.inf, np.nan])
def test_extreme_matrices_are_refused(value):
    with pytest.raises(rp.InvalidInputError, match="units"):
        exponents.refuse_extreme("system", {"A": np.array([[value]])})


def test_small_entries_beside_ordinary_ones_pass():
    # exp(-500) in the transition of a fast pole is no mistake.
    exponents.refuse_extreme("system", {"A": np.diag([0.5, 7e-218]), "B": np.zeros((2, 1))})


# State-space matrices in scaled units.


def test_what_would_lose_bits_is_refused():
    A = np.array([[-1e300, 1e-20], [1e-20, -1e300]])  # over 1e300 no double holds 1e-20
    one = np.ones((2, 2))
    with pytest.raises(InvalidInputError, match="double precision can hold"):
        rescaled(Realisation(A, one, one, 0 * one, False))
