"""How far each mode is from being unreachable."""

import numpy as np
import pytest

from robustpolish.linear.arithmetic.realisation import Realisation
from robustpolish.linear.controllability import deficiencies


def modes_of(A, B, tolerance=None, discrete=False):
    A, B = np.array(A, dtype=float), np.array(B, dtype=float)
    model = Realisation(A, B, np.zeros((0, len(A))), np.zeros((0, B.shape[1])), discrete)
    return sorted(deficiencies(model, tolerance), key=lambda mode: mode.eigenvalue.real)


def test_the_exact_answer_does_not_depend_on_the_tolerance():
    modes = modes_of([[1, 0], [1, -2]], [[0], [1]], tolerance=0.0)
    assert [mode.deficient for mode in modes] == [False, True]
    unreachable = modes[1]
    assert (unreachable.eigenvalue, unreachable.distance, unreachable.stable) == (1, 0.0, False)


def test_states_are_those_of_the_whole_system():
    modes = modes_of(np.diag([-1.0, -5.0, -3.0]), [[1], [0], [1]])
    assert [(mode.eigenvalue.real, mode.state) for mode in modes] == [(-5, 1), (-3, 2), (-1, 0)]
    assert [mode.deficient for mode in modes] == [True, False, False]


def test_almost_equal_modes_under_one_input_are_almost_unreachable():
    near = modes_of([[-1, 0], [0, -1.001]], [[1], [1]])
    far = modes_of([[-1, 0], [0, -2]], [[1], [1]])
    assert 0 < near[0].distance < 0.01 * far[0].distance
    assert not near[0].deficient


def test_a_pair_is_told_once_and_stability_by_the_side():
    modes = modes_of([[0, 1], [-4, 0]], [[0], [1]])
    assert len(modes) == 1
    assert modes[0].eigenvalue == pytest.approx(2j)
    assert not modes[0].stable
    assert modes_of([[0.5]], [[1]], discrete=True)[0].stable
    assert not modes_of([[-1.0]], [[1]], discrete=True)[0].stable
