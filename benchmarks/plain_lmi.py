"""The textbook inequalities (10.20) to (10.24), typed in as they stand: no scaling, no checks.

For comparison only: what an engineer gets from cvxpy or picos without further care.
"""

from __future__ import annotations

import control
import cvxpy as cp
import numpy as np
import picos

import robustpolish as rp

Answer = tuple[control.StateSpace, float]


def plain_lmi_cvxpy(plant: rp.GeneralizedPlant) -> Answer:
    """Minimise gamma with cvxpy and Clarabel, rebuild the controller."""
    p, n = plant, plant.nx
    X, Y = cp.Variable((n, n), symmetric=True), cp.Variable((n, n), symmetric=True)
    K, L = cp.Variable((n, n)), cp.Variable((n, p.ny))
    M, N = cp.Variable((p.nu, n)), cp.Variable((p.nu, p.ny))
    gamma = cp.Variable()
    A = cp.bmat([[p.A @ Y + p.B2 @ M, p.A + p.B2 @ N @ p.C2], [K, X @ p.A + L @ p.C2]])
    B = cp.vstack([p.B1 + p.B2 @ N @ p.D21, X @ p.B1 + L @ p.D21])
    C = cp.hstack([p.C1 @ Y + p.D12 @ M, p.C1 + p.D12 @ N @ p.C2])
    D = p.D11 + p.D12 @ N @ p.D21
    whole = cp.bmat(
        [
            [A + A.T, B, C.T],
            [B.T, -gamma * np.eye(p.nw), D.T],
            [C, D, -gamma * np.eye(p.nz)],
        ]
    )
    coupled = cp.bmat([[Y, np.eye(n)], [np.eye(n), X]])
    cp.Problem(cp.Minimize(gamma), [(whole + whole.T) / 2 << 0, coupled >> 0]).solve(cp.CLARABEL)
    return _rebuilt(p, *(v.value for v in (X, Y, K, L, M, N))), float(gamma.value)


def plain_lmi_picos(plant: rp.GeneralizedPlant) -> Answer:
    """Minimise gamma with picos and CVXOPT, rebuild the controller."""
    p, n = plant, plant.nx
    X, Y = picos.SymmetricVariable("X", n), picos.SymmetricVariable("Y", n)
    K, L = picos.RealVariable("K", (n, n)), picos.RealVariable("L", (n, p.ny))
    M, N = picos.RealVariable("M", (p.nu, n)), picos.RealVariable("N", (p.nu, p.ny))
    gamma = picos.RealVariable("gamma")
    # picos reads ' as transpose; & and // put blocks beside and below each other.
    A = ((p.A * Y + p.B2 * M) & (p.A + p.B2 * N * p.C2)) // (K & (X * p.A + L * p.C2))
    B = (p.B1 + p.B2 * N * p.D21) // (X * p.B1 + L * p.D21)
    C = (p.C1 * Y + p.D12 * M) & (p.C1 + p.D12 * N * p.C2)
    D = p.D11 + p.D12 * N * p.D21
    whole = (
        ((A + A.T) & B & C.T)
        // (B.T & (-gamma * np.eye(p.nw)) & D.T)
        // (C & D & (-gamma * np.eye(p.nz)))
    )
    problem = picos.Problem()
    problem.minimize = gamma
    problem += whole << 0
    problem += ((Y & np.eye(n)) // (np.eye(n) & X)) >> 0
    problem.solve(solver="cvxopt", primals=None)
    values = [np.array(v.value).reshape(v.shape) for v in (X, Y, K, L, M, N)]
    return _rebuilt(p, *values), float(gamma.value)


def _rebuilt(p: rp.GeneralizedPlant, X, Y, K, L, M, N) -> control.StateSpace:
    """Undo the change of variables, (10.23) and (10.24), with V = I."""
    n = p.nx
    U = (np.eye(n) - Y @ X).T
    left = np.block([[U, X @ p.B2], [np.zeros((p.nu, n)), np.eye(p.nu)]])
    right = np.block([[np.eye(n), np.zeros((n, p.ny))], [p.C2 @ Y, np.eye(p.ny)]])
    middle = np.block([[K - X @ p.A @ Y, L], [M, N]])
    block = np.linalg.solve(left, middle) @ np.linalg.inv(right)
    return control.StateSpace(block[:n, :n], block[:n, n:], block[n:, :n], block[n:, n:])
