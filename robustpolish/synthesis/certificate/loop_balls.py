"""The closed loop of a plant and any controller, in ball arithmetic: an enclosure of the exact one.

It offers what proofs ask of a loop: its gain at a frequency, the terms of its bounded-real Riccati
equation, its image in continuous time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import control
import flint
import numpy as np
from scipy.linalg import lapack as _lapack

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.exact import balls
from robustpolish.exact.balls import Ball
from robustpolish.models import GeneralizedPlant
from robustpolish.synthesis.certificate.quick_norm import state_scale

lapack: Any = _lapack
BITS = 240
"""Precision of the balls; more where that does not suffice for a proof."""
# More states than this are solved for in doubles and refined: at most so often, as long as each
# step is that much smaller than the one before, until one is so small beside the solution.
_REFINED, _REFINEMENTS, _PROGRESS, _EXACT = 60, 12, 1e-3, 1e-30


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
        centre = balls.midpoint
        return centre(self.A), centre(self.B), centre(self.C), centre(self.D)

    def gain_at(self, frequency: float) -> float:
        """Return the largest singular value at a frequency in rad/s, with the bits in force."""
        A, B, C, D = (flint.acb_mat(M) for M in (self.A, self.B, self.C, self.D))
        response = D
        if math.isfinite(frequency) and A.nrows():
            resolvent = -A
            for i in range(A.nrows()):
                resolvent[i, i] += flint.acb(0, frequency)
            try:
                states = _refined_solution(resolvent, B)
                states = resolvent.solve(B) if states is None else states
            except ZeroDivisionError:
                return math.inf
            response = D + C * states
        return float(np.linalg.norm(balls.midpoint(response), 2))

    def riccati_terms(self, alpha: float = 0.0, output: float = 1.0) -> tuple[Ball, Ball, Ball]:
        """Return A, R and Q of the bounded-real equation A'P + PA + PRP + Q = 0 at gamma = 1.

        The poles are shifted by `alpha` to the right and a little output is added.
        """
        A, B, C, D = self.A, self.B, self.C, self.D
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

    @property
    def output_size(self) -> float:
        """How large C'C is beside A, which P is likely to be."""
        A, _, C, _ = self.doubles
        return float(np.linalg.norm(C) ** 2 / np.linalg.norm(A)) or 1.0


def enclosed(system: control.StateSpace) -> LoopBalls:
    """Enclose a system, which has been connected before, as it is."""
    A, B, C, D = (balls.ball(np.asarray(M)) for M in (system.A, system.B, system.C, system.D))
    return LoopBalls(A, B, C, D, np.ones(A.nrows()))


def enclose_loop(plant: GeneralizedPlant, controller: Any, bits: int = BITS) -> LoopBalls:
    """Connect u = K y without rounding errors and scale the loop's states by powers of two.

    Parameters
    ----------
    plant : GeneralizedPlant
    controller : control.StateSpace
    bits : int
        Precision of the enclosure.

    Raises
    ------
    ZeroDivisionError
        If I - Dk D22 cannot be shown to be nonsingular.
    """
    with balls.precision(bits):
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
        scale = state_scale(*(balls.midpoint(M) for M in (Al, Bl, Cl)))
        into, given, shown = 1 / scale, np.ones(Bl.ncols()), np.ones(Cl.nrows())
        return LoopBalls(
            balls.scaled(Al, into, scale),
            balls.scaled(Bl, into, given),
            balls.scaled(Cl, shown, scale),
            Dl,
            scale,
        )


def cayley(loop: LoopBalls, bits: int = BITS) -> LoopBalls:
    """Map a discrete-time loop to a continuous one of the same stability and H-infinity norm.

    With z = (1 + s)/(1 - s).

    Raises
    ------
    ZeroDivisionError
        If A + I is singular, in which case the loop is not stable.
    """
    with balls.precision(bits):
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


def angle(frequency: float, step: float | None) -> float:
    """Return where a frequency in rad/s lies on the axis of the loop that :func:`cayley` gives."""
    return frequency if step is None else math.tan(min(frequency * step, math.pi) / 2)


def rate(angle: float, step: float | None) -> float:
    """Return the frequency in rad/s that lies there."""
    return angle if step is None else 2 * math.atan(angle) / step


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


def _refined_solution(M: Ball, B: Ball) -> Ball | None:
    """Solve M X = B in doubles and refine X with the bits in force; None where that stalls.

    On many states it takes a small part of the time of a solution in balls.
    """
    if M.nrows() <= _REFINED or not B.ncols():
        return None
    factors, pivots, singular = lapack.zgetrf(balls.midpoint(M))
    X, rest, before = flint.acb_mat(B.nrows(), B.ncols()), B, math.inf
    for _ in range(_REFINEMENTS):
        step = lapack.zgetrs(factors, pivots, balls.midpoint(rest))[0]
        size = float(np.linalg.norm(step))
        if singular or not size <= _PROGRESS * before:
            return None
        X = (X + flint.acb_mat(X.nrows(), X.ncols(), step.ravel().tolist())).mid()
        if size <= _EXACT * float(np.linalg.norm(balls.midpoint(X))):
            return X
        rest, before = B - M * X, size
    return None
