"""Riccati and Lyapunov equations, solved so that failure is seen.

``scipy.linalg.solve_continuous_are`` can return a wrong solution without an error near the
optimum of an H-infinity problem, and wants a definite quadratic term. The solver here
balances the Hamiltonian with a scaling that keeps its structure, orders its real Schur form
and answers None when the stable subspace is no graph.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.synthesis.problem.matrices import balancing_scale

_MOST_ASYMMETRY = 1e-6


class RiccatiSolution(NamedTuple):
    """X and how it was reached."""

    X: Matrix
    separation: float  # distance of the Hamiltonian's spectrum from the axis, over its size
    graph: float  # reciprocal condition number of the subspace's upper half


def solve_riccati(A: Matrix, R: Matrix, Q: Matrix) -> RiccatiSolution | None:
    r"""Return the stabilising solution of A'X + XA + XRX + Q = 0.

    Parameters
    ----------
    A, R, Q : ndarray, shape (n, n)
        R and Q symmetric, of any sign.

    Returns
    -------
    RiccatiSolution or None
        X symmetric with A + R X stable; None if the Hamiltonian has eigenvalues on the
        axis, to working accuracy, or if no such X exists.
    """
    n = A.shape[0]
    if n == 0:
        return RiccatiSolution(np.zeros((0, 0)), 1.0, 1.0)
    if not (np.isfinite(A).all() and np.isfinite(R).all() and np.isfinite(Q).all()):
        return None
    scale, weight = symplectic_scaling(A, R, Q)
    column, row = scale[None, :], 1 / scale[:, None]
    H = np.block(
        [
            [A * row * column, R * row * row.T * weight],
            [-(Q * column.T * column) / weight, -A.T * column.T * row.T],
        ]
    )
    if not np.isfinite(H).all():
        return None
    try:
        T, U, stable = linalg.schur(H, sort="lhp")  # type: ignore[misc]
    except linalg.LinAlgError:
        return None
    if stable != n:
        return None
    eigenvalues = _quasi_triangular_eigenvalues(T)
    size = np.abs(eigenvalues).max()
    separation = float(np.abs(eigenvalues.real).min() / size) if size else 0.0
    upper, lower = U[:n, :n], U[n:, :n]
    # A subspace that holds eigenvalues of the axis, pushed to the left by rounding, is
    # not Lagrangian: its X would not be symmetric.
    product = upper.T @ lower
    if np.abs(product - product.T).max() > _MOST_ASYMMETRY:
        return None
    # LAPACK itself: SciPy would warn of a singular matrix, which is an answer here.
    getrf: Any = linalg.get_lapack_funcs("getrf", (upper,))
    lu, pivots, info = getrf(upper)
    singular = np.linalg.svd(upper, compute_uv=False)
    if info > 0 or singular[-1] <= np.finfo(float).tiny:
        return None
    X = linalg.lu_solve((lu, pivots), lower.T, trans=1).T
    X = (X + X.T) / 2 * weight
    X = X * row * row.T
    if not np.isfinite(X).all():
        return None
    return RiccatiSolution(X, separation, float(singular[-1] / singular[0]))


def symplectic_scaling(A: Matrix, R: Matrix, Q: Matrix) -> tuple[Matrix, float]:
    """Return powers of two that even out a Hamiltonian without breaking its structure.

    Returns
    -------
    scale : ndarray, shape (n,)
        State scaling x = diag(scale) x_new.
    weight : float
        Factor between the two halves: R is multiplied and Q divided by it.
    """
    n = A.shape[0]
    size = np.abs(np.block([[A, R], [Q, A.T]]))
    np.fill_diagonal(size, 0)
    logs = np.log2(balancing_scale(size))
    scale = np.exp2(np.round((logs[:n] - logs[n:]) / 2))
    r = np.abs(R / scale[:, None] / scale[None, :]).max()
    q = np.abs(Q * scale[:, None] * scale[None, :]).max()
    weight = float(np.exp2(np.round(np.log2(q / r) / 2))) if r > 0 and q > 0 else 1.0
    return scale, weight


def solve_lyapunov(A: Matrix, Q: Matrix) -> Matrix | None:
    """Return X of A'X + XA + Q = 0 for a stable A; None where numbers are not finite.

    Where eigenvalues lie on the axis, to working accuracy, LAPACK moves them: X is then no more
    than a start.
    """
    if A.shape[0] == 0:
        return np.zeros((0, 0))
    if not (np.isfinite(A).all() and np.isfinite(Q).all()):
        return None
    T, U = linalg.schur(A.T, output="real")  # type: ignore[misc]
    # dtrsyl scales the right-hand side down where it would overflow.
    trsyl: Any = linalg.get_lapack_funcs("trsyl", (T, Q))
    Y, scale, info = trsyl(T, T, -U.T @ Q @ U, tranb="T")
    if info < 0 or scale == 0 or not np.isfinite(Y).all():
        return None
    X = U @ (Y / scale) @ U.T
    return (X + X.T) / 2 if np.isfinite(X).all() else None


def _quasi_triangular_eigenvalues(T: Matrix) -> NDArray[np.complex128]:
    """Read the eigenvalues off a real Schur form."""
    values = np.diag(T).astype(complex)
    for i in np.flatnonzero(np.diag(T, -1)):
        mean, half = (T[i, i] + T[i + 1, i + 1]) / 2, (T[i, i] - T[i + 1, i + 1]) / 2
        root = np.sqrt(complex(half**2 + T[i, i + 1] * T[i + 1, i]))
        values[i], values[i + 1] = mean + root, mean - root
    return values
