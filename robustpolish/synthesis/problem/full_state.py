"""Plants whose whole state is measured, y = x: the loops of u = F x, and related plants.

Every function takes and returns :class:`PlantMatrices`; in discrete time x' is x(k + 1).
"""

from __future__ import annotations

import math
from typing import Any

import control
import numpy as np

from robustpolish.analysis import h2_norm, hinf_norm
from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.synthesis.problem.matrices import PlantMatrices


def measuring_states(plant: PlantMatrices) -> PlantMatrices:
    """Return the plant with y = x."""
    nx = plant.nx
    return plant.replace(C2=np.eye(nx), D21=np.zeros((nx, plant.nw)), D22=np.zeros((nx, plant.nu)))


def stabilises(plant: PlantMatrices, F: Matrix) -> bool:
    """Return whether all poles of the loop with u = F x are stable."""
    poles = np.linalg.eigvals(plant.A + plant.B2 @ F)
    return bool((np.abs(poles) < 1).all() if plant.discrete else (poles.real < 0).all())


def state_gain_norm(plant: PlantMatrices, F: Matrix | None, norm: str) -> float:
    """Return the norm from w to z that F achieves; infinite where the loop is unstable."""
    p = plant
    if F is None or not np.isfinite(F).all() or not stabilises(p, F):
        return math.inf
    if not p.B1.size or not p.C1.size:
        return 0.0
    dt = True if p.discrete else 0
    loop = control.StateSpace(p.A + p.B2 @ F, p.B1, p.C1 + p.D12 @ F, p.D11, dt)
    return float(hinf_norm(loop) if norm == "hinf" else h2_norm(loop))


def is_regular(plant: PlantMatrices) -> bool:
    """Return whether every control has a price: D12 of full column rank, to rounding."""
    p = plant
    if p.nu == 0:
        return True
    if p.nz == 0:
        return False
    singular = np.linalg.svd(p.D12, compute_uv=False)
    if singular.size < p.nu:
        return False
    size = max(float(np.linalg.norm(p.C1, 2)), float(singular[0]))
    return bool(singular[-1] > 1e-11 * size)


def with_price(plant: PlantMatrices, price: float) -> PlantMatrices:
    """Append `price` times u to z, and a thousandth of it times x: no rank is missing then."""
    nx, nu, nw = plant.nx, plant.nu, plant.nw
    return plant.replace(
        C1=np.vstack([plant.C1, np.zeros((nu, nx)), 1e-3 * price * np.eye(nx)]),
        D11=np.vstack([plant.D11, np.zeros((nu + nx, nw))]),
        D12=np.vstack([plant.D12, price * np.eye(nu), np.zeros((nx, nu))]),
    )


def only_effort(plant: PlantMatrices, state_weight: float) -> PlantMatrices:
    """Return the problem of stabilising with little effort, whatever w and z are."""
    nx, nu = plant.nx, plant.nu
    return measuring_states(
        plant.replace(
            B1=np.eye(nx),
            C1=np.vstack([state_weight * np.eye(nx), np.zeros((nu, nx))]),
            D11=np.zeros((nx + nu, nx)),
            D12=np.vstack([np.zeros((nx, nu)), np.eye(nu)]),
        )
    )


def with_noise(plant: PlantMatrices, share: float) -> PlantMatrices:
    """Append a disturbance on every state, `share` times as large as those that are there."""
    nx = plant.nx
    size = share * (float(np.linalg.norm(plant.B1, 2)) if plant.B1.size else 1.0)
    return measuring_states(
        plant.replace(
            B1=np.hstack([plant.B1, size * np.eye(nx)]),
            D11=np.hstack([plant.D11, np.zeros((plant.nz, nx))]),
        )
    )


def compressed(plant: PlantMatrices) -> PlantMatrices:
    """Return the plant with as few performance outputs as give the same norms."""
    columns = np.hstack([plant.C1, plant.D11, plant.D12])
    if columns.shape[0] <= columns.shape[1]:
        return plant
    R: Any = np.linalg.qr(columns, mode="r")
    nx, nw = plant.nx, plant.nw
    return plant.replace(C1=R[:, :nx], D11=R[:, nx : nx + nw], D12=R[:, nx + nw :])


def in_states(plant: PlantMatrices, T: Matrix) -> PlantMatrices:
    """Return the plant for states x = T x_new, which are measured; F = F_new inv(T)."""
    return measuring_states(
        plant.replace(
            A=np.linalg.solve(T, plant.A @ T),
            B1=np.linalg.solve(T, plant.B1),
            B2=np.linalg.solve(T, plant.B2),
            C1=plant.C1 @ T,
        )
    )
