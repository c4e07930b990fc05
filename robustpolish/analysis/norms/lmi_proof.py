"""Does a given matrix satisfy the strict inequality? Decided in rational arithmetic."""

from __future__ import annotations

from flint import fmpq, fmpq_mat
from numpy.typing import NDArray

from robustpolish.analysis.norms.lmi_solver import Equation
from robustpolish.exact.rational import (
    ExactModel,
    exactly_positive_definite,
    fraction,
    identity,
    joined,
    rational,
)


def proves(system: ExactModel, equation: Equation, K: NDArray, gamma: float) -> bool:
    """Say whether K > 0 satisfies the equation with this gamma, without rounding."""
    X, bound = rational(K), fraction(gamma)
    if not exactly_positive_definite(X):
        return False
    if equation == "10.15":
        return exactly_positive_definite(-_lyapunov(system, X))
    if equation == "10.17":
        return exactly_positive_definite(-_three_rows(system, X, bound))
    if equation == "10.44":
        return exactly_positive_definite(-_two_rows(system, X, bound))
    if not exactly_positive_definite(-_gramian_rows(system, X, bound)):
        return False
    C = system.C  # the least trace of Z is that of C K^-1 C^T, approached from above
    least = C * X.solve(C.transpose())
    return bool(sum((least[i, i] for i in range(C.nrows())), fmpq(0)) < bound)


def _lyapunov(G: ExactModel, K: fmpq_mat) -> fmpq_mat:
    return G.A.transpose() * K + K * G.A


def _three_rows(G: ExactModel, K: fmpq_mat, gamma: fmpq) -> fmpq_mat:
    KB = K * G.B
    m, p = G.B.ncols(), G.C.nrows()
    return joined(
        [
            [_lyapunov(G, K), KB, G.C.transpose()],
            [KB.transpose(), identity(m) * (-gamma * gamma), G.D.transpose()],
            [G.C, G.D, -identity(p)],
        ]
    )


def _two_rows(G: ExactModel, K: fmpq_mat, gamma: fmpq) -> fmpq_mat:
    Ct, Dt = G.C.transpose(), G.D.transpose()
    corner = K * G.B + Ct * G.D
    below = Dt * G.D - identity(G.B.ncols()) * (gamma * gamma)
    return joined([[_lyapunov(G, K) + Ct * G.C, corner], [corner.transpose(), below]])


def _gramian_rows(G: ExactModel, K: fmpq_mat, gamma: fmpq) -> fmpq_mat:
    KB = K * G.B
    below = identity(G.B.ncols()) * (-gamma)
    return joined([[_lyapunov(G, K), KB], [KB.transpose(), below]])
