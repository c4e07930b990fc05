"""The central H-infinity controller from two Riccati equations.

Zhou, Doyle and Glover, "Robust and Optimal Control" (1996), theorem 17.1, for plants with
D11. D12 must have full column rank, D21 full row rank and no zeros may lie on the axis;
:mod:`robustpolish.synthesis.problem.regularisation` provides for that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from robustpolish.synthesis.problem.matrices import Controller, Matrix, PlantMatrices
from robustpolish.synthesis.riccati.equations import solve_riccati


@dataclass(frozen=True, eq=False)
class NormalisedPlant:
    """A plant in coordinates of w, u, z, y in which D12 = [0; I] and D21 = [0, I].

    Attributes
    ----------
    plant : PlantMatrices
    control, measurement : ndarray
        u = control times the normalised u; normalised y = measurement times y.
    """

    plant: PlantMatrices
    control: Matrix
    measurement: Matrix

    def controller(self, K: Controller) -> Controller:
        """Return the controller in the original u and y."""
        U, Y = self.control, self.measurement
        return Controller(K.A, K.B @ Y, U @ K.C, U @ K.D @ Y)


def normalise(plant: PlantMatrices) -> NormalisedPlant:
    """Rotate w and z and rescale u and y so that D12 and D21 are as the formulas want."""
    nz, nu = plant.D12.shape
    ny, nw = plant.D21.shape
    U12, s12, V12 = np.linalg.svd(plant.D12)
    U21, s21, V21 = np.linalg.svd(plant.D21)
    z_turn = np.vstack([U12[:, nu:].T, U12[:, :nu].T])
    w_turn = np.hstack([V21[ny:].T, V21[:ny].T])
    control = V12.T / s12
    measurement = (U21 / s21).T
    D12 = np.vstack([np.zeros((nz - nu, nu)), np.eye(nu)])
    D21 = np.hstack([np.zeros((ny, nw - ny)), np.eye(ny)])
    turned = plant.replace(
        B1=plant.B1 @ w_turn,
        B2=plant.B2 @ control,
        C1=z_turn @ plant.C1,
        C2=measurement @ plant.C2,
        D11=z_turn @ plant.D11 @ w_turn,
        D12=D12,
        D21=D21,
    )
    return NormalisedPlant(turned, control, measurement)


class Attempt(NamedTuple):
    """The two Riccati solutions at one gamma.

    Attributes
    ----------
    feasible : bool
        X, Y >= 0 exist and rho(XY) < gamma^2.
    coupling : float or None
        The square root of rho(XY); None where X or Y does not exist.
    """

    feasible: bool
    coupling: float | None
    X: Matrix | None = None
    Y: Matrix | None = None


def lowest_gamma(normal: NormalisedPlant) -> float:
    """Return the norm that the feedthrough alone forces."""
    D = normal.plant.D11
    free_z, free_w = D.shape[0] - normal.plant.B2.shape[1], D.shape[1] - normal.plant.C2.shape[0]
    return max(_norm(D[:free_z]), _norm(D[:, :free_w]))


def attempt(normal: NormalisedPlant, gamma: float) -> Attempt:
    """Solve both Riccati equations at `gamma`."""
    # Overflow makes the equations unsolvable, which is an answer.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return _attempt(normal, gamma)


def _attempt(normal: NormalisedPlant, gamma: float) -> Attempt:
    P = normal.plant
    nw, nz = P.B1.shape[1], P.C1.shape[0]
    if gamma <= lowest_gamma(normal):
        return Attempt(False, None)
    X = _half(P.A, np.hstack([P.B1, P.B2]), P.C1, np.hstack([P.D11, P.D12]), nw, gamma)
    if X is None:
        return Attempt(False, None)
    Y = _half(P.A.T, np.vstack([P.C1, P.C2]).T, P.B1.T, np.vstack([P.D11, P.D21]).T, nz, gamma)
    if Y is None:
        return Attempt(False, None)
    coupling = float(np.sqrt(np.abs(np.linalg.eigvals(X @ Y)).max(initial=0.0)))
    return Attempt(coupling < gamma, coupling, X, Y)


def _half(A: Matrix, B: Matrix, C: Matrix, D: Matrix, nw: int, gamma: float) -> Matrix | None:
    """Solve one Riccati equation; None unless its solution exists and is semidefinite."""
    R = D.T @ D
    R[:nw, :nw] -= gamma**2 * np.eye(nw)
    try:
        inverse = np.linalg.solve(R, np.hstack([D.T @ C, B.T]))
    except np.linalg.LinAlgError:
        return None
    n = A.shape[0]
    RDC, RB = inverse[:, :n], inverse[:, n:]
    quadratic = -B @ RB
    constant = C.T @ C - (C.T @ D) @ RDC
    found = solve_riccati(A - B @ RDC, (quadratic + quadratic.T) / 2, (constant + constant.T) / 2)
    if found is None:
        return None
    X = found.X
    # X >= 0 if and only if the full-information controller stabilises with w = 0; unlike the
    # eigenvalues of X, which may span many decades, this can be seen in doubles.
    F = -(RDC + RB @ X)
    direct = D[D.shape[0] - F.shape[0] + nw :, :nw]
    feedback = F[nw:] + direct @ F[:nw]
    stable = np.linalg.eigvals(A + B[:, nw:] @ feedback).real.max(initial=-np.inf) < 0
    return X if stable else None


def central_controller(normal: NormalisedPlant, gamma: float, X: Matrix, Y: Matrix) -> Controller:
    """Return the central controller of theorem 17.1, in the original u and y."""
    P = normal.plant
    n, nw, nz = P.A.shape[0], P.B1.shape[1], P.C1.shape[0]
    nu, ny = P.B2.shape[1], P.C2.shape[0]
    w1, z1, g2 = nw - ny, nz - nu, gamma**2
    B, C = np.hstack([P.B1, P.B2]), np.vstack([P.C1, P.C2])
    D1, D_1 = np.hstack([P.D11, P.D12]), np.vstack([P.D11, P.D21])
    R, S = D1.T @ D1, D_1 @ D_1.T
    R[:nw, :nw] -= g2 * np.eye(nw)
    S[:nz, :nz] -= g2 * np.eye(nz)
    F = -np.linalg.solve(R, D1.T @ P.C1 + B.T @ X)
    L = -np.linalg.solve(S, (P.B1 @ D_1.T + Y @ C.T).T).T
    F12, F2 = F[w1:nw], F[nw:]
    L12, L2 = L[:, z1:nz], L[:, nz:]
    D = P.D11
    D1111, D1112, D1121, D1122 = D[:z1, :w1], D[:z1, w1:], D[z1:, :w1], D[z1:, w1:]
    left = g2 * np.eye(z1) - D1111 @ D1111.T
    Dk = -D1121 @ D1111.T @ np.linalg.solve(left, D1112) - D1122
    # The square roots D12^ and D21^ of the theorem cancel in the central controller.
    Z = np.eye(n) - Y @ X / g2
    C2F = P.C2 + F12
    Bk = np.linalg.solve(Z, -L2 + (P.B2 + L12) @ Dk)
    Ck = F2 - Dk @ C2F
    Ak = P.A + B @ F - Bk @ C2F
    return normal.controller(Controller(Ak, Bk, Ck, Dk))


def _norm(M: Matrix) -> float:
    return float(np.linalg.norm(M, 2)) if M.size else 0.0
