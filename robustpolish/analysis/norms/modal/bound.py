r"""Which pieces of the axis surely have no gain above a level.

With G = sum of N_j t^j on a piece, the gain is below gamma just if the Hermitian matrix
gamma^2 - G* G is positive definite for all t from -1 to 1. Its terms up to t^2, taken as

.. math:: F_0 + t F_1 + t^2 F_2 = \begin{bmatrix} 1 \\ t \end{bmatrix}^*
          \begin{bmatrix} F_0 - S & L \\ L^* & F_2 + S \end{bmatrix}
          \begin{bmatrix} 1 \\ t \end{bmatrix} + (1 - t^2) S, \qquad L + L^* = F_1,

are positive if for some S >= 0 and L the matrix in the middle is. In coordinates in which F_0 is
diagonal and rises, S is diagonal and L lower triangular, so that no entry couples to a direction
in which F_0 is nearly zero.
Higher terms are at most their norms times t^2, which are taken from F_2. So a piece whose middle is
a peak is settled in one step however near gamma is to it.
"""

from __future__ import annotations

import numpy as np

from robustpolish.analysis.norms.modal.expansion import ORDER
from robustpolish.analysis.norms.modal.small_hermitian import eigen
from robustpolish.analysis.poles.eigen import EPS
from robustpolish.compiling import njit


@njit(cache=True, error_model="numpy")
def sizes(terms, norms):  # type: ignore[no-untyped-def]  # compiled
    """Write down bounds of the terms' norms; return their sum."""
    total = 0.0
    for j in range(ORDER):
        square = 0.0
        for k in range(terms.shape[1]):
            for q in range(terms.shape[2]):
                square += terms[j, k, q].real ** 2 + terms[j, k, q].imag ** 2
        norms[j] = np.sqrt(square) * (1.0 + 1e-12)
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
        for i in range(m):
            for j in range(m):
                product[i, j] = 0.0
        for a in range(order // 2 + 1):
            b = order - a
            for i in range(m):
                for j in range(m):
                    entry = complex(0.0, 0.0)
                    for k in range(p):
                        entry += np.conj(terms[a, k, i]) * terms[b, k, j]
                    product[i, j] += entry
                    if a != b:
                        product[j, i] += np.conj(entry)
        if order > 2:
            square = 0.0
            for i in range(m):
                for j in range(m):
                    square += product[i, j].real ** 2 + product[i, j].imag ** 2
            late += np.sqrt(square) * (1.0 + 1e-12)
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
    F0, F1, F2 = _less(found, 0, level), _less(found, 1, 0.0), _less(found, 2, 0.0)
    V, room = np.empty((m, m), np.complex128), np.empty((m, m), np.complex128)
    # Coordinates in which F_0 is diagonal up to rounding; these need not be exact.
    eigen(F0, V)
    F0 = _less(found, 0, level)
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
def _less(found, order, level):  # type: ignore[no-untyped-def]  # compiled
    """Return what a term leaves of the square of a level."""
    m = found.shape[1]
    F = np.empty((m, m), np.complex128)
    for i in range(m):
        for j in range(m):
            F[i, j] = -found[order, i, j]
        F[i, i] += level * level
    return F


@njit(cache=True, error_model="numpy")
def _turn(F, V, room):  # type: ignore[no-untyped-def]  # compiled
    """Overwrite F by V* F V."""
    m = F.shape[0]
    for i in range(m):
        for j in range(m):
            entry = complex(0.0, 0.0)
            for k in range(m):
                entry += F[i, k] * V[k, j]
            room[i, j] = entry
    for i in range(m):
        for j in range(m):
            entry = complex(0.0, 0.0)
            for k in range(m):
                entry += np.conj(V[k, i]) * room[k, j]
            F[i, j] = entry


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
