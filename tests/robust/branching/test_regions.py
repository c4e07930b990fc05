import numpy as np
import pytest

from robustpolish.robust.branch_and_bound import ParameterNorm, Region, bound, least_linear_axis

ALONE = ParameterNorm((0,), ())


def line(*values, low=-1.0, high=1.0):
    """P over one number and no frequency, without N."""
    rows = np.array([values], complex)[..., None]
    ends = np.array([low]), np.array([high])
    return Region(rows, np.array([1e-15]), (0, 0), *ends, (1.0, 2.0), False)


def test_gauge():
    parameter_norm = ParameterNorm((0,), ((1, 2),))
    assert parameter_norm.size(np.array([-2.0, 3.0, 4.0])) == 5
    low, high = np.array([-1.0, 3.0, -5.0]), np.array([1.0, 6.0, -4.0])
    assert parameter_norm.least(low, high) == pytest.approx(5)


def test_zero_within_the_hull():
    assert bound(line(1 + 1j, 2 - 1j), ALONE, 1.0, 1.0).size == np.inf
    assert bound(line(1 + 1j, -1 - 1j), ALONE, 1.0, 1.0).size == 0
    assert bound(line(1e-16 + 1e-16j, 1j), ALONE, 1.0, 1.0).size == 0  # below its errors


def test_ball_ends_within_the_box():
    # P = 0 at 0.8 of two numbers each, which is outside of the unit ball, but within the box
    grid = np.array([-1.0, 0.0, 1.0])
    P = (1.6 - grid[:, None] - grid[None, :])[None, ..., None] + 0j
    ends = -np.ones(2), np.ones(2)
    region = Region(P, np.array([1e-15]), (0, 0), *ends, (0.0, 1.0), False)
    assert bound(region, ParameterNorm((0, 1), ()), 1.0, 1.0).size == 0
    assert bound(region, ParameterNorm((), ((0, 1),)), 1.0, 1.0).size == np.inf
    assert bound(region, ParameterNorm((), ((0, 1),)), 1.2, 1.0).size == 0
    assert region.frequency == 0


def test_size_of_the_other_block():
    # |P| = 2 at least and |N| = 1 at most, but nowhere together: P / N is 3 at least
    rows = np.array([[2.0, 6.0], [0.5, 1.0]], complex)[..., None]
    ends = np.array([-1.0]), np.array([1.0])
    region = Region(rows, np.full(2, 1e-15), (1, 1), *ends, (1.0, 2.0), True)
    assert bound(region, ALONE, 1.0, 1.0).size == pytest.approx(4)
    assert region.frequency == pytest.approx(2 / 3)


def test_norm_of_a_matrix():
    rows = np.array([[4.0], [1.0], [2.0], [3.0], [4.0]], complex)[..., None]
    ends = np.array([-1.0]), np.array([1.0])
    region = Region(rows, np.full(5, 1e-15), (2, 2), *ends, (1.0, 2.0), False)
    assert region.norms.item() == pytest.approx(np.linalg.norm([[1, 2], [3, 4]], 2))


def test_halves_are_what_they_were():
    region = line(1.0, -2.0, 4.0)
    below, over = region.halved(0)
    assert (below.low[0], below.high[0], over.low[0]) == (-1, 0, 0)
    assert below.rows[0, -1, 0] == over.rows[0, 0, 0] == pytest.approx((1 - 4 + 4) / 4)
    assert below.errors[0] > region.errors[0]
    first, second = region.halved(1)
    assert (first.band, second.band) == ((1.0, 1.5), (1.5, 2.0))


def test_bent():
    x, y = np.meshgrid(np.linspace(0, 1, 3), np.linspace(0, 1, 3), indexing="ij")
    assert least_linear_axis((5 * x + y**2,)) == 1
    assert least_linear_axis((x**2 + 5 * y,)) == 0
