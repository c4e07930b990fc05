"""The H2 optimum by Riccati equations (LQG), and the infimum of singular problems."""

from __future__ import annotations

import warnings
from typing import NamedTuple

import control
import numpy as np
from scipy import linalg

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.errors import InfeasibleError
from robustpolish.linear.norms.h2 import h2_norm
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices, close
from robustpolish.synthesis.riccati.equations import solve_riccati
from robustpolish.synthesis.riccati.gamma import LowerBound, reduced_riccati_pair

_HOW = "by Riccati equations in double precision"

# How much of D11 may be left, relative, where a static controller cancels it.
_CANCELLED = 1e-9


class WithoutFeedthrough(NamedTuple):
    """A plant whose D11 a static controller has cancelled, and that controller."""

    plant: PlantMatrices
    feedback: Matrix


def cancel_feedthrough(plant: PlantMatrices) -> WithoutFeedthrough:
    """Close a static controller that makes the feedthrough from w to z zero.

    Raises
    ------
    InfeasibleError
        If none does, so that the H2 norm of every loop is infinite.
    """
    P = plant
    F = np.zeros((P.B2.shape[1], P.C2.shape[0]))
    if plant.discrete or not P.D11.any():
        return WithoutFeedthrough(plant, F)
    F = -np.linalg.pinv(P.D12, rcond=1e-12) @ P.D11 @ np.linalg.pinv(P.D21, rcond=1e-12)
    rest = P.D11 + P.D12 @ F @ P.D21
    if np.abs(rest).max() > _CANCELLED * np.abs(P.D11).max():
        raise no_finite_h2_norm()
    closed = P.replace(
        A=P.A + P.B2 @ F @ P.C2,
        B1=P.B1 + P.B2 @ F @ P.D21,
        C1=P.C1 + P.D12 @ F @ P.C2,
        D11=np.zeros_like(P.D11),
    )
    return WithoutFeedthrough(closed, F)


def no_finite_h2_norm() -> InfeasibleError:
    """Return the error for a feedthrough that passes white noise whatever the controller does."""
    return InfeasibleError(
        "The H2 norm of every loop is infinite: no controller cancels the feedthrough D11 from "
        "w to z. Filter w or z so that D11 vanishes, or use norm='hinf'."
    )


def h2_lower_bound(plant: PlantMatrices) -> LowerBound | None:
    """Bound the H2 norm of every stabilising controller's loop from below.

    Stoorvogel, "The singular H2 control problem", Automatica 28 (1992) 627-631: the square of the
    infimum is tr(B1' X B1) + tr((A'X + XA + C1'C1) Y), X and Y as for the H-infinity norm with
    gamma = infinity.

    Parameters
    ----------
    plant : PlantMatrices
        Scaled, without D22, and without D11 if continuous.

    Returns
    -------
    LowerBound or None
        None where the equations have no solution in double precision.
    """
    if plant.discrete:
        K = lqg(plant)
        if K is None:
            return None
        return LowerBound(float(h2_norm(control.StateSpace(*close(plant, K), True))), _HOW)
    P, halves = plant, reduced_riccati_pair(plant)
    if halves is None:
        return None
    X, Y = halves.control.solve(np.inf), halves.measurement.solve(np.inf)
    if X is None or Y is None:
        return None
    square = np.trace(P.B1.T @ X @ P.B1) + np.trace((P.A.T @ X + X @ P.A + P.C1.T @ P.C1) @ Y)
    return LowerBound(float(np.sqrt(max(square, 0.0))), _HOW)


def lqg(plant: PlantMatrices) -> Controller | None:
    """Return the optimal controller of a regular plant; None if it is not regular.

    Zhou, Doyle, Glover, "Robust and Optimal Control" (1996), theorem 14.7, in continuous time. In
    discrete time the measurement of the same instant is used: Chen and Francis,
    "Optimal Sampled-Data Control Systems" (1995), section 6.6.
    """
    if plant.discrete:
        return _discrete_lqg(plant)
    P = plant
    F = _regulator(P.A, P.B2, P.C1, P.D12)
    L = _regulator(P.A.T, P.C2.T, P.B1.T, P.D21.T)
    if F is None or L is None:
        return None
    L = L.T
    return Controller(P.A + P.B2 @ F + L @ P.C2, -L, F, np.zeros((P.B2.shape[1], P.C2.shape[0])))


def _regulator(A: Matrix, B: Matrix, C: Matrix, D: Matrix) -> Matrix | None:
    """Return the gain that minimises the energy of C x + D u."""
    R = _inverse(D)
    if R is None:
        return None
    cross = R @ D.T @ C
    rest = C - D @ cross
    found = solve_riccati(A - B @ cross, -B @ R @ B.T, rest.T @ rest)
    if found is None:
        return None
    F = -(R @ B.T @ found.X + cross)
    stable = not len(A) or np.linalg.eigvals(A + B @ F).real.max() < 0
    return F if stable else None


def _inverse(D: Matrix) -> Matrix | None:
    """Return the inverse of D'D unless D lacks full column rank, to working accuracy."""
    _, s, Vt = np.linalg.svd(D)
    if D.shape[0] < D.shape[1] or not s.size or s[-1] < 1e-10 * max(s[0], 1.0):
        return None
    return (Vt.T / s**2) @ Vt


def _discrete_lqg(plant: PlantMatrices) -> Controller | None:
    P = plant
    regulator = _discrete_regulator(P.A, P.B2, P.C1, P.D12)
    estimate = _discrete_regulator(P.A.T, P.C2.T, P.B1.T, P.D21.T)
    if regulator is None or estimate is None:
        return None
    (X, F, R), (Y, Lt, St) = regulator, estimate
    L, S = Lt.T, St.T
    F0 = -np.linalg.solve(R, P.B2.T @ X @ P.B1 + P.D12.T @ P.D11)
    L0 = np.linalg.solve(S.T, (F @ Y @ P.C2.T + F0 @ P.D21.T).T).T
    return Controller(
        P.A + P.B2 @ F + L @ P.C2 - P.B2 @ L0 @ P.C2,
        -(L - P.B2 @ L0),
        F - L0 @ P.C2,
        L0,
    )


def _discrete_regulator(
    A: Matrix, B: Matrix, C: Matrix, D: Matrix
) -> tuple[Matrix, Matrix, Matrix] | None:
    """Return the Riccati solution, the gain and the weight B'XB + D'D."""
    with warnings.catch_warnings():
        # An ill-conditioned answer shows in the norm of the loop.
        warnings.simplefilter("ignore")
        try:
            X = linalg.solve_discrete_are(A, B, C.T @ C, D.T @ D, s=C.T @ D)
        except (linalg.LinAlgError, ValueError):
            return None
    weight = D.T @ D + B.T @ X @ B
    if np.linalg.cond(weight) > 1e14:
        return None
    F = -np.linalg.solve(weight, B.T @ X @ A + D.T @ C)
    return X, F, weight
