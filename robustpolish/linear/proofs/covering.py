"""Intervals of frequency on which a Hamiltonian matrix has no eigenvalue on the imaginary axis.

What holds at one frequency and is singular at eigenvalues on the axis alone holds up to the nearest
of these. Gershgorin discs in a basis of eigenvectors, in ball arithmetic, enclose all of them.
"""

from __future__ import annotations

import math

import flint
import numpy as np

from robustpolish.base.arrays import AnyMatrix, Matrix, Vector
from robustpolish.linear.arithmetic.balls import Ball, complex_ball, midpoint

# What the ends of discs are moved outwards, relative, for their rounding to doubles.
_ROUNDING = 1e-14
# Relative length of an interval that is worth eigenvectors of more digits.
_SHORT = 0.1


def interval_without_eigenvalues(H: Ball, omega: float) -> tuple[float, float] | None:
    """Return the ends of an interval around a frequency where no eigenvalue is on the axis.

    Parameters
    ----------
    H : flint.acb_mat
        A Hamiltonian matrix.
    omega : float
        In rad/s; infinity is allowed.

    Returns
    -------
    (float, float) or None
        From 0 to infinity; None where a disc holds the frequency itself.

    Raises
    ------
    ZeroDivisionError, ValueError, numpy.linalg.LinAlgError
        If there are no eigenvectors that can be inverted.
    """
    found = _clear(*gershgorin_discs(H, _double_basis(H)), omega)
    if found is None or found[1] - found[0] < _SHORT * found[0]:
        found = _clear(*gershgorin_discs(H, H.eig(right=True, algorithm="approx")[1]), omega)
    return found


def _clear(centres: AnyMatrix, radii: Vector, omega: float) -> tuple[float, float] | None:
    """Return the frequencies around one that no disc touches."""
    near = np.abs(np.real(centres)) <= radii
    reach = radii[near] + _ROUNDING * np.abs(centres[near])
    heights = np.imag(centres)[near]
    low, high = heights - reach, heights + reach
    if not np.isfinite(low).all() or ((low <= omega) & (omega <= high)).any():
        return None
    below, above = high[high < omega], low[low > omega]
    return (
        max(0.0, math.nextafter(float(below.max(initial=-1.0)), math.inf)),
        math.nextafter(float(above.min()), 0.0) if above.size else math.inf,
    )


def gershgorin_discs(H: Ball, basis: Ball) -> tuple[AnyMatrix, Vector]:
    """Return discs that hold all eigenvalues of a matrix, by Gershgorin in a basis."""
    turned = basis.solve(H * basis)
    n = turned.nrows()
    centres = np.diagonal(midpoint(turned)).copy()
    radii = np.zeros(n)
    for i in range(n):
        rest = sum((abs(turned[i, j]) for j in range(n) if j != i), flint.arb(0))
        rest += abs(turned[i, i] - turned[i, i].mid())
        radii[i] = float(rest.abs_upper()) * (1 + _ROUNDING)
    return centres, radii + _ROUNDING * np.abs(centres)


def _double_basis(H: Ball) -> Ball:
    """Return the eigenvectors in double precision: quick, and good enough for most."""
    balanced, units = _balanced(midpoint(H))
    vectors = np.linalg.eig(balanced)[1] * units[:, None]
    return complex_ball(vectors / np.linalg.norm(vectors, axis=0))


def _balanced(H: AnyMatrix) -> tuple[AnyMatrix, Matrix]:
    """Return H in units of its states and co-states that make its halves alike, and the units."""
    n = len(H) // 2
    up, down = np.linalg.norm(H[:n, n:]), np.linalg.norm(H[n:, :n])
    ratio = math.sqrt(up / down) if up > 0 and down > 0 else 1.0
    units = np.concatenate([np.full(n, 1.0), np.full(n, 1 / ratio)])
    return H * units / units[:, None], units
