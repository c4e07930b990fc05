"""Eigenvectors put together from what LAPACK keeps."""

import numpy as np
from scipy.linalg import lapack

from robustpolish.linear.eigenvectors import complex_eigenpairs


def test_pairs_and_real_values_in_any_order():
    rng = np.random.default_rng(2)
    blocks = np.zeros((5, 5))
    blocks[:2, :2], blocks[2, 2] = [[-1.0, 3.0], [-3.0, -1.0]], -2.0
    blocks[3:, 3:] = [[-4.0, 1.0], [-1.0, -4.0]]
    T = rng.standard_normal((5, 5))
    A = T @ blocks @ np.linalg.inv(T)
    real, imag, left, right, _ = lapack.dgeev(A)
    assert (imag > 0).sum() == 2
    values, cosines, L, R = complex_eigenpairs(real, imag, left.T, right.T)
    np.testing.assert_allclose(A @ R.T, R.T * values, atol=1e-13)
    np.testing.assert_allclose(L.conj() @ A, values[:, None] * L.conj(), atol=1e-13)
    np.testing.assert_allclose(cosines, np.abs((L.conj() * R).sum(axis=1)), rtol=1e-12)
    np.testing.assert_array_equal(values[imag < 0], values[imag > 0].conj())
