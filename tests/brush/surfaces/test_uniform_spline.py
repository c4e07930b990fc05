import numpy as np

from robustpolish.polishing.surfaces.spline import BEND, coefficients, expansions, pack


def packed_of(f, x, y):
    heights = f(x[:, None], y[None, :])
    return pack(x, y, coefficients(coefficients(heights).T).T)


def test_a_cubic_and_its_derivatives_come_back():
    x, y = np.linspace(-1, 2, 9), np.linspace(0, 1, 6)
    packed = packed_of(lambda x, y: x**3 - 2 * x * y**2 + 3 * y, x, y)
    px, py = np.random.default_rng(0).uniform([[-1], [0]], [[2], [1]], (2, 50))
    wanted = [px**3 - 2 * px * py**2 + 3 * py, 3 * px**2 - 2 * py**2, 3 - 4 * px * py, 6 * px]
    found = expansions(px, py, packed)
    np.testing.assert_allclose(found[:4], wanted, atol=1e-11)
    np.testing.assert_allclose(found[4:], [-4 * py, -4 * px], atol=1e-11)


def test_bends_are_continuous_across_knots_and_bounded():
    x = np.linspace(0, 1, 12)
    packed = packed_of(lambda x, y: np.sin(5 * x) * np.cos(4 * y), x, x)
    knot, y = np.full(5, x[4]), np.linspace(0.1, 0.9, 5)
    before, after = (expansions(knot + step, y, packed)[3:] for step in (-1e-9, 1e-9))
    np.testing.assert_allclose(before, after, atol=1e-5)
    everywhere = np.random.default_rng(0).uniform(0, 1, (2, 2000))
    xx, xy, yy = expansions(*everywhere, packed)[3:]
    sharpest = np.max(np.abs(0.5 * (xx + yy)) + np.hypot(0.5 * (xx - yy), xy))
    assert sharpest <= packed[BEND] < 3 * sharpest


def test_derivatives_are_those_of_the_spline_itself():
    x = np.linspace(0, 1, 10)
    packed = packed_of(lambda x, y: np.exp(x) * np.sin(3 * y), x, x)
    px, py = np.random.default_rng(2).uniform(0.1, 0.9, (2, 40))
    step = 1e-6
    ahead, behind = (expansions(px + s, py, packed) for s in (step, -step))
    here = expansions(px, py, packed)
    np.testing.assert_allclose((ahead[0] - behind[0]) / (2 * step), here[1], atol=1e-8)
    np.testing.assert_allclose((ahead[1] - behind[1]) / (2 * step), here[3], atol=1e-5)
    np.testing.assert_allclose((ahead[2] - behind[2]) / (2 * step), here[4], atol=1e-5)
