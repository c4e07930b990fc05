"""Systems as lists of parts that share no signal."""

import control
import numpy as np

from robustpolish.linear.arithmetic.realisation import realisation
from robustpolish.linear.scaling import parts, parts_with_indices, parts_with_states

A = np.array([[-1.0, 0.0, 3.0], [0.0, -2.0, 0.0], [4.0, 0.0, -5.0]])
APART = realisation("s", control.ss(A, np.eye(3)[:, :2], np.eye(3)[[1, 2]], 0))


def test_each_part_has_its_rows_and_columns():
    found = parts_with_indices(APART)
    assert [states for _, states in found] == [(0, 2), (1,)]
    first, second = (part for part, _ in found)
    np.testing.assert_array_equal(first.A, [[-1, 3], [4, -5]])
    np.testing.assert_array_equal(first.B, [[1], [0]])
    np.testing.assert_array_equal(first.C, [[0, 1]])
    np.testing.assert_array_equal((second.A, second.B, second.C), ([[-2]], [[1]], [[1]]))


def test_what_is_joined_is_left_as_it_is():
    whole = realisation("s", control.ss(A, np.ones((3, 1)), np.ones((1, 3)), 0))
    assert parts(whole) == [whole]
    assert [states for _, states in parts_with_states(whole)] == [(0, 2), (1,)]
