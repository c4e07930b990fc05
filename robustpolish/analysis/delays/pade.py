"""The Pade approximation of a delay, as a chain of sections that pass all frequencies."""

from __future__ import annotations

import math

import numpy as np

from robustpolish.arrays import Matrix
from robustpolish.validation import invalid, is_whole, positive

MOST_ORDER = 20
"""Beyond it the coefficients of the Pade polynomials no longer tell their roots."""


def pade(seconds: float, order: int) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Return A, B, C, D of the Pade approximation of a delay, numerator as long as denominator.

    Its gain is 1 at all frequencies, as that of the delay; its phase is right up to about `order`
    radians of delay.

    Parameters
    ----------
    seconds : float
        Above 0.
    order : int
        1 to 20: states.

    Returns
    -------
    A, B, C, D : ndarray
        Sections of first and second order, each balanced and lossless.

    Raises
    ------
    InvalidInputError
        If delay or order are out of range.

    Examples
    --------
    >>> A, B, C, D = pade(0.5, 1)
    >>> print(A, B @ C, D)
    [[-4.]] [[8.]] [[-1.]]
    """
    seconds = positive("seconds", seconds, "s")
    if not is_whole(order) or not 1 <= order <= MOST_ORDER:
        want = f"a whole number from 1 to {MOST_ORDER}"
        raise invalid("order", order, want, "3 is right up to a phase of 3 rad of the delay.")
    A, B, C, D = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.ones((1, 1))
    for a, b, c, d in _sections(int(order)):
        n, k = len(A), len(a)
        A = np.block([[A, np.zeros((n, k))], [b @ C, a]])
        B = np.vstack([B, b @ D])
        C = np.hstack([d @ C, c])
        D = d @ D
    return A / seconds, B / math.sqrt(seconds), C / math.sqrt(seconds), D


def _sections(order: int) -> list[tuple[Matrix, Matrix, Matrix, Matrix]]:
    """Return lossless sections for the delay 1, one per real root or pair of roots."""
    f = math.factorial
    # Ascending: the sum of (2n - k)! n! / ((2n)! k! (n - k)!) s^k.
    coefficients = [
        f(2 * order - k) * f(order) / (f(2 * order) * f(k) * f(order - k)) for k in range(order + 1)
    ]
    roots = np.roots(coefficients[::-1])
    found = []
    for root in sorted(roots, key=abs):
        if abs(root.imag) < 1e-9 * abs(root):
            a, r = -root.real, math.sqrt(-2 * root.real)
            found.append(tuple(np.array([[v]]) for v in (-a, r, r, -1.0)))
        elif root.imag > 0:
            size, a = abs(root), -2 * root.real
            r = math.sqrt(2 * a)
            found.append(
                (
                    np.array([[0.0, size], [-size, -a]]),
                    np.array([[0.0], [r]]),
                    np.array([[0.0, -r]]),
                    np.ones((1, 1)),
                )
            )
    return found
