"""The H2 norm of a sampled loop: the root of the average power of z under white noise w.

Noise of unit density enters at all times, not only at the samples; the power of z is
averaged over a period. Stretches are joined as for the induced norm, here with energies only.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import flint
import numpy as np
from scipy import linalg

from robustpolish.exact import balls
from robustpolish.implementation.sampled.ball_section import Ball
from robustpolish.implementation.sampled.period_map import Phase
from robustpolish.implementation.sampled.scaled_map import ScaledMap

_TERMS = 40
_SMALL = 0.25
_SPARE_BITS = 160
_MARGINS = (1e-12, 1e-10, 1e-8, 1e-6, 1e-4)
_DOUBLINGS = 60


class PowerSection(NamedTuple):
    """State map A, covariance W from noise within, energy Q of the state, energy J of the noise."""

    A: Ball
    W: Ball
    Q: Ball
    J: Any


def average_power(loop: ScaledMap) -> tuple[float, float] | None:
    """Enclose the H2 norm of a stable loop whose D11 is zero, with proof.

    Parameters
    ----------
    loop : ScaledMap

    Returns
    -------
    (lower, upper) or None
        None if stability or the upper bound could not be proven.

    Notes
    -----
    The norm of B. Bamieh and J. B. Pearson, "The H2 problem for sampled-data systems", Systems &
    Control Letters 19 (1992) 1-12: impulses at all instants of a period are averaged over.
    """
    h = loop.map.period
    times = [_halvings(loop, phase) for phase in loop.map.phases]
    with balls.precision(_SPARE_BITS + 3 * max(times)):
        flow: PowerSection | None = None
        for phase, halved in zip(loop.map.phases, times, strict=True):
            own = _phase(loop, phase, halved)
            flow = own if flow is None else _joined(flow, own)
        assert flow is not None
        A, W, Q = _at_samples(loop, flow)
        upper = _covariance_above(A, W)
        if upper is None:
            return None
        high = ((flow.J + (Q * upper).trace()) / flint.arb(h)).sqrt().upper()
        S = W
        for _ in range(_DOUBLINGS):
            grown = balls.symmetric(S + A * S * A.transpose())
            done = (Q * (grown - S)).trace() < 1e-14 * (Q * grown).trace()
            S, A = grown, A * A
            if done:
                break
        low = ((flow.J + (Q * S).trace()) / flint.arb(h)).sqrt().lower()
    return max(0.0, float(low) * (1 - 1e-15)), float(high) * (1 + 1e-15)


def _halvings(loop: ScaledMap, phase: Phase) -> int:
    A = phase.A * loop.flow / loop.flow[:, None]
    size = 2 * max(np.linalg.norm(A, 1), np.linalg.norm(A, np.inf)) * phase.length / _SMALL
    return max(0, math.ceil(math.log2(size))) if size > 1 else 0


def _phase(loop: ScaledMap, phase: Phase, times: int) -> PowerSection:
    into, back = balls.ball(np.diag(1 / loop.flow)), balls.ball(np.diag(loop.flow))
    A = into * balls.ball(phase.A) * back
    B, C = into * _ball(phase.B), _ball(phase.C) * back
    step = flint.arb(phase.length) * flint.arb(2) ** -times
    weight, source = C.transpose() * C, B * B.transpose()
    W, Q = source * step, weight * step
    J = (source * weight).trace() * step * step / 2
    term_w, term_q, factor = source, weight, step
    for k in range(1, _TERMS):
        term_w = balls.symmetric(A * term_w) * flint.arb(2)
        term_q = balls.symmetric(A.transpose() * term_q) * flint.arb(2)
        factor = factor * step / (k + 1)
        W, Q = W + term_w * factor, Q + term_q * factor
        J = J + (source * term_q).trace() * factor * step / (k + 2)
    # What the series leaves out: each term is at most a quarter of the one before it.
    rest = flint.arb(_SMALL) ** _TERMS * step
    size_w, size_q = _norm(source), _norm(weight)
    n = A.nrows()
    found = PowerSection(
        (A * step).exp(),
        W + _unknown(n, rest * size_w),
        Q + _unknown(n, rest * size_q),
        J + flint.arb(0, (rest * step * size_w * size_q * n).upper()),
    )
    for _ in range(times):
        found = _joined(found, found)
    return found


def _joined(first: PowerSection, second: PowerSection) -> PowerSection:
    return PowerSection(
        second.A * first.A,
        balls.symmetric(second.W + second.A * first.W * second.A.transpose()),
        balls.symmetric(first.Q + first.A.transpose() * second.Q * first.A),
        first.J + second.J + (second.Q * first.W).trace(),
    )


def _at_samples(loop: ScaledMap, flow: PowerSection) -> tuple[Ball, Ball, Ball]:
    """Return state map, covariance and output energy of a period in the states at its samples."""
    L, N = loop.map.connected(_ball, lambda a, b: a * b)
    into, back = balls.ball(np.diag(1 / loop.sample)), balls.ball(np.diag(loop.sample))
    L = balls.ball(np.diag(1 / loop.flow)) * L * back
    M = into * balls.ball(loop.map.M) * balls.ball(np.diag(loop.flow))
    return (
        into * N * back + M * flow.A * L,
        balls.symmetric(M * flow.W * M.transpose()),
        balls.symmetric(L.transpose() * flow.Q * L),
    )


def _covariance_above(A: Ball, W: Ball) -> Ball | None:
    """Return an S with S > A S A' + W, which proves stability and bounds the covariance."""
    step, source = balls.midpoint(A), balls.midpoint(W)
    n = len(step)
    if np.abs(np.linalg.eigvals(step)).max(initial=0.0) >= 1:
        return None
    size = max(float(np.linalg.norm(source, 2)), 1e-300)
    for margin in _MARGINS:
        S = np.asarray(
            linalg.solve_discrete_lyapunov(step, source + margin * size * np.eye(n)), dtype=float
        )
        if not np.isfinite(S).all():
            return None
        ball = balls.symmetric(balls.ball(S))
        rest = balls.symmetric(ball - A * ball * A.transpose() - W)
        if balls.is_positive_definite(rest) and balls.is_positive_definite(ball):
            return ball
    return None


def _norm(matrix: Ball) -> Any:
    """Return an upper bound of the Frobenius norm."""
    return sum((entry * entry for entry in matrix.entries()), flint.arb(0)).sqrt()


def _unknown(n: int, radius: Any) -> Ball:
    return flint.arb_mat(n, n, [flint.arb(0, radius.upper())] * (n * n))


def _ball(matrix: Any) -> Ball:
    return balls.ball(matrix) if matrix.size else balls.zeros(*matrix.shape)
