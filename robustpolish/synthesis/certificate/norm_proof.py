"""Proofs of stability and of norm bounds, checked in ball arithmetic.

A proof is a symmetric P > 0 that satisfies a strict matrix inequality, the bounded-real one
for the H-infinity norm (Boyd et al., "Linear Matrix Inequalities in System and Control Theory",
1994, section 2.7.3), the Gramian one for the H2 norm (section 6.3.2). P is found in doubles;
nothing is assumed about how good it is, only the check counts. Discrete-time loops are mapped by
the Cayley transformation, which keeps stability, the H-infinity norm and P itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import flint
import numpy as np
from numpy.typing import NDArray

from robustpolish.exact import balls
from robustpolish.exact.balls import Ball
from robustpolish.synthesis.certificate.loop_balls import BITS, LoopBalls, cayley
from robustpolish.synthesis.certificate.proof_candidates import candidates, precise_candidates

Matrix = NDArray[Any]


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

    kind: Literal["bounded_real", "gramian", "lyapunov"]
    bound: float
    P: Matrix
    transformation: Matrix
    bits: int = BITS


def prove_stability(loop: LoopBalls) -> NormProof | None:
    """Prove that a continuous-time loop is stable by a Lyapunov matrix."""
    n = loop.A.nrows()
    if n == 0:
        return NormProof("lyapunov", np.inf, np.zeros((0, 0)), np.zeros((0, 0)))
    with balls.precision(BITS):
        silent = replace(loop, B=balls.zeros(n, 0), C=balls.zeros(0, n), D=balls.zeros(0, 0))
        for T, P, turned in candidates(silent, 0.5):
            gap = balls.symmetric(P * turned.A) * flint.arb(-2)
            if balls.is_positive_definite(P) and balls.is_positive_definite(gap):
                return _proof("lyapunov", np.inf, P, T, loop)
    return None


def prove_hinf(
    loop: LoopBalls, bound: float, slack: float = 1e-4, precise: bool = False
) -> NormProof | None:
    """Prove that a continuous-time loop is stable with an H-infinity norm below `bound`.

    Parameters
    ----------
    loop : LoopBalls
    bound : float
    slack : float
        By how much `bound` is expected to lie above the norm, relative; sets the margin
        of strictness that is tried.
    precise : bool
        Whether to solve for P in high precision, for loops with high gains; slower, and
        for small loops only.
    """
    if not np.isfinite(bound):
        return None
    if bound <= 0:
        return _prove_zero(loop)
    n, nw = loop.B.nrows(), loop.B.ncols()
    with balls.precision(2 * BITS if precise else BITS):
        g = flint.arb(float(bound))
        unit = replace(loop, B=loop.B / g, D=loop.D / g)
        fits = balls.is_positive_definite(balls.identity(nw) - unit.D.transpose() * unit.D)
        if not fits:
            return None
        if n == 0:
            return NormProof("bounded_real", bound, np.zeros((0, 0)), np.zeros((0, 0)))
        trials = precise_candidates(unit) if precise else candidates(unit, slack)
        for T, P, turned in trials:
            if _is_bounded_real(P, turned):
                return _proof("bounded_real", bound, P, T, loop)
    return None


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


def prove_h2(loop: LoopBalls, discrete: bool, slack: float = 1e-4) -> NormProof | None:
    """Prove that a loop is stable and bound its H2 norm by its controllability Gramian.

    Parameters
    ----------
    loop : LoopBalls
    discrete : bool
        Whether it is a discrete-time loop; it is mapped here, its Gramian stays the same.
    slack : float
        By how much the bound may lie above the norm, relative.
    """
    n = loop.A.nrows()
    with balls.precision(BITS):
        own = loop.D * loop.D.transpose()
        if not discrete and balls.magnitude(own).any():
            return None
        flow = cayley(loop) if discrete else loop
        dual = LoopBalls(
            flow.A.transpose(),
            balls.zeros(n, 0),
            flow.B.transpose(),
            balls.zeros(flow.B.ncols(), 0),
            1 / loop.scale,
        )
        if n == 0:
            return _gramian_proof(own, balls.zeros(0, 0), np.zeros((0, 0)), dual)
        for T, X, turned in candidates(dual, slack):
            if _is_bounded_real(X, turned):
                output = loop.C * balls.ball(T).transpose()
                return _gramian_proof(own + output * X * output.transpose(), X, T, dual)
    return None


def _gramian_proof(energy: Ball, X: Ball, T: Matrix, dual: LoopBalls) -> NormProof:
    bound = flint.arb(energy.trace() if energy.nrows() else 0).sqrt().upper()
    return _proof("gramian", float(bound) * (1 + 1e-15), X, T, dual)


def _proof(kind: Any, bound: float, P: Ball, T: Matrix, loop: LoopBalls) -> NormProof:
    """Note a proof in the loop's own states."""
    return NormProof(kind, bound, balls.midpoint(P), T / loop.scale)
