"""A plant closed with a constant matrix K, and how gradients travel back to K."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

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
        return self.modes[0]

    @cached_property
    def modes(self) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Eigenvalues and eigenvectors of the closed loop."""
        values, vectors = np.linalg.eig(self.A)
        return np.asarray(values, complex), np.asarray(vectors, complex)

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
    left, right = np.eye(len(K)) - K @ plant.D22, np.eye(K.shape[1]) - plant.D22 @ K
    # Both are singular for the same K, but rounding may show it in one of them only.
    for end in (left, right):
        if not np.isfinite(end).all() or np.linalg.cond(end) > 1 / np.finfo(float).eps:
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
    eye, none = np.eye(order), np.zeros((order, order))
    more_x = np.zeros((loop.nx, order))
    return loop.replace(
        A=block_diag(loop.A, none),
        B1=np.pad(loop.B1, ((0, order), (0, 0))),
        B2=np.block([[more_x, loop.B2], [eye, np.zeros((order, loop.nu))]]),
        C1=np.pad(loop.C1, ((0, 0), (0, order))),
        C2=np.block([[more_x.T, eye], [loop.C2, np.zeros((loop.ny, order))]]),
        D12=np.pad(loop.D12, ((0, 0), (order, 0))),
        D21=np.pad(loop.D21, ((order, 0), (0, 0))),
        D22=block_diag(none, loop.D22) if loop.D22.size else np.zeros((0, 0)),
    )


def controller_loop(order: int, left: Matrix, right: Matrix, discrete: bool) -> PlantMatrices:
    """Return the loop whose closed form is left K(s) right, for measuring a controller itself.

    K = [[Ak, Bk], [Ck, Dk]] is closed around `order` integrators (delays) alone.
    """
    (rows, nu), (ny, columns) = left.shape, right.shape
    nothing = np.zeros
    gain = PlantMatrices(
        A=nothing((0, 0)),
        B1=nothing((0, columns)),
        B2=nothing((0, nu)),
        C1=nothing((rows, 0)),
        C2=nothing((ny, 0)),
        D11=nothing((rows, columns)),
        D12=left,
        D21=right,
        D22=nothing((ny, nu)),
        discrete=discrete,
    )
    return augmented(gain, order)
