"""Eigenvalues of small Hermitian matrices, compiled: calls of LAPACK would cost more than these."""

from __future__ import annotations

import numpy as np

from robustpolish.compiling import njit

_SWEEPS = 30


@njit(cache=True, error_model="numpy")
def eigen(H, V):  # type: ignore[no-untyped-def]  # compiled
    """Turn a Hermitian matrix to diagonal form by Jacobi's rotations.

    Parameters
    ----------
    H : ndarray of complex, shape (m, m)
        Overwritten: it becomes V* H V, with eigenvalues that rise along its diagonal.
    V : ndarray of complex, shape (m, m)
        Overwritten by the eigenvectors.
    """
    m = H.shape[0]
    for i in range(m):
        for j in range(m):
            V[i, j] = 1.0 if i == j else 0.0
    for _ in range(_SWEEPS):
        turned = False
        for i in range(m - 1):
            for j in range(i + 1, m):
                turned |= _rotate(H, V, i, j)
        if not turned:
            break
    for i in range(m - 1):  # the smallest that is left comes next
        least = i
        for j in range(i + 1, m):
            if H[j, j].real < H[least, least].real:
                least = j
        if least != i:
            for k in range(m):
                H[k, i], H[k, least] = H[k, least], H[k, i]
                V[k, i], V[k, least] = V[k, least], V[k, i]
            for k in range(m):
                H[i, k], H[least, k] = H[least, k], H[i, k]


@njit(cache=True, error_model="numpy")
def _rotate(H, V, i, j):  # type: ignore[no-untyped-def]  # compiled
    """Make an entry beside the diagonal zero; say whether there was something to do."""
    size = np.hypot(H[i, j].real, H[i, j].imag)
    low, high = H[i, i].real, H[j, j].real
    if not size > 1e-17 * (abs(low) + abs(high)):
        return False
    phase = H[i, j] / size
    half = 0.5 * (high - low) / size
    tangent = 1.0 / (abs(half) + np.sqrt(half * half + 1.0))
    if half < 0.0:
        tangent = -tangent
    cosine = 1.0 / np.sqrt(tangent * tangent + 1.0)
    sine = tangent * cosine
    back = np.conj(phase)
    for k in range(H.shape[0]):
        one, other = H[k, i], H[k, j] * back
        H[k, i] = cosine * one - sine * other
        H[k, j] = sine * one + cosine * other
        one, other = V[k, i], V[k, j] * back
        V[k, i] = cosine * one - sine * other
        V[k, j] = sine * one + cosine * other
    for k in range(H.shape[0]):
        one, other = H[i, k], H[j, k] * phase
        H[i, k] = cosine * one - sine * other
        H[j, k] = sine * one + cosine * other
    H[i, j] = 0.0
    H[j, i] = 0.0
    H[i, i] = H[i, i].real
    H[j, j] = H[j, j].real
    return True


@njit(cache=True, error_model="numpy")
def largest_gain(G):  # type: ignore[no-untyped-def]  # compiled
    """Return the largest singular value of a matrix with at most as many columns as rows."""
    p, m = G.shape
    if m == 1:
        total = 0.0
        for i in range(p):
            total += G[i, 0].real ** 2 + G[i, 0].imag ** 2
        return np.sqrt(total)
    H = np.empty((m, m), np.complex128)
    for i in range(m):
        for j in range(m):
            entry = complex(0.0, 0.0)
            for k in range(p):
                entry += np.conj(G[k, i]) * G[k, j]
            H[i, j] = entry
    V = np.empty((m, m), np.complex128)
    eigen(H, V)
    return np.sqrt(max(H[m - 1, m - 1].real, 0.0))
