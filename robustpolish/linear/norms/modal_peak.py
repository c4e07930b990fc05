"""The peak of the gain by branch and bound over the frequency axis, in modal coordinates.

Pieces whose gain is surely below the best one found are done; the others are cut about the place
where their gain seems to be largest, and a larger gain found there is climbed to its top. When none
is left, the bound is proven up to the errors of the modal form.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robustpolish.base.arrays import EPS
from robustpolish.base.budget import check_deadline
from robustpolish.base.jit import njit
from robustpolish.linear.norms.modal_expansion import (
    FAR,
    ORDER,
    expand,
    expand_far,
    expansion_error,
    first_pieces,
    frobenius,
    overlapping,
)
from robustpolish.linear.norms.modal_form import ModalForm, Peak

# Eigenvalues of small Hermitian matrices, compiled: calls of LAPACK would cost more than these.

_SWEEPS = 30


@njit(cache=True, error_model="numpy")
def eigen(H, V):  # type: ignore[no-untyped-def]  # compiled
    """Turn a Hermitian matrix to diagonal form by Jacobi's rotations.

    Parameters
    ----------
    H : ndarray of complex, shape (m, m)
        Overwritten: it becomes V* H V, with eigenvalues that rise along its diagonal.
    V : ndarray of complex, shape (m, m)
        Overwritten by the eigenvectors.
    """
    m = H.shape[0]
    for i in range(m):
        for j in range(m):
            V[i, j] = 1.0 if i == j else 0.0
    for _ in range(_SWEEPS):
        turned = False
        for i in range(m - 1):
            for j in range(i + 1, m):
                turned |= _rotate(H, V, i, j)
        if not turned:
            break
    for i in range(m - 1):  # the smallest that is left comes next
        least = i
        for j in range(i + 1, m):
            if H[j, j].real < H[least, least].real:
                least = j
        if least != i:
            for k in range(m):
                H[k, i], H[k, least] = H[k, least], H[k, i]
                V[k, i], V[k, least] = V[k, least], V[k, i]
            for k in range(m):
                H[i, k], H[least, k] = H[least, k], H[i, k]


@njit(cache=True, error_model="numpy")
def _rotate(H, V, i, j):  # type: ignore[no-untyped-def]  # compiled
    """Make an entry beside the diagonal zero; say whether there was something to do."""
    size = np.hypot(H[i, j].real, H[i, j].imag)
    low, high = H[i, i].real, H[j, j].real
    if not size > 1e-17 * (abs(low) + abs(high)):
        return False
    phase = H[i, j] / size
    half = 0.5 * (high - low) / size
    tangent = 1.0 / (abs(half) + np.sqrt(half * half + 1.0))
    if half < 0.0:
        tangent = -tangent
    cosine = 1.0 / np.sqrt(tangent * tangent + 1.0)
    sine = tangent * cosine
    back = np.conj(phase)
    for k in range(H.shape[0]):
        one, other = H[k, i], H[k, j] * back
        H[k, i] = cosine * one - sine * other
        H[k, j] = sine * one + cosine * other
        one, other = V[k, i], V[k, j] * back
        V[k, i] = cosine * one - sine * other
        V[k, j] = sine * one + cosine * other
    for k in range(H.shape[0]):
        one, other = H[i, k], H[j, k] * phase
        H[i, k] = cosine * one - sine * other
        H[j, k] = sine * one + cosine * other
    H[i, j] = 0.0
    H[j, i] = 0.0
    H[i, i] = H[i, i].real
    H[j, j] = H[j, j].real
    return True


@njit(cache=True, error_model="numpy")
def largest_gain(G):  # type: ignore[no-untyped-def]  # compiled
    """Return the largest singular value of a matrix with at most as many columns as rows."""
    m = G.shape[1]
    if m == 1:
        return frobenius(G)
    H, V = np.zeros((m, m), np.complex128), np.empty((m, m), np.complex128)
    add_adjoint_product(G, G, H)
    eigen(H, V)
    return np.sqrt(max(H[m - 1, m - 1].real, 0.0))


@njit(cache=True, error_model="numpy")
def add_adjoint_product(left, right, total):  # type: ignore[no-untyped-def]  # compiled
    """Add left* right to a matrix."""
    for i in range(left.shape[1]):
        for j in range(right.shape[1]):
            entry = complex(0.0, 0.0)
            for k in range(left.shape[0]):
                entry += np.conj(left[k, i]) * right[k, j]
            total[i, j] += entry


@njit(cache=True, error_model="numpy")
def _term_of_square(terms, order, product):  # type: ignore[no-untyped-def]  # compiled
    """Overwrite a matrix by the term of G* G of an order, for a series G."""
    product[:] = 0.0
    for a in range(order + 1):
        add_adjoint_product(terms[a], terms[order - a], product)


# Which pieces of the axis surely have no gain above a level.
#
# With G = sum of N_j t^j on a piece, the gain is below gamma just if the Hermitian matrix
# gamma^2 - G* G is positive definite for all t from -1 to 1. Its terms up to t^2, taken as
#
# .. math:: F_0 + t F_1 + t^2 F_2 = \begin{bmatrix} 1 \\ t \end{bmatrix}^*
#           \begin{bmatrix} F_0 - S & L \\ L^* & F_2 + S \end{bmatrix}
#           \begin{bmatrix} 1 \\ t \end{bmatrix} + (1 - t^2) S, \qquad L + L^* = F_1,
#
# are positive if for some S >= 0 and L the matrix in the middle is. In coordinates in which F_0 is
# diagonal and rises, S is diagonal and L lower triangular, so that no entry couples to a direction
# in which F_0 is nearly zero. Higher terms are at most their norms times t^2, which are taken from
# F_2. So a piece whose middle is a peak is settled in one step however near gamma is to it.


@njit(cache=True, error_model="numpy")
def sizes(terms, norms):  # type: ignore[no-untyped-def]  # compiled
    """Write down bounds of the terms' norms; return their sum."""
    total = 0.0
    for j in range(ORDER):
        norms[j] = frobenius(terms[j]) * (1.0 + 1e-12)
        total += norms[j]
    return total


