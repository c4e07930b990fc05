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

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robustpolish.analysis.norms.modal.expansion import ORDER, Expansion
from robustpolish.analysis.poles.eigen import EPS
from robustpolish.arrays import AnyArray, Vector

_ORDERS = np.add.outer(np.arange(ORDER), np.arange(ORDER))
_LATE = (_ORDERS >= ORDER).astype(float)
_OF_ORDER = (np.arange(ORDER)[:, None] == _ORDERS.ravel()).astype(complex)


@dataclass(frozen=True, eq=False)
class Squares:
    """The terms of G* G on pieces, and what bounds all others.

    Attributes
    ----------
    terms : ndarray of complex, shape (3, k, m, m)
    late : ndarray, shape (k,)
        Bound of the sum of the terms from t^3 on.
    error : ndarray, shape (k,)
        What the error of G makes, rounding included.
    """

    terms: AnyArray
    late: Vector
    error: Vector


def sizes(expansion: Expansion) -> Vector:
    """Bound the gain on each piece by the sum of the terms' norms, roughly."""
    return _norms(expansion.terms).sum(axis=0) + expansion.error


def _norms(terms: AnyArray) -> Vector:
    flat = terms.reshape(*terms.shape[:2], -1)
    return np.sqrt(np.sum(np.real(flat) ** 2 + np.imag(flat) ** 2, axis=-1)) * (1 + 1e-12)


def squares(expansion: Expansion) -> Squares:
    """Multiply the series by their adjoints."""
    _, k, p, m = expansion.terms.shape
    side_by_side = expansion.terms.transpose(1, 2, 0, 3).reshape(k, p, ORDER * m)
    products = np.conj(side_by_side.transpose(0, 2, 1)) @ side_by_side
    pairs = products.reshape(k, ORDER, m, ORDER, m).transpose(1, 3, 0, 2, 4)
    terms = (_OF_ORDER @ pairs.reshape(ORDER**2, -1)).reshape(ORDER, k, m, m)
    norms = _norms(expansion.terms)
    late = _norms(terms[3:]).sum(axis=0) + np.sum(norms * (_LATE @ norms), axis=0)
    total = norms.sum(axis=0)
    rounding = EPS * (8 * p + 4 * m + 64) * total**2
    error = expansion.error * (2 * total + expansion.error) + rounding
    return Squares(terms[:3], late, error * (1 + 1e-9))


def below(found: Squares, level: float) -> tuple[NDArray[np.bool_], Vector]:
    """Say on which pieces the gain is surely below `level`, and where each seems to be largest.

    Returns
    -------
    proven : ndarray of bool
    peak : ndarray
        Estimates of t, from -1 to 1; 0 where the gain has no peak.
    """
    m = found.terms.shape[-1]
    diagonal = np.arange(m)
    F0 = level**2 * np.eye(m) - found.terms[0]
    _, vectors = np.linalg.eigh(F0)
    star = np.conj(np.swapaxes(vectors, -1, -2))
    # Coordinates in which F_0 is diagonal up to rounding; these need not be exact.
    F0, F1, F2 = (
        star @ F0 @ vectors,
        star @ -found.terms[1] @ vectors,
        star @ -found.terms[2] @ vectors,
    )
    values, slopes, bends = (F[:, diagonal, diagonal].real for F in (F0, F1, F2))
    coupling = np.tril(F1)
    coupling[:, diagonal, diagonal] *= 0.5
    # What the later directions take from the bend of the earlier ones.
    held = np.maximum(values, EPS * level**2)
    lost = np.sum(np.abs(np.tril(F1, -1)) ** 2 / held[:, :, None], axis=1)
    trace = (np.abs(values) + np.abs(bends)).sum(axis=1) + m * (found.late + found.error)
    margin = 64 * (2 * m + 8) * EPS * trace
    slack = _slack(np.maximum(values, 0.0), slopes, bends - found.late[:, None] - lost)
    slack = np.maximum(slack, 4 * margin[:, None])  # for short pieces, whose other terms vanish
    margin += 64 * (2 * m + 8) * EPS * slack.sum(axis=1)
    M = np.zeros((values.shape[0], 2 * m, 2 * m), complex)
    M[:, :m, :m] = F0
    M[:, diagonal, diagonal] -= slack + (found.error + margin)[:, None]
    M[:, m:, :m] = np.conj(np.swapaxes(coupling, -1, -2))
    M[:, m:, m:] = F2
    M[:, m + diagonal, m + diagonal] += slack - (found.late + margin)[:, None]
    return _definite(M) & np.isfinite(trace), _peaks(values, F1, bends)


def _slack(values: Vector, slopes: Vector, bends: Vector) -> Vector:
    """Return the diagonal of S: it lifts the bends well above zero and takes little elsewhere."""
    lifted = np.sqrt(np.maximum(values * np.abs(bends), 0.25 * slopes**2)) - bends
    return np.clip(lifted, 0.0, np.maximum(0.5 * (values - bends), 0.0))


def _definite(M: AnyArray) -> NDArray[np.bool_]:
    """Say which Hermitian matrices have pivots above zero only, and overwrite them.

    The margin that was taken from them covers the rounding of the elimination [1]_.

    References
    ----------
    .. [1] S. M. Rump, "Verification of positive definiteness", BIT Numerical Mathematics 46
       (2006) 433-452.
    """
    try:
        np.linalg.cholesky(M)  # reads the lower triangles
    except np.linalg.LinAlgError:
        pass
    else:
        return np.ones(M.shape[0], bool)
    good = np.ones(M.shape[0], bool)
    for i in range(M.shape[-1]):
        pivot = np.real(M[:, i, i])
        good &= pivot > 0
        column = M[:, i + 1 :, i]
        divisor = np.where(pivot > 0, pivot, 1.0)[:, None, None]
        M[:, i + 1 :, i + 1 :] -= column[:, :, None] * np.conj(column)[:, None, :] / divisor
    return good


def _peaks(values: Vector, slope: AnyArray, curvature: Vector) -> Vector:
    """Return where the least eigenvalue is smallest, by perturbation to second order."""
    first = np.real(slope[:, 0, 0])
    apart = values[:, 1:] - values[:, :1]
    mixed = np.abs(slope[:, 1:, 0]) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        second = curvature[:, 0] - np.nansum(np.where(apart > 0, mixed / apart, 0.0), axis=1)
        t = -first / (2 * second)
    return np.where((second > 0) & (np.abs(t) <= 1), t, 0.0)
