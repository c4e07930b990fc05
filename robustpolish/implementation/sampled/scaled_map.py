"""A period in coordinates that suit doubles: states of the flow and at the samples, rescaled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from robustpolish.arrays import Matrix, Vector
from robustpolish.implementation.sampled.period_map import PeriodMap, Phase


@dataclass(frozen=True, eq=False)
class ScaledMap:
    """A period map with zeta = flow * zeta', s = sample * s'; all factors are powers of two.

    Attributes
    ----------
    map : PeriodMap
        In its own coordinates, which proofs start from.
    flow, sample : ndarray
        Factors.
    phases : tuple of Phase
    L, N, M : ndarray
        zeta(0) = L s, s+ = N s + M zeta(h), in the new coordinates.
    """

    map: PeriodMap
    flow: Vector
    sample: Vector
    phases: tuple[Phase, ...]
    L: Matrix
    N: Matrix
    M: Matrix

    def transition(self) -> Matrix:
        """Return the matrix from s[k] to s[k+1] without disturbance."""
        through = np.eye(self.flow.size)
        for phase in self.phases:
            through = linalg.expm(phase.A * phase.length) @ through
        return self.N + self.M @ through @ self.L


def scaled(found: PeriodMap) -> ScaledMap:
    """Choose coordinates in which flow, inputs and outputs are alike in size.

    Parameters
    ----------
    found : PeriodMap

    Returns
    -------
    ScaledMap
    """
    h = found.period
    parts = [np.zeros_like(found.phases[0].A), 0.0, 0.0]
    for phase in found.phases:
        parts[0] = np.maximum(parts[0], np.abs(phase.A) * h)
        parts[1] = np.maximum(parts[1], np.linalg.norm(phase.B, axis=1) * np.sqrt(h))
        parts[2] = np.maximum(parts[2], np.linalg.norm(phase.C, axis=0) * np.sqrt(h))
    flow = border_scale(*parts)
    phases = tuple(
        Phase(p.length, p.A * flow / flow[:, None], p.B / flow[:, None], p.C * flow, p.D)
        for p in found.phases
    )
    L, N = found.connected()
    L, M = L / flow[:, None], found.M * flow
    # What a state at a sample means: how it starts the flow, and how the flow and it come back.
    back = np.abs(N) + np.abs(M) @ np.abs(L)
    sample = border_scale(back, np.abs(M).max(axis=1), np.abs(L).max(axis=0))
    return ScaledMap(
        found,
        flow,
        sample,
        phases,
        L * sample,
        N * sample / sample[:, None],
        M / sample[:, None],
    )


def border_scale(A: Matrix, reach: Vector, seen: Vector) -> Vector:
    """Return powers of two that balance A with all inputs and all outputs as one more state.

    Parameters
    ----------
    A : ndarray, shape (n, n)
    reach, seen : ndarray, shape (n,)
        Sizes of the rows of B and of the columns of C.

    Returns
    -------
    ndarray, shape (n,)
    """
    n = A.shape[0]
    size = np.zeros((n + 1, n + 1))
    size[:n, :n], size[:n, n], size[n, :n] = np.abs(A), reach, seen
    if not n or not np.isfinite(size).all():
        return np.ones(n)
    # SciPy casts permutation indices that were never set, and may complain about their values.
    with np.errstate(invalid="ignore"):
        _, (scale, _) = linalg.matrix_balance(size, permute=False, separate=True)
    found = np.asarray(scale, dtype=float)
    return found[:n] / found[n]
