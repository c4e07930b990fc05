"""Eigenvalues in double precision with their errors and the share of each state."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray

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
    shares : ndarray of float, shape (n, n)
        Part of each state (row) in each mode (column), whatever the units of the states;
        rounded, so that the first of equal states leads.
    right, left : ndarray of complex, shape (n, n)
        Right and left eigenvectors in the columns.
    """

    values: NDArray[np.complex128]
    errors: NDArray[np.float64]
    shares: NDArray[np.float64]
    right: NDArray[np.complex128]
    left: NDArray[np.complex128]


def eigensystem(M: NDArray[np.float64]) -> Eigensystem:
    """Compute the eigenvalues of a square matrix and what belongs to them."""
    n = M.shape[0]
    if n == 0:
        none = np.empty((0, 0), complex)
        return Eigensystem(np.empty(0, complex), np.empty(0), np.empty((0, 0)), none, none)
    found: Any = sla.eig(M, left=True, right=True, check_finite=False)
    values, left, right = found
    shares = np.abs(left.conj() * right)
    cosines = np.abs(np.sum(left.conj() * right, axis=0))
    backward = 10 * EPS * math.sqrt(n) * np.linalg.norm(M)
    with np.errstate(divide="ignore"):
        errors = backward / cosines
    vanishing = shares.sum(axis=0) <= np.finfo(float).tiny  # defective: orthogonal vectors
    shares[:, vanishing] = np.abs(right[:, vanishing])
    return Eigensystem(values, errors, np.round(shares / shares.sum(axis=0), 3), right, left)


def pair_text(value: complex) -> str:
    """Return a real eigenvalue, or a complex pair, as text."""
    if value.imag == 0:
        return f"{value.real:.6g}"
    return f"{value.real:.6g} +/- {abs(value.imag):.6g}j"
