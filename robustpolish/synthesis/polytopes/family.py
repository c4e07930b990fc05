"""How Lyapunov matrices depend on the vertex: one for all, one for each, or affine in numbers."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix


@dataclass(frozen=True, eq=False)
class LyapunovFamily:
    """P at vertex i is the sum of ``shares[i, k] P_k``; its derivatives are sums over ``drifts``.

    Attributes
    ----------
    shares : ndarray, shape (vertices, K)
        Affine functions of the point of the polytope, at its vertices.
    drifts : ndarray, shape (m, K)
        Extreme rates of change of the shares; of convex combinations of these the derivative is
        made. A single row of zeros where nothing changes with time.
    """

    shares: Matrix
    drifts: Matrix

    @classmethod
    def common(cls, vertices: int) -> LyapunovFamily:
        """Return one matrix for all: it holds however fast the plant moves in the polytope."""
        return cls(np.ones((vertices, 1)), np.zeros((1, 1)))

    @classmethod
    def one_each(cls, vertices: int) -> LyapunovFamily:
        """Return a matrix for each vertex: for plants that do not change with time."""
        return cls(np.eye(vertices), np.zeros((1, vertices)))

    @classmethod
    def affine(cls, positions: Matrix, rates: Sequence[float]) -> LyapunovFamily:
        """Return matrices that are affine in numbers whose rates of change are bounded.

        Parameters
        ----------
        positions : ndarray, shape (vertices, m)
            The numbers at the vertices, as -1 and 1.
        rates : sequence of float
            Largest change per unit of time, in the same units; infinite for a number on which the
            matrices must not depend.
        """
        slow = [i for i, rate in enumerate(rates) if math.isfinite(rate)]
        shares = np.hstack([np.ones((len(positions), 1)), positions[:, slow]])
        corners = itertools.product(*[sorted({-rates[i], rates[i]}) for i in slow])
        drifts = np.array([[0.0, *corner] for corner in corners])
        return cls(shares, drifts)

    @property
    def size(self) -> int:
        """How many matrices there are."""
        return self.shares.shape[1]

    @property
    def is_common(self) -> bool:
        """Whether there is but one."""
        return self.size == 1


def combined(weights: Matrix, matrices: Sequence[Any]) -> Any:
    """Return the sum of ``weights[k] * matrices[k]``, of any kind that adds and multiplies."""
    terms = [matrix * float(w) for w, matrix in zip(weights, matrices, strict=True) if w]
    if not terms:
        return matrices[0] * 0.0
    result = terms[0]
    for term in terms[1:]:
        result = result + term
    return result
