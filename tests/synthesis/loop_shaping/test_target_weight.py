"""The weight that a target asks for gives the plant that gain, whatever the plant is like."""

import control
import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.synthesis.loop_shaping.coprime import consistent_matrices, in_series
from robustpolish.synthesis.loop_shaping.loop_shaping import (
    TargetLoop,
    limits_in_words,
    target_weight,
)
from robustpolish.synthesis.problem.matrices import SystemMatrices

s = control.tf("s")
A = np.random.default_rng(0).standard_normal((5, 5))
WIDE = np.random.default_rng(1).standard_normal((5, 3))


def pieces(G, crossover=10.0, dt=0):
    G = control.ss(G)
    one = control.ss(crossover / s)
    if dt:
        G, one = control.c2d(G, dt), control.c2d(one, dt)
    count = min(G.ninputs, G.noutputs)
    shape = SystemMatrices(*(np.kron(np.eye(count), M) for M in consistent_matrices(one)))
    return consistent_matrices(G), TargetLoop.checked(shape, dt, None)


@pytest.mark.parametrize("dt", [0, 0.01])
@pytest.mark.parametrize(
    "plant",
    [
        1 / (s + 1) ** 2,
        1 / s**2,
        1 / (s - 1),
        (3 - s) / (s + 1) ** 2,
        control.ss([[0, 1], [-400, -0.02]], [[0], [1]], [[1, 0]], 0),
        control.ss(A, WIDE[:, :2], WIDE.T[:2], 0),
        control.ss(A, WIDE, WIDE.T[:2], 0),
        control.ss(A, WIDE[:, :2], WIDE.T, 0),
    ],
)
def test_the_shaped_plant_has_the_gain_of_the_target_within_a_percent(plant, dt):
    G, wanted = pieces(plant, dt=dt)
    W = target_weight(G, wanted)
    assert wanted.distance_of(in_series(W, G))[0] < 1.01
    # The weight has no unstable poles; those on the boundary are the target's.
    poles = np.linalg.eigvals(W.A)
    assert (np.abs(poles) < 1 + 1e-9 if dt else poles.real < 1e-9).all()


def test_a_matrix_target_gives_each_singular_value_its_own_gain():
    G = consistent_matrices(control.ss(-np.eye(2), np.eye(2), [[1, 2], [3, 1]], 0))
    shape = consistent_matrices(control.ss(np.zeros((2, 2)), np.diag([1.0, 10.0]), np.eye(2), 0))
    wanted = TargetLoop.checked(shape, 0, None)
    assert wanted.distance_of(in_series(target_weight(G, wanted), G))[0] < 1.01


def test_what_a_plant_does_not_permit_is_said():
    said = limits_in_words(*pieces((3 - s) / (s + 1) ** 2))
    assert "zero in the right half plane at 3 rad/s" in said
    assert "the target has 10 rad/s" in said
    assert limits_in_words(*pieces((3 - s) / (s + 1) ** 2, 1.0)) == ""
    assert "unstable pole at 8 rad/s" in limits_in_words(*pieces(1 / (s - 8)))
    assert limits_in_words(*pieces(1 / (s - 2))) == ""
    discrete = limits_in_words(*pieces(1 / (s - 8), dt=0.01))
    assert "unstable pole at 8 rad/s" in discrete


def test_a_plant_without_gain_is_refused():
    G, wanted = pieces(control.ss(-1, 1, 0, 0))
    with pytest.raises(InvalidInputError, match="plant without gain in the band"):
        target_weight(G, wanted)
