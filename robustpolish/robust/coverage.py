"""An upper bound of the structured singular value that holds between all frequencies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import flint
import numpy as np

from robustpolish.base.arrays import AnyMatrix, Vector
from robustpolish.base.budget import check_deadline
from robustpolish.linear.arithmetic.balls import Ball, complex_ball, precision
from robustpolish.linear.arithmetic.realisation import Realisation
from robustpolish.linear.proofs.bounded_real import (
    BallSystem,
    adjoint,
    hamiltonian,
    interval_without_eigenvalues,
    riccati_terms,
)
from robustpolish.linear.proofs.definite import is_definite
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.scalings import (
    Inequality,
    ScaledBound,
    Space,
    at,
    initial_scalings,
    reduce_level,
)

# What constant scalings prove, in ball arithmetic: at a matrix, and over a range of frequencies.
#
# With constant D and G the inequality holds at one frequency and fails nowhere around it before it
# gets singular, and it is singular at a frequency just if the Hamiltonian matrix has an eigenvalue
# there on the imaginary axis [1]_. Discs that hold all eigenvalues tell how far that is.
#
# References
# ----------
# .. [1] G. Ferreres, J.-F. Magni, J.-M. Biannic, "Robustness analysis of flexible structures:
#    practical algorithms", International Journal of Robust and Nonlinear Control 13 (2003) 715-733.

_BITS = 160


@dataclass(frozen=True, eq=False)
class BallScalings:
    """Scalings as balls: Dz, G, and beta^2 Dw with the blocks of fixed size as they are."""

    Dz: Ball
    G: Ball
    E: Ball

    @classmethod
    def of(cls, space: Space, x: Vector, level: float) -> BallScalings | None:
        """Return the scalings at a level beta, None if a D is not proven to be positive."""
        # Exactly Hermitian, so that they commute with Delta without rounding.
        Dz, still, scaled, G = (
            M if M.shape[0] != M.shape[1] else (M + np.conj(M.T)) / 2 for M in space.matrices(x)
        )
        with precision(_BITS):
            square = flint.acb(flint.arb(level) ** 2)
            E = complex_ball(still) + complex_ball(scaled) * square
            if not (is_definite(complex_ball(Dz)) and is_definite(complex_ball(still + scaled))):
                return None
        return cls(complex_ball(Dz), complex_ball(G), E)


def proves_inequality(M: Ball, weights: BallScalings) -> bool:
    """Prove the inequality at a matrix."""
    turned = weights.G * M * flint.acb(0, 1)
    return is_definite(weights.E - adjoint(M) * weights.Dz * M - turned - adjoint(turned))


def proven_interval(
    model: BallSystem, weights: BallScalings, omega: float
) -> tuple[float, float] | None:
    """Prove the inequality around a frequency, as far as it holds.

    Parameters
    ----------
    model : BallSystem
        Stable and continuous.
    weights : BallScalings
    omega : float
        In rad/s; infinity is allowed.

    Returns
    -------
    (low, high) or None
        It holds between, both included; None if it is not proven at `omega`.
    """
    with precision(_BITS):
        try:
            if not proves_inequality(model.response(omega), weights):
                return None
            if not model.A.nrows():
                return 0.0, math.inf
            A, B, C, D = map(flint.acb_mat, model)
            seen = adjoint(C) * weights.Dz
            turned = weights.G * D * flint.acb(0, 1)
            R = adjoint(D) * weights.Dz * D + turned + adjoint(turned) - weights.E
            S = adjoint(C) * (weights.Dz * D - adjoint(weights.G) * flint.acb(0, 1))
            H = hamiltonian(*riccati_terms(A, B, seen * C, S, R))
            return interval_without_eigenvalues(H, omega)
        except (ZeroDivisionError, ValueError, np.linalg.LinAlgError):
            return None


SLACK = 1e-3
"""What the level is above the largest one that was needed anywhere, relative.

