"""One beam element in one plane: its shapes, and the matrices that follow from them.

The element has the deflections and slopes of its two ends, (w_1, a_1, w_2, a_2), a = dw/ds of the
cross-section. The shear parameter phi = 12 E I / (kappa G A l^2) makes it a Timoshenko element;
phi = 0 is Euler and Bernoulli's.

Where shear counts, the shapes of the ends alone converge with the square of the length only: of
short elements they become straight lines. So a Timoshenko element has two coordinates more, a
parabola of deflection and one of slope that vanish at both ends; then both converge with the
fourth power. Loads at the ends do not bend these shapes, so that statics stay exact.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import block_diag

from robustpolish.arrays import Matrix, Vector

# Four points integrate polynomials of degree 7; the products of two shapes have degree 6.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(4)


def shapes(share: float, length: float, phi: float) -> tuple[Vector, Vector]:
    """Return how deflection and slope at a point follow from those of the ends.

    They satisfy the static beam equations exactly, so that loads at the ends deflect the element
    as the theory says, however long it is.

    Parameters
    ----------
    share : float
        Where, from 0 at the first end to 1 at the second.
    length : float
        In m.
    phi : float
        Shear parameter.

    Returns
    -------
    deflection, slope : ndarray, shape (4,)
        The slope is that of the cross-section; shear makes the axis steeper.

    References
    ----------
    Nelson (1980), A finite rotating shaft element using Timoshenko beam theory, J. Mech. Design
    102, 793-803; Przemieniecki (1968), Theory of matrix structural analysis, McGraw-Hill.

    Examples
    --------
    >>> deflection, slope = shapes(0.5, 0.3, 0.0)
    >>> deflection.round(4).tolist(), slope.round(4).tolist()
    ([0.5, 0.0375, 0.5, -0.0375], [-5.0, -0.25, 5.0, -0.25])
    """
    x, left = share, 1.0 - share
    deflection = np.array(
        [
            1 + phi - phi * x - 3 * x**2 + 2 * x**3,
            length * x * left * (left + phi / 2),
            phi * x + 3 * x**2 - 2 * x**3,
            -length * x * left * (x + phi / 2),
        ]
    )
    slope = np.array(
        [
            -6 * x * left / length,
            left * (1 + phi - 3 * x),
            6 * x * left / length,
            x * (3 * x - 2 + phi),
        ]
    )
    return deflection / (1 + phi), slope / (1 + phi)


def motion(share: float, length: float, phi: float) -> tuple[Vector, Vector]:
    """Return how deflection and slope follow from all coordinates, the inner ones last.

    Parameters
    ----------
    share, length, phi : float
        As of :func:`shapes`.

    Returns
    -------
    deflection, slope : ndarray, shape (4,), or (6,) with shear
    """
    deflection, slope = shapes(share, length, phi)
    if phi == 0:
        return deflection, slope
    inner = 4 * share * (1.0 - share)
    return np.append(deflection, [inner, 0.0]), np.append(slope, [0.0, inner])


def stiffness(length: float, bending: float, phi: float) -> Matrix:
    """Return the stiffness matrix, shape (4, 4), or (6, 6) with shear.

    Parameters
    ----------
    length : float
    bending : float
        E I in N m^2.
    phi : float

    Returns
    -------
    ndarray
        In N/m, N and N m.
    """
    s = length
    rows = [
        [12, 6 * s, -12, 6 * s],
        [6 * s, (4 + phi) * s**2, -6 * s, (2 - phi) * s**2],
        [-12, -6 * s, 12, -6 * s],
        [6 * s, (2 - phi) * s**2, -6 * s, (4 + phi) * s**2],
    ]
    ends = bending / ((1 + phi) * s**3) * np.array(rows)
    if phi == 0:
        return ends
    shear = 12 * bending / (phi * s**2)  # kappa G A
    inner = 16 / (3 * s) * np.array([shear, bending + shear * s**2 / 10])
    return np.asarray(block_diag(ends, np.diag(inner)))


def inertia(length: float, line_mass: float, line_inertia: float, phi: float) -> Matrix:
    """Return the consistent mass matrix: what moves, and what turns with the cross-sections.

    Parameters
    ----------
    length : float
    line_mass : float
        Mass per length in kg/m.
    line_inertia : float
        Moment of inertia about a diameter per length, in kg m.
    phi : float

    Returns
    -------
    ndarray, shape (4, 4), or (6, 6) with shear
    """
    size = 4 if phi == 0 else 6
    total = np.zeros((size, size))
    for point, weight in zip(_POINTS, _WEIGHTS, strict=True):
        deflection, slope = motion((1 + point) / 2, length, phi)
        total += weight * line_mass * np.outer(deflection, deflection)
        total += weight * line_inertia * np.outer(slope, slope)
    return length / 2 * total
