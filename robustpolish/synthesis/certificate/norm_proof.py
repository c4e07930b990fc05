"""Proofs of stability and of norm bounds, checked in ball arithmetic.

A proof is a symmetric P > 0 that satisfies a strict matrix inequality, the bounded-real one
for the H-infinity norm (Boyd et al., "Linear Matrix Inequalities in System and Control Theory",
1994, section 2.7.3), the Gramian one for the H2 norm (section 6.3.2). P is found in doubles, or
with more bits; nothing is assumed about how good it is, only the check counts. Discrete-time loops
are mapped by the Cayley transformation, which keeps stability, the H-infinity norm and P itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import flint
import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.exact import balls
from robustpolish.exact.balls import Ball
from robustpolish.synthesis.certificate.loop_balls import BITS, LoopBalls, cayley
from robustpolish.synthesis.certificate.proof_candidates import candidates, precise_candidate

Kind = Literal["bounded_real", "gramian", "lyapunov"]


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
        trials = candidates(loop, slack)
    else:
        found = precise_candidate(loop)
        trials = [] if found is None else [(np.eye(n), found, loop)]
    return next(((T, P) for T, P, turned in trials if _is_bounded_real(P, turned)), None)


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
