"""The central H-infinity controller from two Riccati equations.

Zhou, Doyle and Glover, "Robust and Optimal Control" (1996), theorem 17.1, for plants with
D11. D12 must have full column rank, D21 full row rank and no zeros may lie on the axis;
:func:`robustpolish.synthesis.problem.matrices.regularise` provides for that.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices
from robustpolish.synthesis.riccati.equations import solve_riccati


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


@dataclass(frozen=True, eq=False)
class Half:
    """What one of the two equations needs: that of the controls, or of the measurements transposed.

    Attributes
    ----------
    A, B1, B2, C, D11, D12 : ndarray
        In coordinates in which D12 = [0; I].
    basis : ndarray or None
        Where the states of a reduced half lie among those of the plant; None for all of them.
    """

    A: Matrix
    B1: Matrix
    B2: Matrix
    C: Matrix
    D11: Matrix
    D12: Matrix
    basis: Matrix | None = None

    @property
    def floor(self) -> float:
        """The norm that the feedthrough alone forces."""
        free = self.D11[: self.D11.shape[0] - self.B2.shape[1]]
        return float(np.linalg.norm(free, 2)) if free.size else 0.0

    def solve(self, gamma: float) -> Matrix | None:
        """Solve the Riccati equation; None unless its solution exists and is semidefinite.

        With an infinite gamma it is that of the H2 norm.
        """
        # Without a bound the disturbances play no part.
        nw = self.B1.shape[1] if np.isfinite(gamma) else 0
        A, B, C = self.A, np.hstack([self.B1[:, :nw], self.B2]), self.C
        D = np.hstack([self.D11[:, :nw], self.D12])
        n = len(A)
        R = D.T @ D
        R[:nw, :nw] -= gamma**2 * np.eye(nw)
        try:
            inverse = np.linalg.solve(R, np.hstack([D.T @ C, B.T]))
        except np.linalg.LinAlgError:
            return None
        RDC, RB = inverse[:, :n], inverse[:, n:]
        quadratic = -B @ RB
        constant = C.T @ C - (C.T @ D) @ RDC
        found = solve_riccati(
            A - B @ RDC, (quadratic + quadratic.T) / 2, (constant + constant.T) / 2
        )
        if found is None:
            return None
        X = found.X
        # X >= 0 if and only if the full-information controller stabilises with w = 0; unlike the
        # eigenvalues of X, which may span many decades, this can be seen in doubles.
        F = -(RDC + RB @ X)
        direct = self.D11[len(C) - self.B2.shape[1] :, :nw]
        feedback = F[nw:] + direct @ F[:nw]
        if not np.linalg.eigvals(A + self.B2 @ feedback).real.max(initial=-np.inf) < 0:
            return None
        return X if self.basis is None else self.basis @ X @ self.basis.T


@dataclass(frozen=True, eq=False)
class TwoHalves:
    """The pair of equations whose common solvability decides whether a gamma can be reached."""

    control: Half
    measurement: Half

    @property
    def states(self) -> int:
        """Number of states, which the cost of an attempt follows from."""
        return max(len(self.control.A), len(self.measurement.A))

    @property
    def floor(self) -> float:
        """The norm that the feedthrough alone forces."""
        return max(self.control.floor, self.measurement.floor)

    def attempt(self, gamma: float) -> Attempt:
        """Solve both equations at `gamma`."""
        if gamma <= self.floor:
            return Attempt(False, None)
        # Overflow makes the equations unsolvable, which is an answer.
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            X = self.control.solve(gamma)
            Y = None if X is None else self.measurement.solve(gamma)
            if X is None or Y is None:
                return Attempt(False, None)
            coupling = float(np.sqrt(np.abs(np.linalg.eigvals(X @ Y)).max(initial=0.0)))
        return Attempt(coupling < gamma, coupling, X, Y)


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

    @cached_property
    def halves(self) -> TwoHalves:
        """Its two Riccati equations."""
        P = self.plant
        return TwoHalves(
            Half(P.A, P.B1, P.B2, P.C1, P.D11, P.D12),
            Half(P.A.T, P.C1.T, P.C2.T, P.B1.T, P.D11.T, P.D21.T),
        )

    def controller(self, K: Controller) -> Controller:
        """Return the controller in the original u and y."""
        U, Y = self.control, self.measurement
        return Controller(K.A, K.B @ Y, U @ K.C, U @ K.D @ Y)


def has_full_rank(plant: PlantMatrices) -> bool:
    """Tell whether D12 and D21 have full column and row rank, whatever the sizes of signals."""
    return _full_rank(plant.D12) and _full_rank(plant.D21.T)


def _full_rank(D: Matrix) -> bool:
    size = np.linalg.norm(D, axis=0)
    if D.shape[0] < D.shape[1] or not size.all():
        return False
    return bool(np.linalg.svd(D / size, compute_uv=False)[-1] > 1e-8)


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