@njit(cache=True, error_model="numpy")
def squares(terms, norms, total, error, found):  # type: ignore[no-untyped-def]  # compiled
    """Multiply a series by its adjoint.

    Parameters
    ----------
    terms : ndarray of complex, shape (ORDER, p, m)
    norms : ndarray, shape (ORDER,)
    total, error : float
        The sum of the norms, and the bound of what the series leaves out.
    found : ndarray of complex, shape (4, m, m)
        Overwritten by the terms of G* G up to t^2; the last one is room to work.

    Returns
    -------
    late : float
        Bound of the sum of the terms from t^3 on.
    error : float
        What the error of G makes, rounding included.
    """
    _, p, m = terms.shape
    late = 0.0
    for order in range(ORDER):
        product = found[min(order, 3)]
        _term_of_square(terms, order, product)
        if order > 2:
            late += frobenius(product) * (1.0 + 1e-12)
    for a in range(1, ORDER):
        for b in range(ORDER - a, ORDER):
            late += norms[a] * norms[b]
    rounding = EPS * (8 * p + 4 * m + 64) * total * total
    return late, (error * (2.0 * total + error) + rounding) * (1.0 + 1e-9)


@njit(cache=True, error_model="numpy")
def below(found, late, error, level):  # type: ignore[no-untyped-def]  # compiled
    """Say whether the gain is surely below `level` on a piece, and where it seems to be largest.

    Parameters
    ----------
    found, late, error
        What :func:`squares` gave.
    level : float

    Returns
    -------
    proven : bool
    peak : float
        An estimate of t, from -1 to 1; 0 where the gain has no peak.
    """
    m = found.shape[1]
    F0 = _level_remainder(found, 0, level)
    F1, F2 = _level_remainder(found, 1, 0.0), _level_remainder(found, 2, 0.0)
    V, room = np.empty((m, m), np.complex128), np.empty((m, m), np.complex128)
    # Coordinates in which F_0 is diagonal up to rounding; these need not be exact.
    eigen(F0, V)
    F0 = _level_remainder(found, 0, level)
    _turn(F0, V, room)
    _turn(F1, V, room)
    _turn(F2, V, room)
    trace = m * (late + error)
    for i in range(m):
        trace += abs(F0[i, i].real) + abs(F2[i, i].real)
    margin = 64 * (2 * m + 8) * EPS * trace
    slack, added = np.empty(m), 0.0
    for i in range(m):
        bend = F2[i, i].real - late
        for k in range(i + 1, m):  # what the later directions take from the bend
            held = max(F0[k, k].real, EPS * level * level)
            bend -= (F1[k, i].real ** 2 + F1[k, i].imag ** 2) / held
        slack[i] = max(_slack(max(F0[i, i].real, 0.0), F1[i, i].real, bend), 4.0 * margin)
        added += slack[i]  # at least the margin, for short pieces, whose other terms vanish
    margin += 64 * (2 * m + 8) * EPS * added
    M = np.empty((2 * m, 2 * m), np.complex128)
    for i in range(m):
        for j in range(m):
            M[m + j, i] = 0.0
        for j in range(i + 1):
            M[i, j], M[m + i, m + j] = F0[i, j], F2[i, j]
            M[m + j, i] = np.conj(F1[i, j]) * (0.5 if i == j else 1.0)
        M[i, i] -= slack[i] + error + margin
        M[m + i, m + i] += slack[i] - late - margin
    return _definite(M) and np.isfinite(trace), _peak(F0, F1, F2)


