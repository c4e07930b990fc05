"""Proofs of stability and of norm bounds, checked in ball arithmetic.

A proof is a symmetric P > 0 that satisfies a strict matrix inequality, the bounded-real one
for the H-infinity norm (Boyd et al., "Linear Matrix Inequalities in System and Control Theory",
1994, section 2.7.3), the Gramian one for the H2 norm (section 6.3.2). P is found in doubles, or
with more bits; nothing is assumed about how good it is, only the check counts. Discrete-time loops
are mapped by the Cayley transformation, which keeps stability, the H-infinity norm and P itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import flint
import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.exact import balls
from robustpolish.exact.balls import Ball
from robustpolish.synthesis.certificate.long_arithmetic import precise_candidate
from robustpolish.synthesis.certificate.loop_balls import BITS, LoopBalls, cayley, rate
from robustpolish.synthesis.certificate.quick_norm import quick_norm
from robustpolish.synthesis.riccati.equations import solve_lyapunov, solve_riccati

Kind = Literal["bounded_real", "gramian", "lyapunov"]
SLACK = (1e-5, 2e-4, 9e-4)
"""How far above a computed norm, relative, the bounds lie that are tried, in this order."""
# From so many states on the tightest is left out, because a trial takes long.
_LARGE = 60
_PASSES = 3
# How well, relative, what doubles find and what the enclosed loop has must agree to be believed.
_AGREE = 1e-6
_ACCURACY = 1e-9


@dataclass(frozen=True, eq=False)
class NormProof:
    """A matrix that proves stability and a bound on the norm.

    Attributes
    ----------
    kind : {"bounded_real", "gramian", "lyapunov"}
        The inequality that P satisfies strictly.
    bound : float
        The proven upper bound on the norm. A "lyapunov" proof tells stability only: infinite,
        or zero if no disturbance reaches any output.
    P : ndarray, shape (n, n)
        The matrix, in the coordinates of `transformation`, rounded to doubles.
    transformation : ndarray, shape (n, n)
        T of T x, the coordinates in which P is near the identity; x are the loop's states.
    bits : int
        Least precision of the ball arithmetic of the check.
    """

    kind: Kind
    bound: float
    P: Matrix
    transformation: Matrix
    bits: int = BITS


class Proven(NamedTuple):
    """A proof, and the norm with the frequency of its peak in rad/s, computed again if need be."""

    proof: NormProof | None
    achieved: float
    frequency: float | None


def slacks(loop: LoopBalls) -> tuple[float, ...]:
    """Return those of :data:`SLACK` that are worth a trial on a loop of this size."""
    return SLACK[loop.A.nrows() > _LARGE :]


def prove_computed_norm(
    loop: LoopBalls, rounded: LoopBalls, level: float, step: float | None
) -> Proven | None:
    """Compute the H-infinity norm in doubles and bracket it by a gain and a proof in balls.

    Parameters
    ----------
    loop : LoopBalls
    rounded : LoopBalls
        The same, connected in doubles. If rounding adds something to the norm, it counts; more
        than 1e-6 of it, more or less, is left to a closer look.
    level : float
        Norms below it cannot be told from zero in doubles.
    step : float or None
        Sampling time; None for a continuous-time loop.

    Returns
    -------
    Proven or None
        A proof that the loop is stable with a norm between the one returned, but for 1e-6 of it,
        and the bound. None where doubles do not settle it, or no such proof is found.
    """
    try:
        loop, rounded = (M if step is None else cayley(M) for M in (loop, rounded))
    except ZeroDivisionError:  # a pole at -1
        return None
    seen = []
    for each in (loop, rounded):
        matrices = each.doubles
        if 0 in matrices[3].shape or not all(np.isfinite(M).all() for M in matrices):
            return None
        seen.append(quick_norm(*matrices, _ACCURACY))
    exact, other = seen
    if not (exact.settled and other.settled):
        return None
    with balls.precision(BITS):
        gain = loop.gain_at(exact.frequency)
    if not (level < gain < np.inf and abs(other.value - gain) <= _AGREE * gain):
        return None
    achieved, frequency = max((gain, exact.frequency), (other.value, other.frequency))
    slack = slacks(loop)[0]
    proof = prove_hinf(loop, achieved * (1 + slack), slack)
    return proof and Proven(proof, achieved, rate(frequency, step))


def prove_stability(loop: LoopBalls, bits: int | None = None) -> NormProof | None:
    """Prove that a continuous-time loop is stable by a Lyapunov matrix.

    Parameters
    ----------
    loop : LoopBalls
    bits : int, optional
        As for :func:`prove_hinf`.
    """
    n = loop.A.nrows()
    silent = replace(loop, B=balls.zeros(n, 0), C=balls.zeros(0, n), D=balls.zeros(0, 0))
    with balls.precision(bits or BITS):
        found = _checked(silent, 0.5, bits)
    return None if found is None else _proof("lyapunov", np.inf, found, loop)


def prove_hinf(
    loop: LoopBalls, bound: float, slack: float = 1e-4, bits: int | None = None
) -> NormProof | None:
    """Prove that a continuous-time loop is stable with an H-infinity norm below `bound`.

    Parameters
    ----------
    loop : LoopBalls
    bound : float
    slack : float
        By how much `bound` is expected to lie above the norm, relative; sets the margin
        of strictness that is tried in doubles.
    bits : int, optional
        Find P with so many bits, which takes longer and proves what doubles leave open. In
        doubles by default.
    """
    if not np.isfinite(bound):
        return None
    if bound <= 0:
        return _prove_zero(loop)
    with balls.precision(bits or BITS):
        g = flint.arb(float(bound))
        unit = replace(loop, B=loop.B / g, D=loop.D / g)
        gap = balls.identity(loop.B.ncols()) - unit.D.transpose() * unit.D
        found = _checked(unit, slack, bits) if balls.is_positive_definite(gap) else None
    return None if found is None else _proof("bounded_real", bound, found, loop)


def _checked(loop: LoopBalls, slack: float, bits: int | None) -> tuple[Matrix, Ball] | None:
    """Return coordinates T and a P in them that proves the norm of `loop` to be below one."""
    n = loop.A.nrows()
    if n == 0:
        return np.zeros((0, 0)), balls.zeros(0, 0)
    if bits is None:
        trials = _candidates(loop, slack)
    else:
        found = precise_candidate(loop)
        trials = [] if found is None else [(np.eye(n), found, loop)]
    for T, P, turned in trials:
        if _is_bounded_real(P, turned):
            return T, P
    return None


def _candidates(loop: LoopBalls, slack: float) -> Iterator[tuple[Matrix, Ball, LoopBalls]]:
    """Yield coordinates T, a P in them that should be bounded real at gamma = 1, and the loop in T.

    P solves the Riccati equation of the loop with all poles shifted to the right by a part
    of the stability margin, which leaves -2 alpha P, a margin in proportion to P. The coordinates
    are those in which the last P was the identity: solving again in them makes that margin visible
    in doubles however ill-conditioned P is in the given ones.
    """
    A, _, C, _ = loop.doubles
    n = A.shape[0]
    margin = -float(np.linalg.eigvals(A).real.max(initial=-np.inf))
    if n == 0 or margin <= 0:
        return
    output = loop.output_size
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
    A, R, Q = (balls.midpoint(M) for M in loop.riccati_terms(alpha))
    found = solve_riccati(A, R, Q)
    return None if found is None else found.X


def _refined(X: Matrix, loop: LoopBalls, alpha: float) -> Ball:
    """Remove the rounding errors of a Riccati solution by a step of Newton's method."""
    A, R, Q = loop.riccati_terms(alpha)
    P = balls.ball(X)
    residual = balls.symmetric(P * A) * flint.arb(2) + P * R * P + Q
    step = solve_lyapunov(balls.midpoint(A + R * P), balls.midpoint(residual))
    return P if step is None else balls.symmetric(P + balls.ball(step)).mid()


