import numpy as np
import pytest

from robustpolish.linear.arithmetic.balls import BallSystem, complex_ball, precision
from robustpolish.linear.arithmetic.realisation import Realisation
from robustpolish.robust.loop_model import read_structure
from robustpolish.robust.scalings import (
    BallScalings,
    Inequality,
    Space,
    proven_interval,
    proves_inequality,
)

LAG = BallSystem.of(
    Realisation(np.array([[-1.0]]), np.array([[1.0]]), np.array([[2.0]]), np.zeros((1, 1)), False)
)
SPACE = Space(read_structure(["complex"]), (False,))


def weights(level):
    return BallScalings.of(SPACE, np.array([0.5]), level)


@pytest.mark.parametrize("level", [1.0, 1.9])
def test_interval_ends_where_the_gain_is_the_level(level):
    low, high = proven_interval(LAG, weights(level), 10.0)
    edge = np.sqrt(4 / level**2 - 1)
    assert edge <= low == pytest.approx(edge, rel=1e-9)
    assert high == np.inf
    assert proven_interval(LAG, weights(level), 0.9 * edge) is None


def test_level_above_the_peak_covers_everything():
    assert proven_interval(LAG, weights(2.001), 1.0) == (0.0, np.inf)


def test_negative_scalings_prove_nothing():
    assert BallScalings.of(SPACE, np.array([-0.5]), 3.0) is None


def test_matrix():
    with precision(160):
        assert proves_inequality(complex_ball(np.array([[0.99j]])), weights(1.0))
        assert not proves_inequality(complex_ball(np.array([[1.01]])), weights(1.0))


def test_real_block_with_g():
    space = Space(read_structure(["real"]), (False,))
    M = np.array([[3j]])
    x = np.array([0.5, 2.0])
    for sign in (1.0, -1.0):
        trial = x * [1, sign]
        proven = Inequality(space, M[None]).least_square(trial) < 1
        with precision(160):
            assert proves_inequality(complex_ball(M), BallScalings.of(space, trial, 1.0)) == proven