@njit(cache=True, error_model="numpy")
def _level_remainder(found, order, level):  # type: ignore[no-untyped-def]  # compiled
    """Return what a term leaves of the square of a level."""
    F = -found[order]
    for i in range(found.shape[1]):
        F[i, i] += level * level
    return F


@njit(cache=True, error_model="numpy")
def _turn(F, V, room):  # type: ignore[no-untyped-def]  # compiled
    """Overwrite a Hermitian F by V* F V."""
    room[:] = 0.0
    add_adjoint_product(F, V, room)  # F* = F
    F[:] = 0.0
    add_adjoint_product(V, room, F)


@njit(cache=True, error_model="numpy")
def _slack(value, slope, bend):  # type: ignore[no-untyped-def]  # compiled
    """Return an entry of S: it lifts the bend well above zero and takes little elsewhere."""
    lifted = np.sqrt(max(value * abs(bend), 0.25 * slope * slope)) - bend
    return min(max(lifted, 0.0), max(0.5 * (value - bend), 0.0))


@njit(cache=True, error_model="numpy")
def _definite(M):  # type: ignore[no-untyped-def]  # compiled
    """Say whether a Hermitian matrix has pivots above zero only; its lower triangle is overwritten.

    The margin that was taken from it covers the rounding of the elimination [1]_.

    References
    ----------
    .. [1] S. M. Rump, "Verification of positive definiteness", BIT Numerical Mathematics 46
       (2006) 433-452.
    """
    size = M.shape[0]
    for i in range(size):
        pivot = M[i, i].real
        if not pivot > 0.0:
            return False
        for j in range(i + 1, size):
            share = np.conj(M[j, i]) / pivot
            for k in range(j, size):
                M[k, j] -= M[k, i] * share
    return True


@njit(cache=True, error_model="numpy")
def _peak(F0, F1, F2):  # type: ignore[no-untyped-def]  # compiled
    """Return where the least eigenvalue is smallest, by perturbation to second order."""
    second = F2[0, 0].real
    for i in range(1, F0.shape[0]):
        apart = F0[i, i].real - F0[0, 0].real
        if apart > 0.0:
            second -= (F1[i, 0].real ** 2 + F1[i, 0].imag ** 2) / apart
    if not second > 0.0:
        return 0.0
    t = -0.5 * F1[0, 0].real / second
    return t if abs(t) <= 1.0 else 0.0


