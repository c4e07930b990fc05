import numpy as np
import pytest

from robustpolish.robust.loop_model import read_structure
from robustpolish.robust.scalings import (
    CENTRING_OPTIONS,
    Inequality,
    Space,
    centre,
    initial_scalings,
    normalised,
    reduce_level,
)

slycot = pytest.importorskip("slycot")


def inequality(M, blocks, fixed=None):
    structure = read_structure(blocks)
    return Inequality(Space(structure, fixed or (False,) * len(structure.blocks)), M[None])


@pytest.mark.parametrize("seed", range(4))
def test_least_level_agrees_with_slicot(seed):
    random = np.random.default_rng(seed)
    M = random.standard_normal((5, 5)) + 1j * random.standard_normal((5, 5))
    one = inequality(M, ["real", "complex", "real", ("full", 2)])
    level = reduce_level(one, initial_scalings(one))
    bound = slycot.ab13md(M, np.array([1, 1, 1, 2]), np.array([1, 2, 1, 2]))[0]
    assert np.sqrt(level.square) == pytest.approx(bound, rel=2e-4)


def test_badly_scaled_matrix():
    M = np.array([[0.3, 1e6], [1e-8, 0.2j]])
    one = inequality(M, ["complex", "complex"])
    assert np.sqrt(reduce_level(one, initial_scalings(one)).square) < 0.5


def test_centre_has_no_slope():
    random = np.random.default_rng(1)
    one = inequality(random.standard_normal((3, 3)) + 0j, ["real", "complex", "complex"])
    start = initial_scalings(one)
    x = centre(one, 2 * start.square, start.x)
    assert one.least_square(x) < 2 * start.square
    again = centre(one, 2 * start.square, x)
    assert one.least_square(again) == pytest.approx(
        one.least_square(x), rel=CENTRING_OPTIONS.centred
    )


def test_fixed_blocks():
    # the gain of M22 + M21 d M12 / (1 - M11 d) is largest at |d| = 1
    M = np.array([[0.5, 1.0], [1.0, 0.2]], complex)
    one = inequality(M, ["complex", "complex"], (True, False))
    assert np.sqrt(reduce_level(one, initial_scalings(one)).square) == pytest.approx(
        0.2 + 1 / 0.5, rel=1e-4
    )
    large = inequality(np.array([[1.5, 1], [1, 1]], complex), ["complex", "complex"], (True, False))
    assert initial_scalings(large).square == np.inf


def test_normalised():
    space = Space(read_structure([("complex", 2)]), (False,))
    assert normalised(space, np.array([4.0, 2.0, 0, 0])) == pytest.approx([0.5, 0.25, 0, 0])
    assert normalised(space, np.array([-1.0, 2.0, 0, 0])) is None
