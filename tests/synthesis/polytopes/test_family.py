"""Lyapunov matrices at vertices, and their derivatives."""

import numpy as np

from robustpolish.synthesis.scheduled.polytope import LyapunovFamily, weighted_sum


def test_one_for_all_and_one_for_each():
    assert LyapunovFamily.common(3).is_common
    family = LyapunovFamily.per_vertex(3)
    P = [np.eye(2) * k for k in (1, 2, 3)]
    assert [weighted_sum(row, P)[0, 0] for row in family.shares] == [1, 2, 3]
    assert not family.drifts.any()


def test_affine_matrices_follow_the_slow_numbers_only():
    corners = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])
    family = LyapunovFamily.affine(corners, [0.5, np.inf])
    assert family.shares.tolist() == [[1, -1], [1, -1], [1, 1], [1, 1]]
    assert sorted(family.drifts.tolist()) == [[0, -0.5], [0, 0.5]]
    # A number at rest has one rate, and one that may jump leaves a common matrix.
    assert LyapunovFamily.affine(corners, [0.0, np.inf]).drifts.tolist() == [[0, 0]]
    assert LyapunovFamily.affine(corners, [np.inf, np.inf]).is_common
