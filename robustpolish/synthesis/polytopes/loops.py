"""Loops at the vertices, connected without rounding, and the loop of an uncertain system."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.exact import balls
from robustpolish.models import UncertainSystem
from robustpolish.synthesis.polytopes.proof import BITS, BallLoop
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices


def state_loop(p: PlantMatrices, F: Matrix) -> BallLoop:
    """Return the loop of u = F x in balls."""
    with balls.precision(BITS):
        A, B1, B2, gain = (balls.ball(M) for M in (p.A, p.B1, p.B2, F))
        C1, D11, D12 = (balls.ball(M) for M in (p.C1, p.D11, p.D12))
        return BallLoop(A + B2 * gain, B1, C1 + D12 * gain, D11)


def output_loop(p: PlantMatrices, K: Controller) -> BallLoop:
    """Return the loop of a dynamic controller in balls, for a plant without D22."""
    with balls.precision(BITS):
        A, B1, B2, C1, C2 = (balls.ball(M) for M in (p.A, p.B1, p.B2, p.C1, p.C2))
        D11, D12, D21 = (balls.ball(M) for M in (p.D11, p.D12, p.D21))
        Ak, Bk, Ck, Dk = (balls.ball(M) for M in K)
        return BallLoop(
            balls.block([[A + B2 * Dk * C2, B2 * Ck], [Bk * C2, Ak]]),
            balls.block([[B1 + B2 * Dk * D21], [Bk * D21]]),
            balls.block([[C1 + D12 * Dk * C2, D12 * Ck]]),
            D11 + D12 * Dk * D21,
        )


def uncertain_loop(system: UncertainSystem, nz: int, F: Matrix) -> UncertainSystem:
    """Return an uncertain system, its last inputs closed by u = F x, with its first outputs."""
    one = system.matrices
    n, inside = len(one.states), one.F.shape[1]
    seen = replace(
        one,
        H=np.vstack([one.H[:nz], np.eye(n, inside)]),
        J=np.vstack([one.J[:nz], np.zeros((n, one.J.shape[1]))]),
        outputs=(*system.output_labels[:nz], *(f"measured_{name}" for name in one.states)),
    )
    return UncertainSystem(seen).lft(F)