def _is_bounded_real(P: Ball, loop: LoopBalls) -> bool:
    A, B, C, D = loop.A, loop.B, loop.C, loop.D
    corner = P * B + C.transpose() * D
    inequality = balls.block(
        [
            [balls.symmetric(P * A) * flint.arb(2) + C.transpose() * C, corner],
            [corner.transpose(), D.transpose() * D - balls.identity(B.ncols())],
        ]
    ) * flint.arb(-1)
    return balls.is_positive_definite(inequality) and balls.is_positive_definite(P)


def _prove_zero(loop: LoopBalls) -> NormProof | None:
    """Prove a norm of zero where D and all Markov parameters C A^k B vanish exactly."""
    with balls.precision(BITS):
        if balls.magnitude(loop.D).any():
            return None
        reached = loop.B
        for _ in range(max(loop.A.nrows(), 1)):
            if balls.magnitude(loop.C * reached).any():
                return None
            reached = loop.A * reached
    proof = prove_stability(loop)
    return None if proof is None else replace(proof, bound=0.0)


def prove_h2(
    loop: LoopBalls, discrete: bool, slack: float = 1e-4, bits: int | None = None
) -> NormProof | None:
    """Prove that a loop is stable and bound its H2 norm by its controllability Gramian.

    Parameters
    ----------
    loop : LoopBalls
    discrete : bool
        Whether it is a discrete-time loop; it is mapped here, its Gramian stays the same.
    slack : float
        By how much the bound may lie above the norm, relative.
    bits : int, optional
        As for :func:`prove_hinf`.
    """
    n = loop.A.nrows()
    with balls.precision(bits or BITS):
        energy = loop.D * loop.D.transpose()
        if not discrete and balls.magnitude(energy).any():
            return None
        flow = cayley(loop, bits or BITS) if discrete else loop
        dual = LoopBalls(
            flow.A.transpose(),
            balls.zeros(n, 0),
            flow.B.transpose(),
            balls.zeros(flow.B.ncols(), 0),
            1 / loop.scale,
        )
        found = _checked(dual, slack, bits)
        if found is None:
            return None
        if n:
            T, X = found
            output = loop.C * balls.ball(T).transpose()
            energy += output * X * output.transpose()
        square = flint.arb(energy.trace() if energy.nrows() else 0)
        return _proof("gramian", float(square.sqrt().upper()) * (1 + 1e-15), found, dual)


def _proof(kind: Kind, bound: float, found: tuple[Matrix, Ball], loop: LoopBalls) -> NormProof:
    """Note a proof in the loop's own states."""
    T, P = found
    return NormProof(kind, bound, balls.midpoint(P), T / loop.scale)
