"""A loop at many frequencies at once, and how gradients travel from there back to K."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import schur

from robustpolish.arrays import AnyArray, Vector
from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.synthesis.problem.static_loop import StaticLoop


@dataclass(frozen=True, eq=False)
class LoopResponses:
    """M of a loop at frequencies, with what a change of K does to it: dM = left dT right.

    Attributes
    ----------
    M : ndarray of complex, shape (k, nz, nw)
    left, right : ndarray of complex
        From a change of T = K (I - D22 K)^-1 to M.
    loop : StaticLoop
    """

    M: AnyArray
    left: AnyArray
    right: AnyArray
    loop: StaticLoop

    @classmethod
    def of(cls, loop: StaticLoop, omega: Vector) -> LoopResponses:
        """Return the responses of a loop; frequencies may be infinite."""
        plant = loop.plant
        found: Any = schur(loop.A, output="complex") if len(loop.A) else (loop.A, loop.A)
        triangle, Q = found
        star = np.conj(Q.T)
        inverse = _inverses(np.diag(triangle), omega)
        # From w and K's outputs to states, from states to z: triangular systems, all at once.
        states = _from_below(triangle, inverse, star @ np.hstack([loop.B, plant.B2]))
        nw = loop.B.shape[1]
        moved = np.einsum("ij,kjl->kil", np.vstack([loop.C, plant.C2]) @ Q, states)
        nz = loop.C.shape[0]
        M = loop.D + moved[:, :nz, :nw]
        left = plant.D12 + moved[:, :nz, nw:]
        right = plant.D21 + moved[:, nz:, :nw]
        return cls(M, left, right, loop)

    def back(self, gradient: AnyArray) -> Matrix:
        """Return the gradient over K of sum Re tr(gradient_k dM_k), gradients (k, nw, nz)."""
        on_T = np.einsum("kwz,kzi,kjw->ij", gradient, self.left, self.right, optimize=True)
        return self.loop.back(np.real(on_T))


def _inverses(poles: AnyArray, omega: Vector) -> AnyArray:
    """Return 1 / (j omega - pole), shape (n, k); 0 at infinity."""
    finite = np.isfinite(omega)
    found = np.zeros((len(poles), len(omega)), complex)
    found[:, finite] = 1 / (1j * omega[finite][None, :] - poles[:, None])
    return found


def _from_below(triangle: AnyArray, inverse: AnyArray, B: AnyArray) -> AnyArray:
    """Solve (j omega - T) X = B for an upper triangular T, shape (k, n, m)."""
    n, k = inverse.shape
    m = B.shape[1]
    X = np.zeros((n, k * m), complex)
    for i in range(n - 1, -1, -1):
        row = triangle[i, i + 1 :] @ X[i + 1 :]
        X[i] = ((row.reshape(k, m) + B[i]) * inverse[i][:, None]).ravel()
    return np.ascontiguousarray(X.reshape(n, k, m).transpose(1, 0, 2))
