"""A loop with one real number only, however often repeated: its margin exactly, with a proof.

Poles leave the stable half-plane through the axis, where the sum of two of them is 0. With X of
the Lyapunov operator and Y = k (C X + D Y), that is an eigenvalue 1 / k of a matrix that does not
depend on k; and the loop stays well posed unless 1 / k is an eigenvalue of D. Discs of ball
arithmetic that hold all eigenvalues show that there is no real one beyond a number.
"""

from __future__ import annotations

import flint
import numpy as np

from robustpolish.exact.balls import identity, part, precision
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.proof import Ball, complex_ball, discs

_BITS = 240
# Rows of the matrix up to which it is worth while: balls of 60 x 60 take about a second.
_ROWS = 60
_STATES = 14
# What the proven size is smaller than the one of the witness, relative.
_SLACK = 1e-10


def proven_size(loop: LoopModel, size: float) -> float | None:
    """Return the size of the number below which the loop is proven to be stable.

    Parameters
    ----------
    loop : LoopModel
        Stable and continuous.
    size : float
        Of the smallest number that is known to make it unstable.

    Returns
    -------
    float or None
        Just below `size`; None if there are other blocks, the loop is too large, or there is no
        proof.
    """
    blocks, n = loop.structure.blocks, loop.model.states
    if len(blocks) != 1 or blocks[0].kind != "real" or not 0 < n <= _STATES:
        return None
    if blocks[0].copies * n > _ROWS:
        return None
    least = size * (1 - _SLACK)
    with precision(_BITS):
        try:
            operator, D = _operator(loop)
            clear = all(_no_real_beyond(M, 1 / least) for M in (operator, D))
        except (ZeroDivisionError, ValueError, np.linalg.LinAlgError):
            return None
    return least if clear else None


def _operator(loop: LoopModel) -> tuple[Ball, Ball]:
    """Return the matrix from Y to C X + D Y with A X + X A' = -(B Y + Y' B'), and D."""
    A, B, C, D = loop.balls
    n = A.nrows()
    one = identity(n)
    forward = _product(B, one)
    swapped = [j * n + i for i in range(n) for j in range(n)]
    turned = part(forward, swapped, range(forward.ncols()))
    X = (_product(A, one) + _product(one, A)).solve(forward + turned)
    return flint.acb_mat(_product(D, one) - _product(C, one) * X), flint.acb_mat(D)


def _product(left: Ball, right: Ball) -> Ball:
    """Return the Kronecker product."""
    shape = left.nrows() * right.nrows(), left.ncols() * right.ncols()
    rows = [[a * b for a in one for b in two] for one in left.tolist() for two in right.tolist()]
    return flint.arb_mat(*shape, [entry for row in rows for entry in row])


def _no_real_beyond(matrix: Ball, limit: float) -> bool:
    """Prove that no real eigenvalue has a size of a limit or more."""
    if not any(entry != 0 for entry in matrix.entries()):
        return True
    vectors = matrix.eig(right=True, algorithm="approx")[1]
    try:
        centres, radii = discs(matrix, vectors)
    except ZeroDivisionError:  # eigenvectors that are the same: any size below the norm will do
        centres, radii = discs(matrix, complex_ball(np.eye(matrix.nrows())))
    real = np.abs(np.imag(centres)) <= radii
    return bool((np.abs(np.real(centres[real])) + radii[real] < limit).all())
