import flint
import numpy as np
import pytest

from robustpolish.robust.branch_and_bound import (
    apply_along_axis,
    from_powers,
    from_values,
    halving_matrices,
    nodes,
    square,
)


def value(coefficients, x):
    """Of a polynomial in Bernstein's form at x between 0 and 1, by de Casteljau."""
    b = np.array(coefficients, dtype=float)
    while len(b) > 1:
        b = (1 - x) * b[:-1] + x * b[1:]
    return b[0]


@pytest.mark.parametrize("degree", [1, 2, 5])
def test_from_values(degree):
    powers = np.random.default_rng(degree).standard_normal(degree + 1)
    values = np.array([np.polyval(powers, float(x.p) / float(x.q)) for x in nodes(degree)])
    coefficients = apply_along_axis(
        from_values(degree), np.array([flint.arb(v) for v in values]), 0
    )
    for x in (0.0, 0.3, 1.0):
        assert value([float(c) for c in coefficients], x) == pytest.approx(np.polyval(powers, x))


def test_from_powers():
    row = flint.arb_mat([[1, -2, 0.5, 3]])
    found = [float(c) for c in (row * from_powers(3, 0.5, 2.0)).tolist()[0]]
    for x in (0.5, 1.1, 2.0):
        there = value(found, (x - 0.5) / 1.5)
        assert there == pytest.approx(1 - 2 * x + 0.5 * x**2 + 3 * x**3)


def test_halves():
    coefficients = np.random.default_rng(0).standard_normal((3, 5))
    lower, upper = (apply_along_axis(half, coefficients, 1) for half in halving_matrices(4))
    assert value(lower[1], 0.6) == pytest.approx(value(coefficients[1], 0.3))
    assert value(upper[1], 0.6) == pytest.approx(value(coefficients[1], 0.8))
    assert all((half.sum(axis=1) == 1).all() for half in halving_matrices(4))


@pytest.mark.parametrize("degree", [2, 3])
def test_square(degree):
    found = square(-1.0, 3.0, degree)
    for x in (0.0, 0.2, 1.0):
        assert value(found, x) == pytest.approx((4 * x - 1) ** 2)
