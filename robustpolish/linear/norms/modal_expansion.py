"""The inverse of the eigenvectors, and what it makes of inputs and outputs, compiled."""

from __future__ import annotations

import numpy as np

from robustpolish.base.arrays import EPS, ROUNDING
from robustpolish.base.jit import njit

# Pieces of the frequency axis that are as long as the distance to the nearest pole lets them.

# A piece from sinh(k STEP) to sinh((k + 1) STEP) is at most 0.46 times as long to either side of
# its middle as the middle is away from a pole beside zero, one unit from the axis.
_STEP = 0.9
FAR = 4.0
"""Beyond so many times the largest pole, the response is expanded about infinity."""


@njit(cache=True, error_model="numpy")
def first_pieces(real, imag):  # type: ignore[no-untyped-def]  # compiled
    """Return middles and half lengths of pieces that cover 0 to FAR times the largest pole.

    They are short beside poles near the axis and grow with the distance from these, so that a
    power series about the middle of each converges quickly.

    Parameters
    ----------
    real, imag : ndarray, shape (n,)
        Of the poles, by rising imaginary part.
    """
    marks, scales, count = _marks(real, imag)
    total = 0
    for k in range(count - 1):
        one, other = _steps(marks, scales, count, k)
        total += one + other
    edges = np.empty(total + 1)
    edges[0], size = marks[0], 1
    for k in range(count - 1):
        left, right = marks[k], marks[k + 1]
        one, other = _steps(marks, scales, count, k)
        middle = right if other == 0 else 0.5 * (left + right)
        reach = np.arcsinh((middle - left) / scales[k])
        for number in range(1, one + 1):
            edges[size] = left + scales[k] * np.sinh(number * reach / one)
            size += 1
        if other > 0:
            reach = np.arcsinh((right - middle) / scales[k + 1])
            for number in range(other - 1, -1, -1):
                edges[size] = right - scales[k + 1] * np.sinh(number * reach / other)
                size += 1
    edges[total] = marks[count - 1]
    return _between(edges)


@njit(cache=True, error_model="numpy")
def _between(edges):  # type: ignore[no-untyped-def]  # compiled
    """Return the pieces between edges that rise, and the one from below zero to the first."""
    centre, half = np.empty(edges.size), np.empty(edges.size)
    centre[0], half[0] = 0.0, edges[0] * (1.0 + 1e-15)
    count, start = 1, edges[0]
    for k in range(1, edges.size):
        if edges[k] - start > 1e-12 * edges[k] or k == edges.size - 1:
            centre[count], half[count] = overlapping(start, edges[k])
            count, start = count + 1, edges[k]
    return centre, half, count


@njit(cache=True, error_model="numpy")
def _marks(real, imag):  # type: ignore[no-untyped-def]  # compiled
    """Return the heights of the poles with the two ends, the distances from the nearest, a count.

    Poles come in pairs, so that those of the lower half plane tell nothing new.
    """
    n = real.size
    furthest, nearest = 0.0, np.inf
    for i in range(n):
        size = np.hypot(real[i], imag[i])
        furthest, nearest = max(furthest, size), min(nearest, size)
    marks, scales = np.empty(n + 2), np.empty(n + 2)
    marks[0], scales[0], count = 0.45 * nearest, nearest, 1
    for k in range(n):
        height = imag[k]
        if height > 1.5 * marks[0] and height > marks[count - 1]:
            square = np.inf
            for i in range(n):
                away = height - imag[i]
                square = min(square, real[i] * real[i] + away * away)
            marks[count], scales[count] = height, max(np.sqrt(square), 1e-300)
            count += 1
    marks[count], scales[count] = FAR * furthest, np.inf
    return marks, scales, count + 1


@njit(cache=True, error_model="numpy")
def _steps(marks, scales, count, k):  # type: ignore[no-untyped-def]  # compiled
    """Return the numbers of steps away from a mark, and towards the next one from half way."""
    length = marks[k + 1] - marks[k]
    if k == count - 2:
        return max(int(np.ceil(np.arcsinh(length / scales[k]) / _STEP)), 1), 0
    one = np.ceil(np.arcsinh(0.5 * length / scales[k]) / _STEP)
    other = np.ceil(np.arcsinh(0.5 * length / scales[k + 1]) / _STEP)
    return max(int(one), 1), max(int(other), 1)


@njit(cache=True, error_model="numpy")
def overlapping(left, right):  # type: ignore[no-untyped-def]  # compiled
    """Return middle and half length of a piece that reaches at least from `left` to `right`."""
    centre = 0.5 * (left + right)
    half = 0.5 * (right - left)
    return centre, half * (1.0 + 1e-15) + 1e-15 * abs(centre)


# Power series of the response about the middles of pieces of the axis, with their errors.

ORDER = 8
"""Number of terms."""
# Half lengths over the distance to the nearest pole; beyond, the series are not used.
_LONGEST = 0.55


