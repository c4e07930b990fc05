"""The linear matrix inequalities of state feedback in Y and M = F Y.

Equations (10.18), (10.19) for the H-infinity norm and (10.27), (10.28) for the H2 norm of the
thesis, their discrete-time counterparts (de Oliveira, Geromel, Bernussou, IJC 75, 2002), pole
regions and a bound on the gain. Everything is normalised so that the norm sought is about one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import linalg

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.synthesis.lmi.affine import Affine, symmetric_block
from robustpolish.synthesis.lmi.semidefinite import SemidefiniteProgram
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.problem.pole_regions import PoleRegion
from robustpolish.synthesis.state_search.policy import POLICY


def hinf_inequality(
    program: SemidefiniteProgram,
    p: PlantMatrices,
    Y: Affine,
    M: Affine,
    square: Affine,
    congruence: Matrix,
) -> None:
    """Require the squared H-infinity norm to be below `square`, a scalar expression.

    `congruence` multiplies the rows and columns of the states; it changes the numbers
    that the solver sees, not the set of solutions.
    """
    S, Z = p.A @ Y + p.B2 @ M, p.C1 @ Y + p.D12 @ M
    nw, nz = p.nw, p.nz
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
        # The negative of (10.19), with the sign of the rows of the states turned.
        rows = [
            [-(E.T @ (S + S.T) @ E), E.T @ p.B1, E.T @ Z.T],
            [bound, -p.D11.T],
            [np.eye(nz)],
        ]
    program.positive(symmetric_block(rows))


def h2_inequality(
    program: SemidefiniteProgram,
    p: PlantMatrices,
    Y: Affine,
    M: Affine,
    congruence: Matrix,
) -> Affine:
    """Return a scalar expression that is at least the squared H2 norm."""
    S, E = p.A @ Y + p.B2 @ M, congruence
    paid, free = _split_by_price(p)
    nw = p.nw
    Z = paid.C1 @ Y + paid.D12 @ M
    W = program.symmetric(paid.nz)
    if p.discrete:
        program.positive(
            symmetric_block([[E.T @ Y @ E, E.T @ S, E.T @ p.B1], [Y, None], [np.eye(nw)]])
        )
        program.positive(symmetric_block([[W, Z, paid.D11], [Y, None], [np.eye(nw)]]))
    else:
        lyapunov = -(E.T @ (S + S.T) @ E)
        program.positive(symmetric_block([[lyapunov, E.T @ p.B1], [np.eye(nw)]]))
        program.positive(symmetric_block([[W, Z], [Y]]))
    rest = (free.C1 @ Y @ free.C1.T).trace + np.trace(free.D11 @ free.D11.T)
    return W.trace + rest


def _split_by_price(
    p: PlantMatrices,
) -> tuple[PlantMatrices, PlantMatrices]:
    """Turn z so that u reaches only its first part: the rest of the trace is linear in Y.

    The condition stays (10.28); the solver has fewer and better scaled variables.
    """
    factors: Any = linalg.qr(p.D12, pivoting=True)
    Q, size = factors[0], np.abs(np.diag(factors[1]))
    rank = int(np.sum(size > np.finfo(float).eps * max(p.D12.shape) * size.max(initial=0.0)))
    turned = p.replace(C1=Q.T @ p.C1, D11=Q.T @ p.D11, D12=Q.T @ p.D12)

    def rows(part: slice) -> PlantMatrices:
        return turned.replace(C1=turned.C1[part], D11=turned.D11[part], D12=turned.D12[part])

    return rows(slice(0, rank)), rows(slice(rank, None))


def region_inequalities(
    program: SemidefiniteProgram,
    p: PlantMatrices,
    Y: Affine,
    M: Affine,
    regions: Sequence[PoleRegion],
) -> None:
    """Require the poles to lie in every one of `regions`, given in the problem's unit of time."""
    S = p.A @ Y + p.B2 @ M
    for region in regions:
        L = region.L + POLICY.region_margin * np.linalg.norm(region.L, 2) * np.eye(len(region.L))
        program.positive(region_matrix(L, region.M, Y, S))


def region_matrix(L: Matrix, M: Matrix, Y: Affine, S: Affine) -> Affine:
    """Return -(kron(L, Y) + kron(M, S) + kron(M, S)'), positive for poles in a region; S = A Y."""
    size = range(len(L))
    return symmetric_block(
        [[-(Y * L[i, j] + S * M[i, j] + S.T * M[j, i]) for j in size[i:]] for i in size]
    )


def gain_inequality(
    program: SemidefiniteProgram,
    Y: Affine,
    M: Affine,
    square: Affine,
    left: Matrix,
    right: Matrix,
) -> None:
    """Require the largest singular value of left M inv(Y) right to be below sqrt(square).

    The exact condition contains Y H Y with H = inv(right right'), which is convex in Y on
    the wrong side; its tangent at Y = I lies below it, hence the condition is sufficient, and
    exact at Y = I. The rows are multiplied by right', which leaves the gain off the diagonal.
    """
    similar = np.linalg.inv(right) @ Y @ right
    tangent = similar + similar.T - np.eye(right.shape[1])
    program.positive(
        symmetric_block([[square.times(np.eye(left.shape[0])), left @ M @ right], [tangent]])
    )
