"""Cubic B-splines on equally spaced knots: coefficients, and values in compiled code.

The spline through values at equally spaced places is twice continuously differentiable. At both
ends its third derivative is continuous across the first inner knot ("not a knot": C. de Boor, *A
Practical Guide to Splines*, ch. IV), so that cubics are reproduced to rounding.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from robustpolish.base.arrays import AnyArray as Array
from robustpolish.base.jit import njit

FEWEST = 4  # values that a cubic needs
HEADER = 7  # numbers before the coefficients of a packed surface

# Places in a packed surface.
X_START, Y_START, X_PER_CELL, Y_PER_CELL, ROWS, COLUMNS, BEND = range(HEADER)


def coefficients(values: Array) -> Array:
    """Return the coefficients of the spline through values along the first axis.

    Parameters
    ----------
    values : ndarray, shape (n, ...)
        At equally spaced places, n at least 4.

    Returns
    -------
    ndarray, shape (n + 2, ...)
        Those numbered i to i + 3 belong to the stretch between the places i and i + 1.

    Examples
    --------
    >>> import numpy as np
    >>> coefficients(np.arange(2.0, 6.0)).round(12).tolist()
    [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    """
    count = len(values)
    through = sparse.eye_array(count, count + 2) / 6
    through += sparse.eye_array(count, count + 2, k=1) * 4 / 6
    through += sparse.eye_array(count, count + 2, k=2) / 6
    end = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
    first = sparse.csr_array((end, (np.zeros(5, int), np.arange(5))), (1, count + 2))
    last = sparse.csr_array((end, (np.zeros(5, int), np.arange(count - 3, count + 2))), first.shape)
    system = sparse.vstack([first, through, last]).tocsc()
    nothing = np.zeros((1, *values.shape[1:]))
    known = np.concatenate([nothing, values, nothing])
    found = splu(system).solve(known.reshape(count + 2, -1))
    return found.reshape(known.shape)


@njit(cache=True, inline="always")
def weights(f):  # pragma: no cover - compiled
    """Return the weights of the four coefficients at the fraction f of a stretch."""
    g = 1.0 - f
    return (
        g * g * g / 6.0,
        ((3.0 * f - 6.0) * f * f + 4.0) / 6.0,
        ((3.0 * g - 6.0) * g * g + 4.0) / 6.0,
        f * f * f / 6.0,
    )


@njit(cache=True, inline="always")
def slope_weights(f):  # pragma: no cover - compiled
    """Return the derivatives of the weights by f."""
    g = 1.0 - f
    return -0.5 * g * g, (1.5 * f - 2.0) * f, (2.0 - 1.5 * g) * g, 0.5 * f * f


@njit(cache=True, inline="always")
def cell(place, start, per_cell, count):  # pragma: no cover - compiled
    """Return the stretch in which a place lies, and the fraction of it; clipped to the ends."""
    u = (place - start) * per_cell
    number = min(max(int(u), 0), int(count) - 4)
    return number, u - number


@njit(cache=True, inline="always")
def bend_weights(f):  # pragma: no cover - compiled
    """Return the second derivatives of the weights by f."""
    return 1.0 - f, 3.0 * f - 2.0, 1.0 - 3.0 * f, f


@njit(cache=True, error_model="numpy")
def expansion(x, y, packed):  # pragma: no cover - compiled
    """Return height [m], slopes along x and y, and f_xx, f_xy, f_yy [1/m] of a packed surface."""
    columns = int(packed[COLUMNS])
    by_x, by_y = packed[X_PER_CELL], packed[Y_PER_CELL]
    i, f = cell(x, packed[X_START], by_x, packed[ROWS])
    j, g = cell(y, packed[Y_START], by_y, packed[COLUMNS])
    a, rise, bow = weights(f), slope_weights(f), bend_weights(f)
    b, climb, bend = weights(g), slope_weights(g), bend_weights(g)
    height = slope_x = slope_y = xx = xy = yy = 0.0
    for m in range(4):
        p = HEADER + (i + m) * columns + j
        line = slope = curve = 0.0
        for n in range(4):
            line += b[n] * packed[p + n]
            slope += climb[n] * packed[p + n]
            curve += bend[n] * packed[p + n]
        height += a[m] * line
        slope_x += rise[m] * line
        slope_y += a[m] * slope
        xx += bow[m] * line
        xy += rise[m] * slope
        yy += a[m] * curve
    return height, slope_x * by_x, slope_y * by_y, xx * by_x**2, xy * by_x * by_y, yy * by_y**2


@njit(cache=True)
def expansions(x, y, packed):  # pragma: no cover - compiled
    """Return the same at many places, shape (6, places)."""
    found = np.zeros((6, x.size))
    for k in range(x.size):
        found[0, k], found[1, k], found[2, k], found[3, k], found[4, k], found[5, k] = expansion(
            x[k], y[k], packed
        )
    return found


def pack(x: Array, y: Array, found: Array) -> Array:
    """Return a surface as the one array that compiled code reads.

    Parameters
    ----------
    x, y : ndarray, shape (n,), (m,)
        Equally spaced places of the knots [m].
    found : ndarray, shape (n + 2, m + 2)
        Coefficients of the tensor product.

    Returns
    -------
    ndarray
        `HEADER` numbers, then the coefficients row by row. `BEND` is a bound of all second
        derivatives in any direction [1/m].
    """
    step_x, step_y = x[1] - x[0], y[1] - y[0]
    # Derivatives of a B-spline are averages of differences of its coefficients.
    bend = np.hypot(
        np.max(np.abs(np.diff(found, 2, axis=0))) / step_x**2,
        np.max(np.abs(np.diff(found, 2, axis=1))) / step_y**2,
    ) + np.max(np.abs(np.diff(np.diff(found, axis=0), axis=1))) / (step_x * step_y)
    header = [x[0], y[0], 1.0 / step_x, 1.0 / step_y, *found.shape, bend]
    return np.concatenate([header, found.ravel()])
