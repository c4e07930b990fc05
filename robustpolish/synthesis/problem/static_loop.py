"""A plant closed with a constant matrix K, and how gradients travel back to K."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.synthesis.problem.matrices import PlantMatrices


@dataclass(frozen=True, eq=False)
class StaticLoop:
    """The loop from w to z for one K."""

    plant: PlantMatrices
    K: Matrix
    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    left: Matrix | None
    right: Matrix | None

    @cached_property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of the closed loop."""
        return np.asarray(np.linalg.eigvals(self.A), complex)

    @property
    def stable(self) -> bool:
        """Whether all poles are inside, by more than rounding errors of the eigenvalues."""
        if not np.isfinite(self.A).all():
            return False
        if self.A.size == 0:
            return True
        blur = 10 * np.finfo(float).eps * float(np.linalg.norm(self.A, 2))
        if self.plant.discrete:
            return bool(np.max(np.abs(self.poles)) < 1 - blur)
        return bool(np.max(self.poles.real) < -blur)

    def back(self, gradient: Matrix) -> Matrix:
        """Turn a gradient over T = K (I - D22 K)^-1 into one over K."""
        if self.left is None or self.right is None:
            return gradient
        return self.left.T @ gradient @ self.right.T


def close_static(plant: PlantMatrices, K: Matrix) -> StaticLoop | None:
    """Connect u = K y with a constant K; None if the loop is not well posed."""
    if not plant.has_d22:
        return _closed(plant, K, K, None, None)
    left = np.eye(len(K)) - K @ plant.D22
    right = np.eye(K.shape[1]) - plant.D22 @ K
    if not np.isfinite(left).all() or np.linalg.cond(left) > 1 / np.finfo(float).eps:
        return None
    T = np.linalg.solve(left, K)
    return _closed(plant, K, T, np.linalg.inv(left), np.linalg.inv(right))


def _closed(
    plant: PlantMatrices, K: Matrix, T: Matrix, left: Matrix | None, right: Matrix | None
) -> StaticLoop:
    B2T, D12T = plant.B2 @ T, plant.D12 @ T
    return StaticLoop(
        plant,
        K,
        plant.A + B2T @ plant.C2,
        plant.B1 + B2T @ plant.D21,
        plant.C1 + D12T @ plant.C2,
        plant.D11 + D12T @ plant.D21,
        left,
        right,
    )


def augmented(loop: PlantMatrices, order: int) -> PlantMatrices:
    """Add `order` integrators (delays), so that a static K holds a dynamic controller.

    The static gain of the augmented plant is [[Ak, Bk], [Ck, Dk]]: its inputs are
    (xk, y), its outputs (xk', u). El Ghaoui, Oustry, AitRami (1997), section II.
    """
    if order == 0:
        return loop
    nx, nu, ny = len(loop.A), loop.B2.shape[1], len(loop.C2)
    nw, nz = loop.B1.shape[1], len(loop.C1)
    eye = np.eye(order)

    def diagonal(a: Matrix, b: Matrix) -> Matrix:
        rows, columns = a.shape[0] + b.shape[0], a.shape[1] + b.shape[1]
        joined = np.zeros((rows, columns))
        joined[: a.shape[0], : a.shape[1]] = a
        joined[a.shape[0] :, a.shape[1] :] = b
        return joined

    none = np.zeros((0, 0))
    swap_in = np.block(
        [[np.zeros((nx, order)), loop.B2], [eye, np.zeros((order, nu))]],
    )
    swap_out = np.block(
        [[np.zeros((order, nx)), eye], [loop.C2, np.zeros((ny, order))]],
    )
    return PlantMatrices(
        A=diagonal(loop.A, np.zeros((order, order))),
        B1=np.vstack([loop.B1, np.zeros((order, nw))]),
        B2=swap_in,
        C1=np.hstack([loop.C1, np.zeros((nz, order))]),
        C2=swap_out,
        D11=loop.D11,
        D12=np.hstack([np.zeros((nz, order)), loop.D12]),
        D21=np.vstack([np.zeros((order, nw)), loop.D21]),
        D22=diagonal(np.zeros((order, order)), loop.D22) if loop.D22.size else none,
        discrete=loop.discrete,
    )


def controller_loop(order: int, left: Matrix, right: Matrix, discrete: bool) -> PlantMatrices:
    """Return the loop whose closed form is left K(s) right, for measuring a controller itself.

    K = [[Ak, Bk], [Ck, Dk]] is closed around `order` integrators (delays) alone.
    """
    nu, ny = left.shape[1], right.shape[0]
    rows, columns = left.shape[0], right.shape[1]
    eye, nothing = np.eye(order), np.zeros
    return PlantMatrices(
        A=nothing((order, order)),
        B1=nothing((order, columns)),
        B2=np.hstack([eye, nothing((order, nu))]),
        C1=nothing((rows, order)),
        C2=np.vstack([eye, nothing((ny, order))]),
        D11=nothing((rows, columns)),
        D12=np.hstack([nothing((rows, order)), left]),
        D21=np.vstack([nothing((order, columns)), right]),
        D22=nothing((order + ny, order + nu)),
        discrete=discrete,
    )
