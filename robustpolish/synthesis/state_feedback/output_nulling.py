"""State feedback that keeps the disturbances from z altogether, where there is one."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import linalg

from robustpolish.base.arrays import Matrix
from robustpolish.synthesis.problem.matrices import PlantMatrices

# Singular values below it are zero: the matrices are scaled.
_RANK = 1e-10


def output_nulling_gain(p: PlantMatrices) -> Matrix | None:
    """Return a stabilising F with which w does not reach z; None if there is none.

    Notes
    -----
    Within the largest subspace V that a control u = U v keeps while z stays zero, the part that is
    stabilised with what is free in u has to hold B1 (H. L. Trentelman, A. A. Stoorvogel,
    M. Hautus, Control Theory for Linear Systems, 2001, chapters 4 to 7).
    """
    if p.D11.any():
        return None
    A, B, V = p.A, p.B2, np.eye(p.nx)
    while True:  # x is kept if some u leads it back into V, with z = 0
        out, free = _leaving(p, V)
        kept = _range(V @ _null(np.hstack([out, free]))[: V.shape[1]])
        if kept.shape[1] == V.shape[1]:
            break
        V = kept
    U = N = inner = entry = V
    for _ in range(2):
        out, free = _leaving(p, V)
        U, N = -np.linalg.pinv(free, rcond=_RANK) @ out, _null(free)
        inner, entry = V.T @ (A @ V + B @ U), V.T @ B @ N
        good = (lambda s: abs(s) < 1 - _RANK) if p.discrete else (lambda s: s.real < -_RANK)
        found: Any = linalg.schur(inner, output="complex", sort=good)
        steps = [entry]
        for _ in range(V.shape[1] - 1):
            steps.append(inner @ steps[-1] / max(float(np.linalg.norm(inner, 2)), 1e-300))
        slow = found[1][:, : found[2]]
        stabilised = _range(V @ _range(np.hstack([*steps, slow.real, slow.imag])))
        if stabilised.shape[1] == V.shape[1]:
            break
        V = stabilised
    if not V.size or np.linalg.norm(p.B1 - V @ (V.T @ p.B1)) > _RANK * np.linalg.norm(p.B1):
        return None
    W = _null(V.T)
    try:
        within = U + N @ _regulator(inner, entry, p.discrete)
        beyond = _regulator(W.T @ A @ W, W.T @ B, p.discrete)
    except np.linalg.LinAlgError:
        return None
    return within @ V.T + beyond @ W.T


def _leaving(p: PlantMatrices, V: Matrix) -> tuple[Matrix, Matrix]:
    """Return what of x in V, and of u, leaves V or shows in z."""
    W = _null(V.T)
    return np.vstack([W.T @ p.A @ V, p.C1 @ V]), np.vstack([W.T @ p.B2, p.D12])


def _regulator(A: Matrix, B: Matrix, discrete: bool) -> Matrix:
    if not A.size or not B.size:
        return np.zeros((B.shape[1], len(A)))
    Q, R = np.eye(len(A)), np.eye(B.shape[1])
    if discrete:
        X = linalg.solve_discrete_are(A, B, Q, R)
        return -np.linalg.solve(R + B.T @ X @ B, B.T @ X @ A)
    return -B.T @ linalg.solve_continuous_are(A, B, Q, R)


def _null(M: Matrix) -> Matrix:
    return linalg.null_space(M, rcond=_RANK) if len(M) else np.eye(M.shape[1])


def _range(M: Matrix) -> Matrix:
    return linalg.orth(M, rcond=_RANK) if M.size else M[:, :0]
