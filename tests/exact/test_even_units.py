"""Powers of two that make the entries of a system even."""

import numpy as np
import pytest
from scipy.linalg import lapack

from robustpolish.linear.arithmetic.even_units import balance, is_exact_scaling
from robustpolish.linear.arithmetic.powers_of_two import nearest_exponent


@pytest.mark.parametrize("seed", range(10))
def test_states_are_balanced_as_by_lapack(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 9))
    A = rng.standard_normal((n, n)) * 10.0 ** rng.uniform(-9, 9, (n, n))
    A *= rng.random((n, n)) < (1.0, 0.4)[seed % 2]
    rows, columns = np.zeros((2, n), np.int64)
    found = A.copy()
    balance(found, n, rows, columns, False)
    expected, _, _, scales, _ = lapack.dgebal(A, scale=1, permute=0)
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(np.ldexp(1.0, columns), scales)
    np.testing.assert_array_equal(rows, -columns)


def test_all_inputs_trade_with_all_outputs():
    M = np.array([[-1.0, 2.0**20, 2.0**20], [2.0**-20, 7.0, 0.0], [2.0**-20, 0.0, 7.0]])
    rows, columns = np.zeros((2, 3), np.int64)
    balance(M, 1, rows, columns, True)
    assert columns[1] == columns[2] == -rows[1] == -rows[2]
    assert M[0, 1] == M[1, 0] == 1.0  # so that B and C are of one size
    np.testing.assert_array_equal(M[1:, 1:], 7.0 * np.eye(2))


def test_exponents_of_what_has_none_are_zero():
    assert [nearest_exponent(x) for x in (3.1, 0.3, 0.0, np.inf, np.nan)] == [2, -2, 0, 0, 0]


def test_lost_bits_are_seen():
    given, none = np.array([[1.0, 5e-324]]), np.zeros(2, np.int64)
    assert is_exact_scaling(given, none[:1], none, given, 1e100)
    assert not is_exact_scaling(given * 0.5, np.array([-1]), none, given, 1e100)
    assert not is_exact_scaling(given * 1e200, none[:1], none, given * 1e200, 1e100)
