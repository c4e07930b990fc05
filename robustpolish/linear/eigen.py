"""Eigenvalues in double precision with their errors and the share of each state."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack as _lapack

lapack: Any = _lapack
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Eigensystem:
    """Eigenvalues of a matrix and what their vectors tell.

    Attributes
    ----------
    values : ndarray of complex, shape (n,)
    errors : ndarray of float, shape (n,)
        Generous estimates of the rounding errors, by first-order perturbation theory: ten
        times the backward error of the QR algorithm over the cosine between left and
        right eigenvector. Large where eigenvalues are nearly multiple.
    right, left : ndarray of complex, shape (n, n)
        Right and left eigenvectors in the columns.
    """

    values: NDArray[np.complex128]
    errors: NDArray[np.float64]
    right: NDArray[np.complex128]
    left: NDArray[np.complex128]

    @property
    def shares(self) -> NDArray[np.float64]:
        """Part of each state (row) in each mode (column), whatever the units of the states.

        It is rounded, so that the first of equal states leads.
        """
        shares = np.abs(self.left.conj() * self.right)
        vanishing = shares.sum(axis=0) <= np.finfo(float).tiny  # defective: orthogonal vectors
        shares[:, vanishing] = np.abs(self.right[:, vanishing])
        return np.round(shares / shares.sum(axis=0), 3)


def eigensystem(M: NDArray[np.float64]) -> Eigensystem:
    """Compute the eigenvalues of a square matrix and what belongs to them."""
    n = M.shape[0]
    if n == 0:
        none = np.empty((0, 0), complex)
        return Eigensystem(np.empty(0, complex), np.empty(0), none, none)
    real, imag, left, right, failed = lapack.dgeev(M, lwork=_lapack_workspace(n))
    if failed:
        raise np.linalg.LinAlgError("the eigenvalues did not converge")
    from robustpolish.linear.arithmetic.even_units import complex_eigenpairs

    backward = 10 * EPS * math.sqrt(n) * math.sqrt(np.vdot(M, M))
    values, cosines, left, right = complex_eigenpairs(real, imag, left.T, right.T)
    with np.errstate(divide="ignore"):
        return Eigensystem(values, backward / cosines, right.T, left.T)


@lru_cache
def _lapack_workspace(n: int) -> int:
    """Return the working memory with which LAPACK is quickest."""
    return int(lapack.dgeev_lwork(n)[0])


def pair_text(value: complex) -> str:
    """Return a real eigenvalue, or a complex pair, as text."""
    if value.imag == 0:
        return f"{value.real:.6g}"
    return f"{value.real:.6g} +/- {abs(value.imag):.6g}j"
