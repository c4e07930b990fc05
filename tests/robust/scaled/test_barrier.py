import numpy as np
import pytest

from robustpolish.robust.loop_model import read_structure
from robustpolish.robust.scalings import Barrier, Inequality, Space, centre, initial_scalings


def test_slope_and_curvature_are_those_of_the_value():
    random = np.random.default_rng(2)
    M = random.standard_normal((6, 6)) + 1j * random.standard_normal((6, 6))
    structure = read_structure([("real", 2), "real", ("complex", 2), "complex"])
    one = Inequality(Space(structure, (False,) * 4), M[None])
    start = initial_scalings(one)
    barrier = Barrier.of(one.coefficients(2 * start.square), one.space.boxes(1e3 * one.size))
    x = centre(one, 2 * start.square, start.x)
    slope, curvature = barrier.derivatives(x)
    step = random.standard_normal(len(x))
    step *= 1e-3 / np.sqrt(step @ curvature @ step)
    ahead, behind = barrier.value(x + step), barrier.value(x - step)
    assert (ahead - behind) / 2 == pytest.approx(slope @ step, rel=1e-4, abs=1e-9)
    bend = ahead - 2 * barrier.value(x) + behind
    assert bend == pytest.approx(step @ curvature @ step, rel=1e-3)


def test_infinite_where_a_determinant_is_not_positive():
    one = Inequality(Space(read_structure(["real"]), (False,)), np.ones((1, 1, 1), complex))
    barrier = Barrier.of(one.coefficients(4.0), one.space.boxes(10.0))
    assert np.isfinite(barrier.value(np.array([0.5, 0.0])))
    assert barrier.value(np.array([2.0, 0.0])) == np.inf