def modal_peak(modes: ModalForm, tolerance: float, widest: float) -> Peak | None:
    """Find the peak.

    Parameters
    ----------
    modes : ModalForm
    tolerance, widest : float
        Relative widths of the bracket: wanted, and accepted where the errors of the form are
        larger.

    Returns
    -------
    Peak or None
        None if these errors, or too much work, leave it open.
    """
    by_height = np.argsort(modes.high)
    centre, half, count = first_pieces(modes.real[by_height], modes.high[by_height])
    search: Any = _search  # compiled, so that no types are known
    check_deadline()
    pieces = centre[:count], half[:count]
    settled, *found = search(modes, *pieces, float(tolerance), float(widest))
    return Peak(*found) if settled else None


@njit(cache=True, error_model="numpy")
def _search(modes, centre, half, tolerance, widest):  # type: ignore[no-untyped-def]  # compiled
    """Return whether the peak is settled, where it is, its gain, and both bounds."""
    p, m = modes.D.shape
    terms, norms = np.empty((ORDER, p, m), np.complex128), np.empty(ORDER)
    found = np.empty((4, m, m), np.complex128)
    end = 0.0
    for i in range(modes.real.size):
        bounds = modes.sizes[i] + modes.shown[i] + modes.moved[i] + modes.signal_errors[i]
        if not np.isfinite(bounds + modes.rows[i] + modes.stretch[i]):
            return False, np.nan, 0.0, 0.0, np.inf
        end = max(end, FAR * np.hypot(modes.real[i], modes.high[i]))
    gain = largest_gain(modes.D)
    rounding = EPS * (8 * p + 8 * m + 32)
    best = (np.inf, gain, max(0.0, gain * (1.0 - rounding) - 2.0 * modes.D_error))
    best = _highest_middle(modes, centre, half, best, terms, found)
    done, most, level = 0, 100 + 60 * modes.real.size, 0.0
    open_pieces = np.empty((centre.size + 8 + 2 * most, 2))
    open_pieces[0, 0], open_pieces[0, 1], left = np.inf, end, 1
    for k in range(centre.size):
        open_pieces[left, 0], open_pieces[left, 1] = centre[k], half[k]
        left += 1
        if abs(centre[k] - best[0]) <= half[k]:
            left = _cut(open_pieces, left - 1, (best[0] - centre[k]) / half[k], 0.3)
    while left > 0:
        left -= 1
        middle, reach = open_pieces[left, 0], open_pieces[left, 1]
        far = np.isinf(middle)
        if far:
            error = expand_far(modes, reach, terms)
        else:
            error, most_gain = expansion_error(modes, middle, reach, best[1])
            if most_gain < level:
                continue
            expand(modes, middle, reach, terms)
            best = _climbed(modes, middle, reach, best, terms, found)
        # Errors of the form keep the bracket from being narrower; what is done stays so.
        width = max(tolerance, 4.0 * (best[1] - best[2]) / best[1]) if best[2] > 0.0 else np.inf
        if not width <= widest or done > most or (far and reach > 1e6 * end):
            return False, best[0], best[1], best[2], np.inf
        level = max(level, best[1] * (1.0 + width))
        hint = 0.0
        if error < np.inf:
            total = sizes(terms, norms)
            if total + error < level:
                continue
            late, lost = squares(terms, norms, total, error, found)
            proven, hint = below(found, late, lost, level)
            if proven:
                continue
        done += 1
        if far:
            open_pieces[left, 1] = 2.0 * reach
            open_pieces[left + 1, 0], open_pieces[left + 1, 1] = overlapping(reach, 2.0 * reach)
            left += 2
        else:
            left = _cut(open_pieces, left, hint, 0.3 if error < np.inf else 0.1)
    return True, best[0], best[1], best[2], level