@njit(cache=True, error_model="numpy")
def expand(modes, centre, half, terms):  # type: ignore[no-untyped-def]  # compiled
    """Expand the response: G(c + h t) = sum of terms[j] t^j + a rest, for t from -1 to 1.

    Parameters
    ----------
    modes : ModalForm
    centre, half : float
        c and h.
    terms : ndarray of complex, shape (ORDER, p, m)
        Overwritten.
    """
    terms[:] = 0.0
    terms[0] = modes.D
    flat = terms.reshape(ORDER, modes.D.size)
    step = complex(0.0, -half)
    for i in range(modes.real.size):
        power = 1.0 / complex(-modes.real[i], (centre - modes.high[i]) - modes.low[i])
        factor = power * step
        for j in range(ORDER):
            for k in range(flat.shape[1]):
                flat[j, k] += power * modes.residues[i, k]
            power = power * factor


@njit(cache=True, error_model="numpy")
def expansion_error(modes, centre, half, gain):  # type: ignore[no-untyped-def]  # compiled
    """Bound what :func:`expand` leaves out on a piece.

    These are the rest of the series, the errors of poles and vectors, and rounding.

    Parameters
    ----------
    modes : ModalForm
    centre, half : float
    gain : float
        What is tiny beside it may be bounded coarsely; zero for the sharpest bound.

    Returns
    -------
    error : float
        Infinite where the piece is too long for the series.
    gain : float
        No gain on the piece is larger, by the sizes and distances of the modes alone.
    """
    n = modes.real.size
    nearest = np.empty(n)
    rest, size = 0.0, modes.D_size
    for i in range(n):
        near = 1.0 / np.hypot(modes.real[i], (centre - modes.high[i]) - modes.low[i])
        share = half * near
        if not share <= _LONGEST:
            return np.inf, np.inf
        nearest[i] = near / (1.0 - share)
        fourth = (share * share) * (share * share)
        rest += nearest[i] * fourth * fourth * modes.sizes[i]
        size += nearest[i] * modes.sizes[i]
    weight = np.hypot(1.0, centre) + half if modes.discrete else 1.0
    error = _error_of_modes(modes, nearest, weight, gain)
    return rest + error, (size + error) * (1.0 + 1e-9)


@njit(cache=True, error_model="numpy")
def expand_far(modes, start, terms):  # type: ignore[no-untyped-def]  # compiled
    """Expand the response in t = start/x from `start` on, at least FAR times the largest pole.

    Returns
    -------
    float
        Bound of what is left out.
    """
    terms[:] = 0.0
    terms[0] = modes.D
    n, flat = modes.real.size, terms.reshape(ORDER, modes.D.size)
    nearest, rest = np.empty(n), 0.0
    for i in range(n):
        nearest[i] = FAR / (FAR - 1.0) / start * (1.0 + 1e-9)
        ratio = complex(modes.real[i], modes.high[i]) / complex(0.0, start)
        power = 1.0 / complex(0.0, start)
        for j in range(1, ORDER):
            for k in range(flat.shape[1]):
                flat[j, k] += power * modes.residues[i, k]
            power = power * ratio
        rest += nearest[i] * modes.sizes[i] * np.hypot(ratio.real, ratio.imag) ** (ORDER - 1)
    # Within the weight of discrete time, |1 - i x| <= 1 + x, x cancels the x of the distance.
    weight = 1.0 + start if modes.discrete else 1.0
    return rest + _error_of_modes(modes, nearest, weight, 0.0)


@njit(cache=True, error_model="numpy")
def _error_of_modes(modes, nearest, weight, gain):  # type: ignore[no-untyped-def]  # compiled
    """Bound rounding and what the errors of the modal form do, within a piece.

    With E the diagonal matrix of 1/|z - eigenvalue|, the solution w of (1 - E F) w = E b is at
    most E |b| plus the row sums of E F times the largest entry of w, and what F changes in the
    response is |c| E F w.
    """
    n = nearest.size
    rounding, signals, share, largest = 0.0, 0.0, 0.0, 0.0
    for i in range(n):
        rounding += nearest[i] * modes.sizes[i]
        E = nearest[i] * modes.stretch[i] * weight
        signals += E * modes.signal_errors[i]
        share = max(share, E * modes.rows[i])
        largest = max(largest, E * modes.moved[i])
    if not share < 0.5:
        return np.inf
    largest /= 1.0 - share
    w = np.empty(n)
    most, coarse = 0.0, 0.0
    for i in range(n):
        E = nearest[i] * modes.stretch[i] * weight
        w[i] = E * modes.moved[i] + E * modes.rows[i] * largest
        most = max(most, w[i])
        coarse += E * modes.shown[i] * modes.rows[i]
    coupled = coarse * most  # the row sums stand for the rows
    # An error this small beside the gain that is sought may be bounded more coarsely.
    if not coupled <= ROUNDING * gain:
        coupled = 0.0
        alone = modes.coupling.shape[0] == 1
        for i in range(n):
            if alone:
                inner = modes.coupling[0, i] * w[i]
            else:
                inner = 0.0
                for j in range(n):
                    inner += modes.coupling[i, j] * w[j]
            coupled += nearest[i] * modes.stretch[i] * weight * modes.shown[i] * inner
    rounding = EPS * (4 * n + 256) * rounding + EPS * modes.D_size
    return (rounding + modes.D_error + coupled + signals) * (1.0 + 1e-9)


