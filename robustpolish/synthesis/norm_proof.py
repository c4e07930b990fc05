"""Proofs of stability and of norm bounds, checked in ball arithmetic.

A proof is a symmetric P > 0 that satisfies a strict matrix inequality, the bounded-real one
for the H-infinity norm (Boyd et al., "Linear Matrix Inequalities in System and Control Theory",
1994, section 2.7.3), the Gramian one for the H2 norm (section 6.3.2). P is found in doubles;
nothing is assumed about how good it is, only the check counts. Discrete-time loops are mapped by
the Cayley transformation, which keeps stability, the H-infinity norm and P itself.

What makes P strict is a small shift of all poles to the right: the equation for A + alpha I leaves
-2 alpha P, a margin in proportion to P. Solving again in the coordinates where P was found to be
the identity makes that margin visible in doubles however ill-conditioned P is in the given ones.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

import flint
import numpy as np
from numpy.typing import NDArray

from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis import balls
from robustpolish.synthesis.balancing import balancing_scale
from robustpolish.synthesis.balls import Ball
from robustpolish.synthesis.riccati import solve_lyapunov, solve_riccati

Matrix = NDArray[Any]
_BITS = 240
_PASSES = 3
_LARGE = 60
# Up to so many states the sign iteration in balls takes less than about 1 s.
_PRECISE_STATES = 24
_SIGN_STEPS = 100


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
        scale = _state_scale(*(balls.midpoint(M) for M in (Al, Bl, Cl)))
        into, out = balls.ball(np.diag(1 / scale)), balls.ball(np.diag(scale))
        return LoopBalls(into * Al * out, into * Bl, Cl * out, Dl, scale)


def _state_scale(A: Matrix, B: Matrix, C: Matrix) -> Matrix:
    """Balance the states by powers of two, with all inputs and all outputs as one more state."""
    n = A.shape[0]
    if n == 0:
        return np.ones(0)
    bordered = np.zeros((n + 1, n + 1))
    bordered[:n, :n] = A
    bordered[:n, n], bordered[n, :n] = np.linalg.norm(B, axis=1), np.linalg.norm(C, axis=0)
    return balancing_scale(bordered)[:n]


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
    if n == 0:
        return NormProof("lyapunov", np.inf, np.zeros((0, 0)), np.zeros((0, 0)))
    with balls.precision(_BITS):
        silent = replace(loop, B=balls.zeros(n, 0), C=balls.zeros(0, n), D=balls.zeros(0, 0))
        for T, P, turned in _candidates(silent, 0.5):
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
    with balls.precision(2 * _BITS if precise else _BITS):
        g = flint.arb(float(bound))
        unit = replace(loop, B=loop.B / g, D=loop.D / g)
        fits = balls.is_positive_definite(balls.identity(nw) - unit.D.transpose() * unit.D)
        if not fits:
            return None
        if n == 0:
            return NormProof("bounded_real", bound, np.zeros((0, 0)), np.zeros((0, 0)))
        candidates = _precise_candidates(unit) if precise else _candidates(unit, slack)
        for T, P, turned in candidates:
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
    with balls.precision(_BITS):
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
    with balls.precision(_BITS):
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
        for T, X, turned in _candidates(dual, slack):
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


def _candidates(loop: LoopBalls, slack: float) -> Iterator[tuple[Matrix, Ball, LoopBalls]]:
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


def _precise_candidates(loop: LoopBalls) -> Iterator[tuple[Matrix, Ball, LoopBalls]]:
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
