"""Proofs of stability and of norm bounds, checked in ball arithmetic.

A proof is a symmetric P > 0 that satisfies a strict matrix inequality, the bounded-real one
for the H-infinity norm (Boyd et al., "Linear Matrix Inequalities in System and Control Theory",
1994, section 2.7.3), the Gramian one for the H2 norm (section 10.1). P is found in doubles; nothing
is assumed about how good it is, only the check counts. Discrete-time loops are mapped by the
Cayley transformation, which keeps stability, the H-infinity norm and P itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

import flint
import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis import balls
from robustpolish.synthesis.balls import Ball
from robustpolish.synthesis.riccati import solve_lyapunov, solve_riccati

Matrix = NDArray[Any]
_BITS = 240


@dataclass(frozen=True, eq=False)
class NormProof:
    """A matrix that proves stability and a bound on the norm.

    Attributes
    ----------
    kind : {"bounded_real", "gramian", "lyapunov"}
        The inequality that P satisfies strictly.
    bound : float
        The proven upper bound on the norm. A "lyapunov" proof tells stability only: infinite,
        or zero if the loop has no input or no output at all.
    P : ndarray, shape (n, n)
        The matrix, in the scaled coordinates of `scale`, rounded to doubles.
    scale : ndarray, shape (n,)
        The loop's states are diag(scale) times the coordinates of P.
    bits : int
        Precision of the ball arithmetic of the check.
    """

    kind: Literal["bounded_real", "gramian", "lyapunov"]
    bound: float
    P: Matrix
    scale: Matrix
    bits: int = _BITS


@dataclass(frozen=True, eq=False)
class LoopBalls:
    """The closed loop in balls, in scaled states: an enclosure of the exact interconnection."""

    A: Ball
    B: Ball
    C: Ball
    D: Ball
    scale: Matrix

    @property
    def doubles(self) -> tuple[Matrix, Matrix, Matrix, Matrix]:
        """The centres as doubles."""
        return tuple(balls.midpoint(M) for M in (self.A, self.B, self.C, self.D))  # type: ignore[return-value]


def enclose_loop(plant: GeneralizedPlant, controller: Any) -> LoopBalls:
    """Connect u = K y without rounding errors and scale the loop's states by powers of two.

    Parameters
    ----------
    plant : GeneralizedPlant
    controller : control.StateSpace

    Raises
    ------
    ZeroDivisionError
        If I - Dk D22 cannot be shown to be nonsingular.
    """
    with balls.precision(_BITS):
        A, B1, B2 = (balls.ball(M) for M in (plant.A, plant.B1, plant.B2))
        C1, C2, D11 = (balls.ball(M) for M in (plant.C1, plant.C2, plant.D11))
        D12, D21, D22 = (balls.ball(M) for M in (plant.D12, plant.D21, plant.D22))
        nk = controller.nstates or 0
        shapes = (nk, nk), (nk, plant.ny), (plant.nu, nk), (plant.nu, plant.ny)
        Ak, Bk, Ck, Dk = (
            balls.ball(np.reshape(M, shape)) if 0 not in shape else balls.zeros(*shape)
            for M, shape in zip(
                (controller.A, controller.B, controller.C, controller.D), shapes, strict=True
            )
        )
        inverse = (balls.identity(plant.nu) - Dk * D22).inv()
        on_x, on_k, on_w = inverse * Dk * C2, inverse * Ck, inverse * Dk * D21
        Al = balls.block(
            [
                [A + B2 * on_x, B2 * on_k],
                [Bk * (C2 + D22 * on_x), Ak + Bk * D22 * on_k],
            ]
        )
        Bl = balls.block([[B1 + B2 * on_w], [Bk * (D21 + D22 * on_w)]])
        Cl = balls.block([[C1 + D12 * on_x, D12 * on_k]])
        Dl = D11 + D12 * on_w
        n = plant.nx + nk
        scale = np.ones(n)
        if n:
            _, (scale, _) = linalg.matrix_balance(balls.midpoint(Al), separate=True, permute=False)
        into, out = balls.ball(np.diag(1 / scale)), balls.ball(np.diag(scale))
        return LoopBalls(into * Al * out, into * Bl, Cl * out, Dl, scale)


def cayley(loop: LoopBalls) -> LoopBalls:
    """Map a discrete-time loop to a continuous one of the same stability and H-infinity norm.

    With z = (1 + s)/(1 - s).

    Raises
    ------
    ZeroDivisionError
        If A + I is singular, in which case the loop is not stable.
    """
    with balls.precision(_BITS):
        n = loop.A.nrows()
        inverse = (loop.A + balls.identity(n)).inv()
        root = flint.arb(2).sqrt()
        return LoopBalls(
            inverse * (loop.A - balls.identity(n)),
            inverse * loop.B * root,
            loop.C * inverse * root,
            loop.D - loop.C * inverse * loop.B,
            loop.scale,
        )


def rounding_level(loop: LoopBalls) -> float:
    """Return the size of a norm that rounding errors in doubles can feign.

    That is the unit roundoff times the gain that the loop would have if nothing cancelled;
    an exactly vanishing transfer matrix computes to something below it.
    """
    A, B, C, D = loop.doubles
    poles = np.abs(np.linalg.eigvals(A)) if A.size else np.zeros(0)
    slowest = poles.min() if poles.size else 0.0
    gain = np.linalg.norm(B) * np.linalg.norm(C) / slowest if slowest > 0 else 0.0
    return float(10 * np.finfo(float).eps * max(A.shape[0], 1) * (gain + np.linalg.norm(D)))


def prove_stability(loop: LoopBalls) -> NormProof | None:
    """Prove that a continuous-time loop is stable by a Lyapunov matrix."""
    n = loop.A.nrows()
    with balls.precision(_BITS):
        for candidate in _lyapunov_candidates(loop.A, np.eye(n)):
            gap = balls.symmetric(loop.A.transpose() * candidate) * flint.arb(-2)
            if balls.is_positive_definite(candidate) and balls.is_positive_definite(gap):
                return NormProof("lyapunov", np.inf, balls.midpoint(candidate), loop.scale)
    return None


def prove_hinf(loop: LoopBalls, bound: float) -> NormProof | None:
    """Prove that a continuous-time loop is stable with an H-infinity norm below `bound`."""
    n, nw = loop.B.nrows(), loop.B.ncols()
    if not np.isfinite(bound):
        return None
    if bound <= 0:
        return _prove_zero(loop)
    with balls.precision(_BITS):
        g = flint.arb(float(bound))
        A, B, C, D = loop.A, loop.B / g, loop.C, loop.D / g
        if n == 0:
            fits = balls.is_positive_definite(balls.identity(nw) - D.transpose() * D)
            return NormProof("bounded_real", bound, np.zeros((0, 0)), loop.scale) if fits else None
        for P in _bounded_real_candidates(A, B, C, D):
            corner = P * B + C.transpose() * D
            inequality = balls.block(
                [
                    [balls.symmetric(P * A) * flint.arb(2) + C.transpose() * C, corner],
                    [corner.transpose(), D.transpose() * D - balls.identity(nw)],
                ]
            ) * flint.arb(-1)
            if balls.is_positive_definite(inequality) and balls.is_positive_definite(P):
                return NormProof("bounded_real", bound, balls.midpoint(P), loop.scale)
    return None


def _prove_zero(loop: LoopBalls) -> NormProof | None:
    """Prove a norm of zero where input or output matrices vanish."""
    with balls.precision(_BITS):
        zero = [not balls.magnitude(M).any() for M in (loop.B, loop.C, loop.D)]
    if not (zero[2] and (zero[0] or zero[1])):
        return None
    proof = prove_stability(loop)
    return None if proof is None else replace(proof, bound=0.0)


def prove_h2(loop: LoopBalls, discrete: bool, slack: float = 1e-6) -> NormProof | None:
    """Prove that a loop is stable and bound its H2 norm by a controllability Gramian.

    The bound is the best that the Gramian gives, at most about `slack` above the norm
    (relative); None as well if a continuous loop has a feedthrough.
    """
    n = loop.A.nrows()
    zero = _prove_zero(loop)
    if zero is not None and not discrete:
        return zero
    with balls.precision(_BITS):
        feedthrough = balls.magnitude(loop.D)
        if not discrete and feedthrough.any():
            return None
        B = balls.midpoint(loop.B)
        for X in _gramian_candidates(loop, B, discrete, slack):
            if discrete:
                gap = X - loop.A * X * loop.A.transpose() - loop.B * loop.B.transpose()
            else:
                gap = -(balls.symmetric(loop.A * X) * flint.arb(2) + loop.B * loop.B.transpose())
            if not (n == 0 or (balls.is_positive_definite(gap) and balls.is_positive_definite(X))):
                continue
            energy = (loop.C * X * loop.C.transpose()) if n else balls.zeros(*[loop.C.nrows()] * 2)
            if discrete:
                energy = energy + loop.D * loop.D.transpose()
            bound = float(flint.arb(energy.trace()).sqrt().upper()) if energy.nrows() else 0.0
            if np.isfinite(bound):
                return NormProof("gramian", bound * (1 + 1e-15), balls.midpoint(X), loop.scale)
    return None


def _lyapunov_candidates(A: Ball, Q: Matrix) -> Iterator[Ball]:
    """Yield approximate solutions of A'P + PA + Q = 0, each refined further."""
    doubles = balls.midpoint(A)
    P = solve_lyapunov(doubles, Q)
    if P is None:
        return
    candidate = balls.ball(P)
    right = balls.ball(Q)
    for _ in range(4):
        yield candidate
        residual = balls.symmetric(candidate * A) * flint.arb(2) + right
        step = solve_lyapunov(doubles, balls.midpoint(residual))
        if step is None:
            return
        candidate = (candidate + balls.ball(step)).mid()


