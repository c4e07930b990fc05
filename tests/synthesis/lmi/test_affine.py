"""Expressions in the variables follow the arithmetic of their values."""

import numpy as np
import pytest

from robustpolish.synthesis.lmi.program import Affine, SemidefiniteProgram, symmetric_block

RNG = np.random.default_rng(0)


def test_affine_arithmetic_follows_numpy():
    program = SemidefiniteProgram()
    Y, M = program.symmetric(3), program.matrix(2, 3)
    x = RNG.normal(size=6 + 6)
    y, m = Y.at(x), M.at(x)
    np.testing.assert_allclose(y, y.T)
    A, B = RNG.normal(size=(3, 3)), RNG.normal(size=(3, 2))
    expression = A @ Y + B @ M - 2 * Y.T @ A / 4 + A
    np.testing.assert_allclose(expression.at(x), A @ y + B @ m - 2 * y @ A / 4 + A)
    np.testing.assert_allclose((1.0 * A - Y).at(x), A - y)
    np.testing.assert_allclose(M.T.at(x), m.T)
    np.testing.assert_allclose(Y.trace.at(x), [[np.trace(y)]])
    assert np.shares_memory(Affine.of(Y).constant, Y.constant)


def test_symmetric_block():
    program = SemidefiniteProgram()
    t, M = program.scalar(), program.matrix(2, 1)
    x = RNG.normal(size=3)
    block = symmetric_block([[t.times(np.eye(2)), M], [np.eye(1)]]).at(x)
    expected = np.block([[x[0] * np.eye(2), M.at(x)], [M.at(x).T, np.eye(1)]])
    np.testing.assert_allclose(block, expected)


def test_blocks_left_out_are_zero_but_none_on_the_diagonal():
    whole = symmetric_block([[np.eye(1), None, [[2.0, 3.0]]], [[[4.0]], None], [np.eye(2)]])
    upper = [[1, 0, 2, 3], [0, 4, 0, 0], [2, 0, 1, 0], [3, 0, 0, 1]]
    np.testing.assert_array_equal(whole.at(np.zeros(0)), upper)
    with pytest.raises(ValueError, match="a diagonal block is missing"):
        symmetric_block([[None, np.eye(1)], [np.eye(1)]])


def test_variables_declared_later_do_not_matter():
    program = SemidefiniteProgram()
    early = program.matrix(1, 2)
    late = program.matrix(2, 1)
    x = np.array([1.0, 2.0, 3.0, 4.0])
    np.testing.assert_array_equal(early.at(x), [[1.0, 2.0]])
    np.testing.assert_array_equal((early + late.T).at(x), [[4.0, 6.0]])
    np.testing.assert_array_equal(early.widened(4).toarray(), np.eye(2, 4))


@pytest.mark.parametrize(
    ("combine", "told"),
    [
        (lambda M: M + np.eye(2), r"shapes \(2, 3\) and \(2, 2\) do not add"),
        (lambda M: M @ np.eye(2), r"shapes \(2, 3\) and \(2, 2\) do not multiply"),
        (lambda M: np.eye(3) @ M, r"shapes \(3, 3\) and \(2, 3\) do not multiply"),
    ],
)
def test_shapes_that_do_not_fit_are_told(combine, told):
    with pytest.raises(ValueError, match=told):
        combine(Affine.of(np.ones((2, 3))))