@njit(cache=True, error_model="numpy")
def _cut(pieces, k, hint, share):  # type: ignore[no-untyped-def]  # compiled
    """Put three pieces in the place of the last one, k; return how many there are then.

    The one about the place that the hint tells comes last.
    """
    centre, half = pieces[k, 0], pieces[k, 1]
    middle = min(max(hint, -0.7), 0.7)
    part = share * (1.0 - abs(middle))
    left, right = centre + half * (middle - part), centre + half * (middle + part)
    pieces[k, 0], pieces[k, 1] = overlapping(centre - half, left)
    pieces[k + 1, 0], pieces[k + 1, 1] = overlapping(right, centre + half)
    pieces[k + 2, 0] = centre + half * middle
    pieces[k + 2, 1] = half * part * (1.0 + 1e-9) + 4e-16 * abs(pieces[k + 2, 0])
    return k + 3


@njit(cache=True, error_model="numpy")
def _highest_middle(modes, centre, half, best, terms, found):  # type: ignore[no-untyped-def]  # compiled
    """Climb from the highest of all middles."""
    highest, which = -1.0, 0
    G = np.empty(modes.D.shape, np.complex128)
    flat = G.reshape(G.size)
    for k in range(centre.size):
        G[:] = modes.D
        for q in range(modes.real.size):
            factor = 1.0 / complex(-modes.real[q], (centre[k] - modes.high[q]) - modes.low[q])
            for i in range(flat.size):
                flat[i] += factor * modes.residues[q, i]
        if frobenius(G) >= highest:  # no singular value is larger than that
            gain = largest_gain(G)
            if gain > highest:
                highest, which = gain, k
    expand(modes, centre[which], half[which], terms)
    return _climbed(modes, centre[which], half[which], best, terms, found)


@njit(cache=True, error_model="numpy")
def _climbed(modes, at, half, best, terms, found):  # type: ignore[no-untyped-def]  # compiled
    """Climb by Newton's method from a middle whose gain is above the best one; keep `terms`."""
    gain = largest_gain(terms[0])
    if not gain > best[1] * (1.0 + 1e-14):
        return best
    p, m = modes.D.shape
    here = np.empty((ORDER, p, m), np.complex128)
    expand(modes, at, half, here)
    for _ in range(12):
        trial = at + half * _step(here, found)
        if abs(trial - at) <= 1e-12 * half:
            break
        expand(modes, trial, half, here)
        reached = largest_gain(here[0])
        if not reached > gain:
            break
        at, progress, gain = trial, reached - gain, reached
        if progress <= 1e-13 * gain:
            break
    error, _ = expansion_error(modes, at, 0.0, 0.0)
    lower = max(0.0, gain * (1.0 - EPS * (8 * p + 8 * m + 32)) - error)
    return abs(at), gain, lower


@njit(cache=True, error_model="numpy")
def _step(here, found):  # type: ignore[no-untyped-def]  # compiled
    """Return t of the top of the gain about a middle, at most 1 away."""
    m = here.shape[2]
    for order in range(3):
        _term_of_square(here, order, found[order])
    V = np.empty((m, m), np.complex128)
    eigen(found[0], V)
    first, second = 0.0, 0.0
    for i in range(m - 1, -1, -1):  # the last vector is that of the largest gain
        slope, bend = complex(0.0, 0.0), complex(0.0, 0.0)
        for j in range(m):
            for k in range(m):
                pair = np.conj(V[j, i]) * V[k, m - 1]
                slope += pair * found[1, j, k]
                bend += pair * found[2, j, k]
        if i == m - 1:
            first, second = slope.real, bend.real
        else:
            apart = found[0, m - 1, m - 1].real - found[0, i, i].real
            if apart > 0.0:
                second += (slope.real**2 + slope.imag**2) / apart
    if second < 0.0 and abs(first) < -2.0 * second:
        return -0.5 * first / second
    return 1.0 if first > 0.0 else -1.0
