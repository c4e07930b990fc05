"""Is a symmetric matrix positive definite? Decided exactly, for certificates."""

from __future__ import annotations

import numpy as np
from flint import fmpq_mat
from numpy.typing import ArrayLike

from robustpolish.exact.rational import rational
from robustpolish.validation import described, invalid, square


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
    >>> from robustpolish.analysis import is_positive_definite
    >>> is_positive_definite([[1.0, 1.0], [1.0, 1.0 + 2**-52]])
    True
    >>> is_positive_definite([[1.0, 1.0], [1.0, 1.0]])
    False
    """
    array = square("M", M)
    if not np.array_equal(array, array.T):
        gap = float(np.abs(array - array.T).max())
        raise invalid(
            "M",
            described(f"entries that differ by {gap:.3g} from their mirror images"),
            "a symmetric matrix",
            "Pass (M + M.T) / 2.",
        )
    return exactly_positive_definite(rational(array))


def exactly_positive_definite(M: fmpq_mat) -> bool:
    """Decide it for a symmetric rational matrix."""
    if M.nrows() == 0:
        return True
    coefficients = M.charpoly().coeffs()
    top = M.nrows()
    return all(c * (-1) ** (top - k) > 0 for k, c in enumerate(coefficients))
