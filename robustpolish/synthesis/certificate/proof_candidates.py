"""Matrices that should prove a norm, found in doubles or, for high gains, in high precision.

What makes P strict is a small shift of all poles to the right: the equation for A + alpha I leaves
-2 alpha P, a margin in proportion to P. Solving again in the coordinates where P was found to be
the identity makes that margin visible in doubles however ill-conditioned P is in the given ones.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import flint
import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.exact import balls
from robustpolish.exact.balls import Ball
from robustpolish.exact.realisation import size
from robustpolish.synthesis.certificate.loop_balls import LoopBalls
from robustpolish.synthesis.riccati.equations import solve_lyapunov, solve_riccati

_PASSES = 3
_LARGE = 60
# Each step of the doubling algorithm looks twice as far ahead: it takes as many as the ratio of
# fastest and slowest rate has bits, and more where the bound is near the norm and for the accuracy.
_MORE_STEPS = 20


def candidates(loop: LoopBalls, slack: float) -> Iterator[tuple[Matrix, Ball, LoopBalls]]:
    """Yield coordinates T, a P in them that should be bounded real at gamma = 1, and the loop in T.

    P solves the Riccati equation of the loop with all poles shifted to the right by a part
    of the stability margin; the coordinates are those in which the last P was the identity.
    """
    A, _, C, _ = loop.doubles
    n = A.shape[0]
    margin = -float(np.linalg.eigvals(A).real.max(initial=-np.inf))
    if n == 0 or margin <= 0:
        return
    output = _output_size(loop)
    shares = (0.3,) if n > _LARGE else (0.3, 0.01)
    for alpha in (share * slack * margin for share in shares):
        extra = 1e-6 * alpha * output * np.eye(n)
        start = solve_lyapunov(A + alpha * np.eye(n), C.T @ C + extra)
        T = np.eye(n) if start is None else _identity_coordinates(start)
        for _ in range(_PASSES):
            try:
                turned = _turned(loop, T)
            except ZeroDivisionError:
                break
            X = _shifted_riccati(turned, alpha)
            if X is None:
                break
            values = np.linalg.eigvalsh(X)
            if values[0] > 1e-12 * values[-1]:
                yield T, _refined(X, turned, alpha), turned
            T = _identity_coordinates(X) @ T


def precise_candidate(loop: LoopBalls) -> Ball | None:
    """Solve the same equation with the bits in force, where a tiny shift of the poles will do.

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
    A, R, Q = (M.mid() for M in riccati_terms(loop, shift, _output_size(loop)))
    one, rate = balls.identity(n), flint.arb(math.sqrt(slowest * fastest))
    try:
        resolvent = (A - one * rate).inv().mid()
        core = (A - one * rate - R * resolvent.transpose() * Q).mid().inv().mid()
        E = one + core * (rate * 2)
        R = (resolvent * R * core.transpose() * (rate * 2)).mid()
        Q = (core.transpose() * Q * resolvent * (rate * 2)).mid()
        for _ in range(math.ceil(math.log2(fastest / damping)) + _MORE_STEPS):
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


def _output_size(loop: LoopBalls) -> float:
    """Return how large C'C is beside A, which P is likely to be."""
    A, _, C, _ = loop.doubles
    return float(np.linalg.norm(C) ** 2 / np.linalg.norm(A)) or 1.0


def _turned(loop: LoopBalls, T: Matrix) -> LoopBalls:
    """Return the loop in the coordinates T x."""
    into = balls.ball(T)
    back = into.inv()
    return replace(loop, A=into * loop.A * back, B=into * loop.B, C=loop.C * back)


def _identity_coordinates(P: Matrix) -> Matrix:
    """Return an upper triangular T with T'T = P, as far as P is positive definite in doubles."""
    values, vectors = np.linalg.eigh(P)
    values = np.maximum(values, max(values[-1], np.finfo(float).tiny) * 1e-14)
    return np.linalg.qr(np.sqrt(values)[:, None] * vectors.T)[1]


def _shifted_riccati(loop: LoopBalls, alpha: float) -> Matrix | None:
    """Solve the bounded-real Riccati equation of A + alpha I, with a little extra output."""
    A, R, Q = (balls.midpoint(M) for M in riccati_terms(loop, alpha))
    found = solve_riccati(A, R, Q)
    return None if found is None else found.X


def riccati_terms(
    loop: LoopBalls, alpha: float = 0.0, output: float = 1.0
) -> tuple[Ball, Ball, Ball]:
    """Return the terms of A'P + PA + PRP + Q = 0, with poles shifted and a little extra output."""
    A, B, C, D = loop.A, loop.B, loop.C, loop.D
    n = A.nrows()
    shift = balls.identity(n) * flint.arb(float(alpha))
    extra = shift * flint.arb(float(0.1 * output))
    if B.ncols() == 0:
        return A + shift, balls.zeros(n, n), C.transpose() * C + extra
    inner = (balls.identity(B.ncols()) - D.transpose() * D).inv()
    outer = balls.identity(C.nrows()) + D * inner * D.transpose()
    return (
        A + B * inner * D.transpose() * C + shift,
        B * inner * B.transpose(),
        C.transpose() * outer * C + extra,
    )


def _refined(X: Matrix, loop: LoopBalls, alpha: float) -> Ball:
    """Remove the rounding errors of a Riccati solution by a step of Newton's method."""
    A, R, Q = riccati_terms(loop, alpha)
    P = balls.ball(X)
    residual = balls.symmetric(P * A) * flint.arb(2) + P * R * P + Q
    step = solve_lyapunov(balls.midpoint(A + R * P), balls.midpoint(residual))
    return P if step is None else balls.symmetric(P + balls.ball(step)).mid()