@njit(cache=True, error_model="numpy")
def inverse(left, right):  # type: ignore[no-untyped-def]  # compiled
    """Return X, nearly the inverse of the right vectors V.

    Parameters
    ----------
    left, right : ndarray of complex, shape (n, n)
        Vectors of length one, in the rows.

    Returns
    -------
    X : ndarray of complex, shape (n, n)
    gap : float
        Bound of the row-sum norm of 1 - X V, but for the last digits of the sums. It is no number
        where X is none.
    least : float
        The least cosine between vectors of a pair.
    """
    n = left.shape[0]
    X, least = np.conj(left), np.inf
    for i in range(n):
        cosine = complex(0.0, 0.0)
        for j in range(n):
            cosine += X[i, j] * right[i, j]
        least = min(least, abs(cosine))
        if cosine == 0.0:  # numba would raise an error
            X[i] = np.nan
        else:
            X[i] /= cosine
    return X, _gap(X, right), least


@njit(cache=True, error_model="numpy")
def _gap(X, right):  # type: ignore[no-untyped-def]  # compiled
    n = X.shape[0]
    product = X @ right.T
    sums = np.zeros(n)
    for k in range(n):
        for j in range(n):
            sums[j] += abs(right[k, j])
    largest = 0.0
    for i in range(n):
        off, size = 0.0, 0.0
        for j in range(n):
            off += abs(product[i, j] - (1.0 if i == j else 0.0))
            size += abs(X[i, j]) * sums[j]
        row = off + 4.0 * (n + 4) * EPS * size
        if row > largest or row != row:
            largest = row
    return largest


@njit(cache=True, error_model="numpy")
def signals(X, right, B, C):  # type: ignore[no-untyped-def]  # compiled
    """Return X B after one correction and C V, with estimates of what rounding made of them.

    Parameters
    ----------
    X, right : ndarray of complex, shape (n, n)
    B, C : ndarray of complex, shapes (n, m) and (p, n)

    Returns
    -------
    b, c : ndarray of complex, shapes (n, m) and (p, n)
    b_error, c_error : ndarray, shape (n,)
        Of the rows of b and of the columns of c.
    """
    V = right.T
    b = X @ B
    b = b + X @ (B - V @ b)
    few = 4.0 * EPS * np.sqrt(X.shape[0])
    b_error, whole = np.empty(X.shape[0]), few * frobenius(B)
    for i in range(X.shape[0]):
        b_error[i] = whole * frobenius(X[i : i + 1])
    return b, C @ V, b_error, np.full(X.shape[0], few * frobenius(C))


@njit(cache=True, error_model="numpy")
def products(b, c, b_error, c_error, outward):  # type: ignore[no-untyped-def]  # compiled
    """Return what each mode carries from the inputs to the outputs, with bounds.

    Parameters
    ----------
    b, c : ndarray of complex, shapes (n, m) and (p, n)
    b_error, c_error : ndarray, shape (n,)
        Of the rows of b and of the columns of c.
    outward : float
        What the bounds are multiplied by, as their own sums are rounded.

    Returns
    -------
    residues : ndarray of complex, shape (n, p * m)
    shown, moved : ndarray, shape (n,)
        Norms of the columns of c and of the rows of b.
    bounds : ndarray, shape (3, n)
        Of these two, errors included, and of what the errors make of each residue.
    """
    n, m, p = b.shape[0], b.shape[1], c.shape[0]
    residues, bounds = np.empty((n, p * m), np.complex128), np.empty((3, n))
    shown, moved = np.empty(n), np.empty(n)
    for k in range(n):
        shown[k], moved[k] = frobenius(c[:, k : k + 1]), frobenius(b[k : k + 1])
        for i in range(p):
            for j in range(m):
                residues[k, i * m + j] = c[i, k] * b[k, j]
        bounds[0, k] = (shown[k] + c_error[k]) * outward
        bounds[1, k] = (moved[k] + b_error[k]) * outward
        bounds[2, k] = (shown[k] * b_error[k] + c_error[k] * (moved[k] + b_error[k])) * outward
    return residues, shown, moved, bounds


@njit(cache=True, error_model="numpy")
def frobenius(M):  # type: ignore[no-untyped-def]  # compiled
    """Return the Frobenius norm."""
    square = 0.0
    for i in range(M.shape[0]):
        for j in range(M.shape[1]):
            square += M[i, j].real ** 2 + M[i, j].imag ** 2
    return np.sqrt(square)
