import numpy as np

from robustpolish.robust.real_parameters import lyapunov_factors


def test_both_sides():
    random = np.random.default_rng(0)
    B, Y = random.standard_normal((4, 2)), random.standard_normal((2, 4))
    left, right = lyapunov_factors(B)
    np.testing.assert_allclose((left @ Y.ravel()).reshape(4, 4), B @ Y)
    np.testing.assert_allclose((right @ Y.ravel()).reshape(4, 4), Y.T @ B.T)