def _bounded_real_candidates(A: Ball, B: Ball, C: Ball, D: Ball) -> Iterator[Ball]:
    """Yield matrices that should satisfy the bounded-real inequality at gamma = 1.

    The Riccati solution satisfies it with equality, and Newton's method in balls removes its
    rounding errors; adding a small solution of the Lyapunov equation of the same loop makes
    the inequality strict.
    """
    n, nw = B.nrows(), B.ncols()
    try:
        inner = (balls.identity(nw) - D.transpose() * D).inv()
    except ZeroDivisionError:
        return
    At = A + B * inner * D.transpose() * C
    R = B * inner * B.transpose()
    Q = C.transpose() * (balls.identity(C.nrows()) + D * inner * D.transpose()) * C
    start = solve_riccati(*(balls.midpoint(M) for M in (At, R, Q)))
    if start is None:
        return
    P = balls.ball(start.X)
    for _ in range(4):
        loop = balls.midpoint(At + R * P)
        if np.linalg.eigvals(loop).real.max() >= 0:
            return
        margin = solve_lyapunov(loop, np.eye(n))
        if margin is None:
            return
        largest = np.linalg.norm(margin @ balls.midpoint(R) @ margin, 2)
        largest = max(largest, np.linalg.norm(margin, 2) / max(np.linalg.norm(start.X, 2), 1e-300))
        for share in (0.5, 2.0**-10):
            yield (P + balls.ball(margin) * flint.arb(float(share / largest))).mid()
        residual = balls.symmetric(P * At) * flint.arb(2) + P * R * P + Q
        step = solve_lyapunov(loop, balls.midpoint(residual))
        if step is None:
            return
        P = balls.symmetric(P + balls.ball(step)).mid()


