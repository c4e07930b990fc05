"""Positive definite matrices: decided for rational numbers, proven for balls, real or complex."""

from __future__ import annotations

from typing import Any

import flint
import numpy as np
from numpy.typing import ArrayLike

from robustpolish.base.budget import check_deadline
from robustpolish.base.checks import described, invalid, square
from robustpolish.linear.arithmetic import balls
from robustpolish.linear.arithmetic.rational import rational

# Beside the strongest direction, doubles see those above this; a pass of the proof of definiteness
# brings up the weaker ones by its inverse, about so many bits.
_WEAK = 1e-13
_BITS_PER_PASS = 40


def is_positive_definite(M: ArrayLike) -> bool:
    r"""Decide without rounding whether a symmetric matrix is positive definite.

    The eigenvalues are real, so by Descartes' rule of signs all are positive exactly if the
    coefficients of the characteristic polynomial alternate in sign; they are computed in
    rational arithmetic. There is no tolerance: a singular matrix is not definite.

    Parameters
    ----------
    M : array_like, shape (n, n)
        Symmetric to the last bit.

    Returns
    -------
    bool
        True for n = 0.

    Raises
    ------
    InvalidInputError
        If it is not square, not finite or not symmetric.

    Examples
    --------
    >>> from robustpolish.linear import is_positive_definite
    >>> is_positive_definite([[1.0, 1.0], [1.0, 1.0 + 2**-52]])
    True
    >>> is_positive_definite([[1.0, 1.0], [1.0, 1.0]])
    False
    """
    array = square("M", M)
    if not np.array_equal(array, array.T):
        gap = float(np.abs(array - array.T).max())
        shown = described(f"entries that differ by {gap:.3g} from their mirror images")
        raise invalid("M", shown, "a symmetric matrix", "Pass (M + M.T) / 2.")
    return is_definite(rational(array))


def is_definite(matrix: Any) -> bool:
    """Prove that a symmetric or Hermitian matrix is positive definite.

    Parameters
    ----------
    matrix : flint.fmpq_mat, flint.arb_mat or flint.acb_mat
        Rational numbers decide it. Balls hold many matrices, of which all are meant.

    Returns
    -------
    bool
        True is a proof. False says of balls only that no proof was found.

    Notes
    -----
    Balls: M > 0 follows from G M G' > 0 for any square G, whatever it is. G is made of the
    eigenvectors of M in doubles and turns M into a matrix near the identity, up to directions that
    are too weak beside the others for doubles; in these it is repeated. A matrix whose distance
    from the identity has a row-sum norm below one is positive definite.
    """
    n = matrix.nrows()
    if isinstance(matrix, flint.fmpq_mat):
        coefficients = matrix.charpoly().coeffs() if n else []
        return all(c * (-1) ** (n - k) > 0 for k, c in enumerate(coefficients))
    if isinstance(matrix, flint.acb_mat):  # H > 0 just if [[Re H, -Im H], [Im H, Re H]] > 0
        table = matrix.tolist()
        real, imag = (
            flint.arb_mat(n, n, [getattr(entry, part) for row in table for entry in row])
            for part in ("real", "imag")
        )
        matrix, n = balls.symmetric(balls.block([[real, -imag], [imag, real]])), 2 * n
    diagonal = np.array([float(matrix[i, i].lower()) for i in range(n)])
    if not (np.isfinite(diagonal).all() and (diagonal > 0).all()):
        return False
    # Powers of two bring the diagonal to about one without rounding.
    scale = np.exp2(-np.round(np.log2(diagonal) / 2))
    turned = balls.scaled(matrix, scale, scale)
    for _ in range(flint.ctx.prec // _BITS_PER_PASS + 1 if n else 0):
        check_deadline()
        centre = balls.midpoint(turned)
        if not np.isfinite(centre).all():
            return False
        values, vectors = np.linalg.eigh((centre + centre.T) / 2)
        if values[0] < -100 * _WEAK * values[-1]:
            return False
        G = balls.ball((vectors / np.sqrt(np.maximum(values, _WEAK * values[-1]))).T)
        turned = G * turned * G.transpose()
        rest = balls.magnitude(balls.identity(n) - turned)
        # The factor covers the rounding errors of the sums, which are taken in doubles.
        if np.isfinite(rest).all() and (rest.sum(axis=1) * (1 + 1e-12)).max() < 1:
            return True
    return n == 0
