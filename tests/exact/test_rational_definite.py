"""Definiteness without rounding."""

import numpy as np
import pytest

from robustpolish.errors import InvalidInputError
from robustpolish.linear import is_positive_definite


def test_the_last_bit_decides():
    assert is_positive_definite([[1, 1], [1, 1 + 2.0**-52]])
    assert not is_positive_definite([[1, 1], [1, 1]])
    assert not is_positive_definite([[1, 1], [1, 1 - 2.0**-53]])


def test_random_matrices():
    rng = np.random.default_rng(0)
    for _ in range(50):
        Q = rng.standard_normal((6, 6))
        shift = rng.uniform(-1, 1)
        M = Q @ Q.T + shift * np.eye(6)
        M = (M + M.T) / 2
        assert is_positive_definite(M) == (np.linalg.eigvalsh(M).min() > 0)


def test_any_scale():
    assert is_positive_definite(np.diag([1e-300, 1e300]))
    assert not is_positive_definite(np.diag([1.0, -1e-300]))
    assert is_positive_definite(np.zeros((0, 0)))


def test_bad_input_is_refused():
    with pytest.raises(InvalidInputError, match=r"M: .*symmetric"):
        is_positive_definite([[1, 2], [2.0000001, 5]])
