"""Plant and controller as bare arrays, for the inner loops of the searches."""

from __future__ import annotations

from typing import Any, NamedTuple

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.problem.balancing import balancing_scale

Matrix = NDArray[Any]


class PlantMatrices(NamedTuple):
    """A plant with D22 = 0, continuous unless `discrete` says otherwise."""

    A: Matrix
    B1: Matrix
    B2: Matrix
    C1: Matrix
    C2: Matrix
    D11: Matrix
    D12: Matrix
    D21: Matrix
    discrete: bool = False


class Controller(NamedTuple):
    """A controller x' = A x + B y, u = C x + D y."""

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix

    @property
    def gain(self) -> float:
        """Largest absolute entry: how hard the controller is to verify and to build."""
        return max(float(np.abs(M).max(initial=0.0)) for M in self)


class Loop(NamedTuple):
    """The closed loop from w to z."""

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix


def matrices(plant: GeneralizedPlant) -> PlantMatrices:
    """Return the matrices of `plant` without D22, which :func:`shift` accounts for."""
    return PlantMatrices(
        plant.A,
        plant.B1,
        plant.B2,
        plant.C1,
        plant.C2,
        plant.D11,
        plant.D12,
        plant.D21,
        plant.is_discrete,
    )


def close(plant: PlantMatrices, K: Controller) -> Loop:
    """Connect u = K y."""
    P = plant
    return Loop(
        np.block([[P.A + P.B2 @ K.D @ P.C2, P.B2 @ K.C], [K.B @ P.C2, K.A]]),
        np.vstack([P.B1 + P.B2 @ K.D @ P.D21, K.B @ P.D21]),
        np.hstack([P.C1 + P.D12 @ K.D @ P.C2, P.D12 @ K.C]),
        P.D11 + P.D12 @ K.D @ P.D21,
    )


def shift(K: Controller, D22: Matrix) -> Controller | None:
    """Return the controller for the plant with D22 that acts as K does on the one without.

    K sees y - D22 u. None if I + Dk D22 is singular to working accuracy.
    """
    if not D22.any() or not (K.C.any() or K.D.any()):
        return K
    loop = np.eye(K.D.shape[0]) + K.D @ D22
    unit = balancing_scale(loop)
    if np.linalg.cond(loop * unit / unit[:, None]) > 1e10:
        return None
    C, D = np.linalg.solve(loop, K.C), np.linalg.solve(loop, K.D)
    return Controller(K.A - K.B @ D22 @ C, K.B - K.B @ D22 @ D, C, D)


def balanced(K: Controller) -> Controller:
    """Balance the controller's states by powers of two, which rounds nothing."""
    n = K.A.shape[0]
    if n == 0:
        return K
    size = np.zeros((n + 1, n + 1))
    size[:n, :n] = np.abs(K.A)
    size[:n, n] = np.abs(K.B).max(axis=1, initial=0.0)
    size[n, :n] = np.abs(K.C).max(axis=0, initial=0.0)
    scale = balancing_scale(size)
    t = scale[:n] / scale[n]
    return Controller(K.A * t / t[:, None], K.B / t[:, None], K.C * t, K.D)


def as_system(K: Controller, dt: float | bool = 0) -> control.StateSpace:
    """Return the controller as a system."""
    return control.StateSpace(K.A, K.B, K.C, K.D, dt)
