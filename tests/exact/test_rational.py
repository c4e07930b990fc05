"""Exact arithmetic on state-space matrices."""

import numpy as np
import pytest
from flint import fmpq_mat

from robustpolish.linear.arithmetic import rational as kit
from robustpolish.linear.arithmetic.rational import rational, reachable, to_float


def hidden_behind(seed, n, lost, inputs):
    """Whole numbers in which `lost` states are out of reach in mixed coordinates."""
    rng = np.random.default_rng(seed)
    A, B, C = (rng.integers(-5, 6, shape) for shape in ((n, n), (n, inputs), (2, n)))
    A[:lost, lost:], B[:lost] = 0, 0
    lower, upper = (np.tril(rng.integers(-2, 3, (n, n)), -1) + np.eye(n) for _ in range(2))
    T = fmpq_mat(rational(lower) * rational(upper.T))  # its determinant is one
    back = T.inv()
    return T * rational(A * 1.0) * back, T * rational(B * 1.0), rational(C * 1.0) * back


@pytest.mark.parametrize(("n", "lost", "inputs"), [(1, 1, 1), (4, 1, 2), (9, 3, 1), (12, 11, 3)])
def test_the_reachable_part_keeps_the_transfer_matrix(n, lost, inputs):
    for seed in range(5):
        A, B, C = hidden_behind(seed, n, lost, inputs)
        Ar, Br, Cr = reachable(A, B, C)
        assert Ar.nrows() <= n - lost
        assert reachable(Ar, Br, Cr)[0].nrows() == Ar.nrows()
        power, small = B, Br
        for _ in range(n + 1):  # the Markov parameters agree exactly
            assert C * power == Cr * small
            power, small = A * power, Ar * small


def test_a_reachable_system_and_one_without_inputs():
    A, B, C = hidden_behind(0, 5, 0, 2)
    assert reachable(A, B, C) == (A, B, C)
    assert reachable(A, fmpq_mat(5, 0), C)[0].nrows() == 0


def test_an_unlucky_prime_changes_nothing(monkeypatch):
    A, B = rational(np.array([[1.0, 0], [7, 2]])), rational(np.array([[1.0], [0]]))
    C = rational(np.eye(2))
    monkeypatch.setattr(kit, "_PRIME", 7)  # modulo 7 the second state is out of reach
    assert reachable(A, B, C) == (A, B, C)


def test_a_large_system_with_a_hidden_mode_is_settled():
    rng = np.random.default_rng(40)  # by elimination of fractions it took minutes
    A, B = rng.standard_normal((40, 40)), rng.standard_normal((40, 2))
    A[0, 1:], B[0] = 0, 0
    Ar, _, _ = reachable(rational(A), rational(B), rational(np.eye(40)))
    assert Ar == rational(A[1:, 1:])


def test_rounding_to_doubles_is_to_nearest():
    M = np.array([[0.1, -3.0], [2.0**-1074, 1e300]])
    assert (to_float(rational(M)) == M).all()
