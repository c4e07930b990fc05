"""Eigenvalues of small Hermitian matrices, against LAPACK."""

import numpy as np
import pytest

from robustpolish.linear.norms.modal_peak import eigen, largest_gain


@pytest.mark.parametrize("size", [1, 2, 3, 7])
@pytest.mark.parametrize("spread", [0, 8])
def test_eigenvalues_rise_and_vectors_are_orthonormal(size, spread):
    rng = np.random.default_rng(size)
    for _ in range(20):
        M = rng.standard_normal((size, size)) + 1j * rng.standard_normal((size, size))
        M *= 10.0 ** rng.uniform(-spread, 0, size)
        H = M @ M.conj().T
        found, V = H.copy(), np.empty_like(H)
        eigen(found, V)
        values = found.diagonal().real
        np.testing.assert_allclose(values, np.linalg.eigvalsh(H), atol=1e-14 * values[-1])
        np.testing.assert_allclose(V.conj().T @ V, np.eye(size), atol=1e-14 * size)
        np.testing.assert_allclose(
            V.conj().T @ H @ V, np.diag(values), atol=3e-15 * size * values[-1]
        )


def test_equal_eigenvalues():
    H = np.eye(3, dtype=complex)
    V = np.empty_like(H)
    eigen(H, V)
    np.testing.assert_array_equal(V, np.eye(3))


@pytest.mark.parametrize("shape", [(1, 1), (4, 1), (2, 2), (5, 3)])
def test_the_largest_gain_is_the_largest_singular_value(shape):
    rng = np.random.default_rng(shape[0])
    G = rng.standard_normal(shape) + 1j * rng.standard_normal(shape)
    assert largest_gain(G) == pytest.approx(np.linalg.norm(G, 2), rel=1e-14)
    assert largest_gain(0 * G) == 0.0
