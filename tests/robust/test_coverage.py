"""Levels that are proven over intervals of frequency."""

import numpy as np
import pytest

from robustpolish.linear.arithmetic.balls import precision
from robustpolish.linear.arithmetic.realisation import Realisation
from robustpolish.robust.coverage import (
    POLICY,
    BallScalings,
    ProvenModel,
    complex_ball,
    cover,
    is_definite,
    proves_inequality,
    response,
)
from robustpolish.robust.loop_model import LoopModel, read_structure
from robustpolish.robust.scalings import Inequality, Space
from tests.robust.loops import covers, servo

LAG = Realisation(np.array([[-1.0]]), np.array([[1.0]]), np.array([[2.0]]), np.zeros((1, 1)), False)
SPACE = Space(read_structure(["complex"]), (False,))


def weights(level):
    return BallScalings.of(SPACE, np.array([0.5]), level)


def test_definite():
    with precision(100):
        assert is_definite(complex_ball(np.array([[2, 1j], [-1j, 1]])))
        assert not is_definite(complex_ball(np.array([[1, 2j], [-2j, 1]])))


@pytest.mark.parametrize("level", [1.0, 1.9])
def test_interval_ends_where_the_gain_is_the_level(level):
    low, high = ProvenModel.of(LAG).interval(weights(level), 10.0)
    edge = np.sqrt(4 / level**2 - 1)
    assert edge <= low == pytest.approx(edge, rel=1e-9)
    assert high == np.inf
    assert ProvenModel.of(LAG).interval(weights(level), 0.9 * edge) is None


def test_level_above_the_peak_covers_everything():
    assert ProvenModel.of(LAG).interval(weights(2.001), 1.0) == (0.0, np.inf)


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


def test_level_is_that_of_the_worst_frequency():
    loop = LoopModel.of(servo())
    found = cover(loop, Space(loop.structure, (False, False)), 0.0, loop.seeds())
    assert found.complete
    assert covers(found.intervals)
    worst = found.peaks[0][1]
    assert worst <= found.level <= worst * (1 + 2 * POLICY.slack)


def test_response():
    model = LoopModel.of(servo()).model
    np.testing.assert_allclose(response(model, np.inf), model.D)
    at = model.D + model.C @ np.linalg.solve(2j * np.eye(model.states) - model.A, model.B)
    assert response(model, 2.0) == pytest.approx(at)