That is the room that constant scalings have around the worst frequency. With half of the 0.2 % that
a bracket may be wide, the other half is left for the lower bound.
"""
_MOST = 600
"""Intervals before the bound is given up."""
# Width, relative to its frequency, of an interval that gets nowhere: the level is raised by this
# much, relative.
_NARROW, _RAISED = 1e-7, 1e-3


@dataclass(frozen=True, eq=False)
class Coverage:
    """A level that is proven over intervals of frequency.

    Attributes
    ----------
    level : float
        beta: no Delta with all sizes below 1 / beta makes the loop singular on the intervals.
    intervals : tuple of (float, float)
        In the units of the model, ascending.
    complete : bool
        Whether they cover the axis from 0 to infinity.
    peaks : tuple of (float, float, Level)
        Frequencies at which a level was needed, the level, and its scalings; the largest first.
    """

    level: float
    intervals: tuple[tuple[float, float], ...]
    complete: bool
    peaks: tuple[tuple[float, float, ScaledBound], ...]


def response(model: Realisation, omega: float) -> AnyMatrix:
    """Return M at a frequency, infinity included, in double precision.

    Raises
    ------
    numpy.linalg.LinAlgError
        If rounding sees a pole there.
    """
    D = model.D.astype(complex)
    if not model.states or not math.isfinite(omega):
        return D
    return D + model.C @ np.linalg.solve(1j * omega * np.eye(model.states) - model.A, model.B + 0j)


def cover(
    loop: LoopModel,
    space: Space,
    level: float,
    seeds: Sequence[float],
    slack: float = SLACK,
    most: int = _MOST,
) -> Coverage:
    """Lay intervals with constant scalings until they cover the axis.

    Parameters
    ----------
    loop : LoopModel
        Stable.
    space : Space
        What scalings there are.
    level : float
        A lower bound of the peak, or where else to begin; it is raised where it has to be.
    seeds : sequence of float
        Frequencies to look at first.
    slack : float, optional
        What the level has above what is needed: more of it makes longer intervals.
    most : int, optional
        Intervals before the bound is given up.

    Returns
    -------
    Coverage
    """
    level, exact = level * (1 + slack), BallSystem(*loop.balls)
    peaks: list[tuple[float, float, ScaledBound]] = []
    last: list[Vector] = []

    def scalings(omega: float) -> ScaledBound | None:
        """Return scalings that prove the level at a frequency, or raise the level.

        None where there are none, or where rounding sees a pole at the frequency.
        """
        nonlocal level, last
        try:
            inequality = Inequality(space, response(loop.model, omega)[None])
        except np.linalg.LinAlgError:
            return None
        others = [at(inequality, ScaledBound(0.0, x)) for x in last]
        start = min([initial_scalings(inequality), *others], key=lambda found: found.square)
        if not math.isfinite(start.square):
            return None
        found = reduce_level(inequality, start, level**2)
        if not found.level < level:
            peaks.append((omega, found.level, found))
            level = found.level * (1 + slack)
            found = reduce_level(inequality, found, level**2)
        last = [found.x, *last][:2]
        return found

    for omega in dict.fromkeys([0.0, math.inf, *seeds]):
        if scalings(omega) is None:
            return Coverage(math.inf, (), False, tuple(peaks))
    gaps, intervals = [(0.0, math.inf)], []
    for _ in range(most):
        if not gaps:
            break
        check_deadline()
        low, high = gaps.pop()
        omega = _inside(low, high, loop.rate)
        found = scalings(omega)
        if found is None or not math.isfinite(level):
            return Coverage(math.inf, (), False, tuple(peaks))
        weights = BallScalings.of(space, found.x, level)
        interval = weights and proven_interval(exact, weights, omega)
        if interval is None or interval[1] <= interval[0] * (1 + _NARROW):
            level *= 1 + _RAISED
            gaps.append((low, high))
            continue
        intervals.append(interval)
        if interval[0] > low:
            gaps.append((low, interval[0]))
        if interval[1] < high:
            gaps.append((interval[1], high))
    peaks.sort(key=lambda peak: -peak[1])
    return Coverage(level, tuple(sorted(intervals)), not gaps, tuple(peaks))


def _inside(low: float, high: float, rate: float) -> float:
    """Return a frequency of a gap: an end of the axis first, else the middle of logarithms."""
    if low == 0 and high == math.inf:
        return rate
    if high == math.inf:
        return math.inf
    if low == 0:
        return 0.0
    return math.sqrt(low) * math.sqrt(high)
