"""Matrices that should prove a norm, found in doubles or, for high gains, in high precision.

What makes P strict is a small shift of all poles to the right: the equation for A + alpha I leaves
-2 alpha P, a margin in proportion to P. Solving again in the coordinates where P was found to be
the identity makes that margin visible in doubles however ill-conditioned P is in the given ones.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import flint
import numpy as np
from numpy.typing import NDArray

from robustpolish.exact import balls
from robustpolish.exact.balls import Ball
from robustpolish.synthesis.certificate.loop_balls import LoopBalls
from robustpolish.synthesis.riccati.equations import solve_lyapunov, solve_riccati

Matrix = NDArray[Any]
_PASSES = 3
_LARGE = 60
# Up to so many states the sign iteration in balls takes less than about 1 s. Where there is a
# solution it was found in 30 steps; where the bound lies below the norm, it wanders for ever.
_PRECISE_STATES = 24
_SIGN_STEPS = 40


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
    size = np.linalg.norm(C) ** 2 / np.linalg.norm(A) or 1.0
    shares = (0.3,) if n > _LARGE else (0.3, 0.01)
    for alpha in (share * slack * margin for share in shares):
        extra = 1e-6 * alpha * size * np.eye(n)
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


def precise_candidates(loop: LoopBalls) -> Iterator[tuple[Matrix, Ball, LoopBalls]]:
    """Yield the same in high precision, where a much smaller shift of the poles will do."""
    A, _, C, _ = loop.doubles
    n = A.shape[0]
    margin = -float(np.linalg.eigvals(A).real.max(initial=-np.inf))
    if 0 < n <= _PRECISE_STATES and margin > 0:
        size = np.linalg.norm(C) ** 2 / np.linalg.norm(A) or 1.0
        X = _precise_riccati(loop, 1e-20 * margin, float(size))
        if X is not None:
            yield np.eye(n), X, loop


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
    A, R, Q = (balls.midpoint(M) for M in _riccati_terms(loop, alpha))
    found = solve_riccati(A, R, Q)
    return None if found is None else found.X


def _precise_riccati(loop: LoopBalls, alpha: float, size: float) -> Ball | None:
    """Solve the same equation in high precision by the matrix sign iteration."""
    n = loop.A.nrows()
    A, R, Q = (M.mid() for M in _riccati_terms(loop, alpha, size))
    Z = balls.block([[A, R], [Q * flint.arb(-1), A.transpose() * flint.arb(-1)]])
    for _ in range(_SIGN_STEPS):
        try:
            inverse = Z.inv().mid()
        except ZeroDivisionError:
            return None
        here, there = np.linalg.norm(balls.midpoint(Z)), np.linalg.norm(balls.midpoint(inverse))
        if not (np.isfinite(here) and np.isfinite(there)):
            return None
        weight = flint.arb(float(there / here)).sqrt()
        step = ((Z * weight + inverse / weight) * flint.arb(0.5)).mid()
        change = np.linalg.norm(balls.midpoint(step - Z))
        Z = step
        if change <= 1e-25 * here:
            break
    else:
        return None
    stable = balls.identity(2 * n) - Z
    rows = stable.tolist()
    upper, lower = (flint.arb_mat([row[:n] for row in part]) for part in (rows[:n], rows[n:]))
    try:
        return balls.symmetric(lower * upper.inv()).mid()
    except ZeroDivisionError:
        return None


def _riccati_terms(loop: LoopBalls, alpha: float, size: float = 1.0) -> tuple[Ball, Ball, Ball]:
    """Return the terms of A'P + PA + PRP + Q = 0."""
    A, B, C, D = loop.A, loop.B, loop.C, loop.D
    n = A.nrows()
    shift = balls.identity(n) * flint.arb(float(alpha))
    extra = shift * flint.arb(float(0.1 * size))
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
    A, R, Q = _riccati_terms(loop, alpha)
    P = balls.ball(X)
    residual = balls.symmetric(P * A) * flint.arb(2) + P * R * P + Q
    step = solve_lyapunov(balls.midpoint(A + R * P), balls.midpoint(residual))
    return P if step is None else balls.symmetric(P + balls.ball(step)).mid()
