"""The H-infinity norm of a loop, all its peaks, and their gradients over K."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.long_calls import step_cost
from robustpolish.synthesis.nonsmooth.loop_response import LoopResponse
from robustpolish.synthesis.nonsmooth.peaks import highest_peak, local_peaks
from robustpolish.synthesis.nonsmooth.problem import ActivePiece
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.static_loop import close_static


@dataclass(frozen=True, eq=False)
class HinfMeasure:
    """Largest singular value over frequency of the channel w to z of a loop.

    Frequencies are those of the loop: rad/s, or rad per sample in discrete time; infinity
    stands for the feedthrough in continuous time.
    """

    loop: PlantMatrices
    # The last peaks are good guesses for the next.
    _recent: list[float] = field(default_factory=list, init=False, repr=False)

    @property
    def work(self) -> float:
        """Work of one evaluation, as measured: states make modes and level sets, signals values."""
        signals = min(self.loop.nw, self.loop.nz)
        return step_cost(round(1.2 * self.loop.nx)) * (1 + signals / 20)

    def pieces(self, K: Matrix, width: float, frequencies: Sequence[float]) -> list[ActivePiece]:
        """Return the active peaks; nothing if the loop is not stable."""
        closed = close_static(self.loop, K)
        if closed is None or not closed.stable:
            return []
        response = LoopResponse(closed)
        known = [w for w in (*frequencies, *self._recent) if np.isfinite(w)]
        norm, peak = highest_peak(response, known)
        self._recent[:] = [peak, *self._recent[:2]]
        if norm == 0:
            return [ActivePiece(0.0, np.zeros_like(K), peak)]
        peaks = [peak]
        if width > 0:
            peaks = _distinct([peak, *local_peaks(response, norm * (1 - width)), *frequencies])
        pieces = [p for w in peaks for p in self._at(response, w, norm * (1 - width))]
        return sorted(pieces, key=lambda piece: -piece.value)

    def _at(self, response: LoopResponse, frequency: float, level: float) -> list[ActivePiece]:
        """Return one piece for each singular value above `level` at one frequency."""
        closed, loop = response.closed, self.loop
        if np.isinf(frequency):
            left, right, value = loop.D12, loop.D21, closed.D
        else:
            pencil = response.point(frequency) * np.eye(len(closed.A)) - closed.A
            into = np.linalg.solve(pencil, closed.B)
            outof = np.linalg.solve(pencil.T, closed.C.T).T
            value = closed.C @ into + closed.D
            left = outof @ loop.B2 + loop.D12
            right = loop.C2 @ into + loop.D21
        if not np.isfinite(value).all():  # beyond doubles there are no directions
            return []
        U, sigma, Vh = np.linalg.svd(value, full_matrices=False)
        count = max(1, int(np.sum(sigma >= level)))
        found = []
        for i in range(count):
            slope = np.real(np.outer(U[:, i].conj() @ left, right @ Vh[i].conj()))
            found.append(ActivePiece(float(sigma[i]), closed.back(slope), frequency))
        return found


def _distinct(frequencies: Sequence[float]) -> list[float]:
    """Drop frequencies that repeat an earlier one within a millionth."""
    kept: list[float] = []
    for w in frequencies:
        if not any(w == k or abs(w - k) <= 1e-6 * abs(k) for k in kept):
            kept.append(w)
    return kept
