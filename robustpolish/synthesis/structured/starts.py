"""Where descents start: proposals that several structures share."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import AnyVector as Vector
from robustpolish.base.budget import Budget
from robustpolish.synthesis.lmi.program import ProgramSolver, stabilising_gain
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.structured.search import POLICY


@dataclass(frozen=True, eq=False)
class KnownStarts:
    """Points that need no search: the user's, or those at rest."""

    points: Sequence[Vector]

    def propose(
        self, earlier: Sequence[Vector], budget: Budget, rng: np.random.Generator
    ) -> Iterator[Vector]:
        """Propose them in their order."""
        yield from self.points


@dataclass(frozen=True, eq=False)
class DrawnStarts:
    """Random changes of what was proposed before, without an end.

    Attributes
    ----------
    low, high : float
        Decimal logarithms of the smallest and the largest change.
    relative : bool
        Whether a free number changes in proportion to itself.
    base : ndarray or None
        The only point to change; else any of the earlier ones.
    """

    low: float
    high: float
    relative: bool = True
    base: Vector | None = None

    def propose(
        self, earlier: Sequence[Vector], budget: Budget, rng: np.random.Generator
    ) -> Iterator[Vector]:
        """Propose changes of a size drawn anew each time."""
        bases = list(earlier) if self.base is None else [self.base]
        while True:
            point = bases[int(rng.integers(len(bases)))]
            size = 10 ** rng.uniform(self.low, self.high)
            unit = np.abs(point) + 0.1 if self.relative else 1.0
            yield point + size * unit * rng.normal(size=point.size)


@dataclass(frozen=True, eq=False)
class StabilisingStart:
    """A gain that stabilises, by cone complementarity, where descent alone may find none.

    Attributes
    ----------
    loop : PlantMatrices
        Scaled.
    mask : ndarray of bool
        Free entries of K.
    coordinates : callable
        From K to the free numbers.
    """

    loop: PlantMatrices
    mask: NDArray[np.bool_]
    coordinates: Callable[[Matrix], Vector]

    def propose(
        self, earlier: Sequence[Vector], budget: Budget, rng: np.random.Generator
    ) -> Iterator[Vector]:
        """Propose the one gain, unless the programs are too large."""
        if self.loop.nx > POLICY.stabilising_states:
            return
        solver = ProgramSolver("cvxpy", None, budget.share(POLICY.start_share), accuracy=1e-7)
        # Decay rate asked of a stabilising gain, relative to the plant's size.
        # Most semidefinite programs on the way to a stabilising gain.
        gain = stabilising_gain(self.loop, self.mask, solver, 1e-3, 15)
        if gain is not None:
            yield self.coordinates(gain)


@dataclass(frozen=True, eq=False)
class RegulatorStart:
    """The gain of the pattern that is nearest to a linear-quadratic state feedback."""

    loop: PlantMatrices
    mask: NDArray[np.bool_]
    coordinates: Callable[[Matrix], Vector]

    def propose(
        self, earlier: Sequence[Vector], budget: Budget, rng: np.random.Generator
    ) -> Iterator[Vector]:
        """Propose the one gain, if the Riccati equation has a solution."""
        loop = self.loop
        weights = np.eye(loop.nx), np.eye(loop.nu), np.zeros((loop.nx, loop.nu))
        F = regulator(loop.A, loop.B2, *weights, loop.discrete)
        if F is not None:
            yield self.coordinates(np.where(self.mask, F @ np.linalg.pinv(loop.C2), 0.0))


def regulator(
    A: Matrix, B: Matrix, Q: Matrix, R: Matrix, S: Matrix, discrete: bool
) -> Matrix | None:
    """Return the F of u = F x that minimises the sum of x'Qx + u'Ru + 2 x'Su; None if none does."""
    solve: Any = linalg.solve_discrete_are if discrete else linalg.solve_continuous_are
    try:
        with warnings.catch_warnings():
            # SciPy's balancing warns about extreme scales; what it returns is only a start.
            warnings.simplefilter("ignore", RuntimeWarning)
            X = solve(A, B, Q, R, s=S)
        if discrete:
            F = -np.linalg.solve(R + B.T @ X @ B, B.T @ X @ A + S.T)
        else:
            F = -np.linalg.solve(R, B.T @ X + S.T)
    except (np.linalg.LinAlgError, ValueError):
        return None
    return F if np.isfinite(F).all() else None
