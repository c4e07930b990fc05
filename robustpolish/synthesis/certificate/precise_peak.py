"""The peak of an enclosed loop's gain in long arithmetic, for norms that doubles cannot settle."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise

import flint
import numpy as np

from robustpolish.exact import balls
from robustpolish.synthesis.certificate.loop_balls import BITS, LoopBalls
from robustpolish.synthesis.certificate.proof_candidates import riccati_terms

_STEPS = 12
_TOLERANCE = 1e-5
# Eigenvalues of the Hamiltonian nearer to the axis than this, relative, count as crossings: the
# bits resolve far less, and a peak as narrow as double precision can hold keeps farther away.
_ON_AXIS = 1e-28


def precise_peak(loop: LoopBalls, start: float) -> tuple[float, float]:
    """Climb to the largest gain of a stable continuous-time loop, without rounding it.

    The two-step iteration of Bruinsma and Steinbuch (Systems & Control Letters 14, 1990, 287-293).

    Parameters
    ----------
    loop : LoopBalls
    start : float
        A frequency to start from, rad/s; may be infinite.

    Returns
    -------
    gain, frequency : float
        The gain that the loop has at this frequency, a lower bound of its norm and as a rule
        within 1e-5 of it. An upper bound takes a proof.
    """
    with balls.precision(BITS):
        gain, where = _highest(loop, {0.0, math.inf, start})
        for _ in range(_STEPS):
            if not 0 < gain < math.inf:
                break
            found = _crossings(loop, gain * (1 + _TOLERANCE))
            higher, there = _highest(loop, {(a + b) / 2 for a, b in pairwise(found)} | set(found))
            if higher <= gain * (1 + _TOLERANCE):
                break
            gain, where = higher, there
    return gain, where


def _highest(loop: LoopBalls, frequencies: Iterable[float]) -> tuple[float, float]:
    return max(((gain_at(loop, x), x) for x in frequencies), default=(0.0, 0.0))


def gain_at(loop: LoopBalls, frequency: float) -> float:
    """Return the largest singular value at a frequency in rad/s, with the bits in force."""
    A, B, C, D = (flint.acb_mat(M) for M in (loop.A, loop.B, loop.C, loop.D))
    response = D
    if math.isfinite(frequency) and A.nrows():
        resolvent = -A
        for i in range(A.nrows()):
            resolvent[i, i] += flint.acb(0, frequency)
        try:
            response = D + C * resolvent.solve(B)
        except ZeroDivisionError:
            return math.inf
    return float(np.linalg.norm(balls.midpoint(response), 2))


def _crossings(loop: LoopBalls, gamma: float) -> list[float]:
    """Return the frequencies at which a singular value equals gamma, ascending."""
    g = flint.arb(gamma)
    A, R, Q = riccati_terms(replace(loop, B=loop.B / g, D=loop.D / g))
    hamiltonian = balls.block([[A, R], [-Q, -A.transpose()]])
    values = flint.acb_mat(hamiltonian.mid()).eig(algorithm="approx")
    near = [value for value in values if abs(value.real.mid()) <= abs(value).mid() * _ON_AXIS]
    return sorted({abs(float(value.imag.mid())) for value in near})