def _gramian_candidates(loop: LoopBalls, B: Matrix, discrete: bool, slack: float) -> Iterator[Ball]:
    """Yield upper bounds of the controllability Gramian, each refined further."""
    A = balls.midpoint(loop.A)
    n = A.shape[0]
    if n == 0:
        yield balls.zeros(0, 0)
        return

    def solve(Q: Matrix) -> Matrix | None:
        if not discrete:
            return solve_lyapunov(A.T, Q)
        try:
            inverse = np.linalg.inv(A + np.eye(n))
        except np.linalg.LinAlgError:
            return None
        half = np.sqrt(2) * inverse
        return solve_lyapunov((inverse @ (A - np.eye(n))).T, half @ Q @ half.T)

    X, margin = solve(B @ B.T), solve(np.eye(n))
    if X is None or margin is None:
        return
    C = balls.midpoint(loop.C)
    energy, extra = np.trace(C @ X @ C.T), np.trace(C @ margin @ C.T)
    # A vanishing energy is known to rounding only; the bound then ends there too.
    energy = max(energy, np.finfo(float).eps ** 2 * np.linalg.norm(C) ** 2 * np.linalg.norm(X))
    epsilon = 2 * slack * energy / extra if extra > 0 and energy > 0 else slack**4
    current = balls.ball(X)
    for _ in range(4):
        for share in (0.1, 1.0):
            yield (current + balls.ball(margin) * flint.arb(float(share * epsilon))).mid()
        if discrete:
            residual = loop.A * current * loop.A.transpose() - current
        else:
            residual = balls.symmetric(loop.A * current) * flint.arb(2)
        step = solve(balls.midpoint(residual + loop.B * loop.B.transpose()))
        if step is None:
            return
        current = balls.symmetric(current + balls.ball(step)).mid()
