"""The linear matrix inequalities of state feedback in Y and M = F Y.

Equations (10.18), (10.19) for the H-infinity norm and (10.27), (10.28) for the H2 norm of the
thesis, their discrete-time counterparts (de Oliveira, Geromel, Bernussou, IJC 75, 2002), pole regions
and a bound on the gain. Everything is normalised so that the norm sought is about one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robustpolish.synthesis.affine import Affine, symmetric_block
from robustpolish.synthesis.full_state.problem import StateFeedbackProblem
from robustpolish.synthesis.pole_regions import PoleRegion
from robustpolish.synthesis.semidefinite import SemidefiniteProgram

Matrix = NDArray[np.float64]

# Poles are asked to lie inside their region by this share of its size, so that
# rounding errors of the solver leave them inside.
_REGION_MARGIN = 1e-6


def hinf_inequality(
    program: SemidefiniteProgram,
    p: StateFeedbackProblem,
    Y: Affine,
    M: Affine,
    square: Affine,
    congruence: Matrix,
) -> None:
    """Require the squared H-infinity norm to be below `square`, a scalar expression.

    `congruence` multiplies the rows and columns of the states; it changes the numbers
    that the solver sees, not the set of solutions.
    """
    S, Z = p.A @ Y + p.B2 @ M, p.C @ Y + p.D12 @ M
    nw, nz = p.B1.shape[1], p.C.shape[0]
    E = congruence
    bound = square.times(np.eye(nw))
    if p.discrete:
        rows = [
            [E.T @ Y @ E, E.T @ S, E.T @ p.B1, None],
            [Y, None, Z.T],
            [bound, p.D11.T],
            [np.eye(nz)],
        ]
    else:
        rows = [
            [-(E.T @ (S + S.T) @ E), E.T @ p.B1, E.T @ Z.T],
            [bound, p.D11.T],
            [np.eye(nz)],
        ]
    program.positive(symmetric_block(rows))


def h2_inequality(
    program: SemidefiniteProgram,
    p: StateFeedbackProblem,
    Y: Affine,
    M: Affine,
    congruence: Matrix,
) -> Affine:
    """Return a scalar expression that is at least the squared H2 norm."""
    S, Z = p.A @ Y + p.B2 @ M, p.C @ Y + p.D12 @ M
    nw, nz = p.B1.shape[1], p.C.shape[0]
    E = congruence
    W = program.symmetric(nz)
    if p.discrete:
        program.positive(
            symmetric_block([[E.T @ Y @ E, E.T @ S, E.T @ p.B1], [Y, None], [np.eye(nw)]])
        )
        program.positive(symmetric_block([[W, Z, p.D11], [Y, None], [np.eye(nw)]]))
    else:
        lyapunov = -(E.T @ (S + S.T) @ E)
        program.positive(symmetric_block([[lyapunov, E.T @ p.B1], [np.eye(nw)]]))
        program.positive(symmetric_block([[W, Z], [Y]]))
    return W.trace


def region_inequalities(
    program: SemidefiniteProgram,
    p: StateFeedbackProblem,
    Y: Affine,
    M: Affine,
    regions: Sequence[PoleRegion],
) -> None:
    """Require the poles to lie in every one of `regions`, given in the problem's unit of time."""
    S = p.A @ Y + p.B2 @ M
    for region in regions:
        L = region.L + _REGION_MARGIN * np.linalg.norm(region.L, 2) * np.eye(len(region.L))
        blocks = [
            [-(Y * L[i, j] + S * region.M[i, j] + S.T * region.M[j, i]) for j in range(i, len(L))]
            for i in range(len(L))
        ]
        program.positive(symmetric_block(blocks))


def gain_inequality(
    program: SemidefiniteProgram,
    Y: Affine,
    M: Affine,
    square: Affine,
    left: Matrix,
    right: Matrix,
    around: Matrix,
) -> None:
    """Require the largest singular value of left M inv(Y) right to be below sqrt(square).

    The exact condition contains Y H Y with H = inv(right right'), which is convex in Y on
    the wrong side; its tangent at Y = `around` lies below it, hence the condition is sufficient,
    and exact at Y = `around`.
    """
    H = np.linalg.inv(right @ right.T)
    tangent = Y @ (H @ around) + (around @ H) @ Y - around @ H @ around
    program.positive(symmetric_block([[square.times(np.eye(left.shape[0])), left @ M], [tangent]]))
