"""The H2 norm of a loop and its gradient over K."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_continuous_lyapunov, solve_discrete_lyapunov

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.long_calls import step_cost
from robustpolish.synthesis.nonsmooth.problem import ActivePiece
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.static_loop import close_static


@dataclass(frozen=True, eq=False)
class H2Measure:
    """H2 norm of the channel w to z; infinite with a feedthrough in continuous time.

    The gradient is that of Rautert and Sachs (1997): with P and Q the Gramians of the loop,
    the derivative of trace(C P C') over K is 2 ((B2' Q A + D12' C) P C2' + (B2' Q B + D12' D) D21')
    with A left out in continuous time.
    """

    loop: PlantMatrices

    @property
    def work(self) -> float:
        """Work of one evaluation: two Lyapunov equations, quicker than level sets."""
        return 0.5 * step_cost(self.loop.nx)

    def pieces(self, K: Matrix, width: float, frequencies: Sequence[float]) -> list[ActivePiece]:
        """Return the one piece; nothing if the loop is not stable or the norm infinite."""
        closed = close_static(self.loop, K)
        if closed is None or not closed.stable:
            return []
        A, B, C, D = closed.A, closed.B, closed.C, closed.D
        if not self.loop.discrete and self._has_feedthrough(K, D):
            return []
        solve = solve_discrete_lyapunov if self.loop.discrete else solve_continuous_lyapunov
        sign = 1.0 if self.loop.discrete else -1.0
        try:
            P = np.asarray(solve(A, sign * B @ B.T))
            Q = np.asarray(solve(A.T, sign * C.T @ C))
        except np.linalg.LinAlgError:
            return []
        square = float(np.trace(C @ P @ C.T))
        if self.loop.discrete:
            square += float(np.sum(D**2))
        if not np.isfinite(square) or square < 0:
            return []
        norm = np.sqrt(square)
        loop = self.loop
        forward = A if loop.discrete else np.eye(len(A))
        on_state = (loop.B2.T @ Q @ forward + loop.D12.T @ C) @ P @ loop.C2.T
        direct = loop.D12.T @ D if loop.discrete else 0.0
        on_noise = (loop.B2.T @ Q @ B + direct) @ loop.D21.T
        slope = (on_state + on_noise) / norm if norm > 0 else np.zeros_like(K)
        return [ActivePiece(norm, closed.back(slope))]

    def _has_feedthrough(self, K: Matrix, D: Matrix) -> bool:
        """Whether D is more than what rounding leaves of its terms."""
        loop = self.loop
        terms = np.abs(loop.D11) + np.abs(loop.D12) @ np.abs(K) @ np.abs(loop.D21)
        return bool((np.abs(D) > 1e-12 * terms).any())
