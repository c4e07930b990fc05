"""The peak of a loop's gain and a matrix that proves it, in long arithmetic where doubles fail."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import flint
import numpy as np

from robustpolish.deadline import look_at_the_clock
from robustpolish.exact import balls
from robustpolish.exact.balls import Ball
from robustpolish.exact.realisation import size
from robustpolish.synthesis.certificate.loop_balls import BITS, LoopBalls

_STEPS = 12
_TOLERANCE = 1e-5
# Eigenvalues of the Hamiltonian nearer to the axis than this, relative, count as crossings: the
# bits resolve far less, and a peak as narrow as double precision can hold keeps farther away.
_ON_AXIS = 1e-28
# Seconds that eigenvalues of a matrix with one row take; they grow with the cube.
_EIGENVALUES = 2e-6
# Each step of the doubling algorithm looks twice as far ahead: it takes as many as the ratio of
# fastest and slowest rate has bits, and more where the bound is near the norm and for the accuracy.
_MORE_STEPS = 20


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
    return max(((loop.gain_at(x), x) for x in frequencies), default=(0.0, 0.0))


def _crossings(loop: LoopBalls, gamma: float) -> list[float]:
    """Return the frequencies at which a singular value equals gamma, ascending."""
    g = flint.arb(gamma)
    A, R, Q = replace(loop, B=loop.B / g, D=loop.D / g).riccati_terms()
    hamiltonian = balls.block([[A, R], [-Q, -A.transpose()]])
    look_at_the_clock(_EIGENVALUES * hamiltonian.nrows() ** 3)
    values = flint.acb_mat(hamiltonian.mid()).eig(algorithm="approx")
    near = [value for value in values if abs(value.real.mid()) <= abs(value).mid() * _ON_AXIS]
    return sorted({abs(float(value.imag.mid())) for value in near})


def precise_candidate(loop: LoopBalls) -> Ball | None:
    """Solve the bounded-real Riccati equation, where a tiny shift of the poles will do.

    Midpoints of balls serve as long floating-point numbers in the structure-preserving doubling
    algorithm (Chu, Fan, Lin, Linear Algebra Appl. 396, 2005, 55-80).

    Returns
    -------
    flint.arb_mat or None
        None where it does not converge: the norm is not below one, or the bits are too few.
    """
    n = loop.A.nrows()
    poles: Any = np.linalg.eigvals(balls.midpoint(loop.A))
    slowest, fastest = float(np.abs(poles).min()), float(np.abs(poles).max())
    if not slowest > 0:
        return None
    damping = max(-float(poles.real.max()), 1e-15 * slowest)
    shift = slowest * 2.0 ** (-flint.ctx.prec // 3)
    A, R, Q = (M.mid() for M in loop.riccati_terms(shift, loop.output_size))
    one, rate = balls.identity(n), flint.arb(math.sqrt(slowest * fastest))
    try:
        resolvent = (A - one * rate).inv().mid()
        core = (A - one * rate - R * resolvent.transpose() * Q).mid().inv().mid()
        E = one + core * (rate * 2)
        R = (resolvent * R * core.transpose() * (rate * 2)).mid()
        Q = (core.transpose() * Q * resolvent * (rate * 2)).mid()
        for _ in range(math.ceil(math.log2(fastest / damping)) + _MORE_STEPS):
            look_at_the_clock()
            W = (one - R * Q).mid().inv().mid()
            EW = (E * W).mid()
            more = (E.transpose() * Q * (W * E)).mid()
            R, Q, E = (R + EW * R * E.transpose()).mid(), (Q + more).mid(), (EW * E).mid()
            change, now = (size(balls.midpoint(M)) for M in (more, Q))
            if not now < math.inf:
                return None
            if change <= 1e-60 * now:
                return balls.symmetric(Q).mid()
    except ZeroDivisionError:
        pass
    return None
