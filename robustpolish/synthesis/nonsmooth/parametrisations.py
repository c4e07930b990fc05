"""Maps from free numbers to the constant matrix K of a loop, with their adjoints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.base.arrays import Array, Vector


class Parametrisation(Protocol):
    """K as a function of a vector theta."""

    @property
    def size(self) -> int:
        """Number of free numbers."""
        ...

    def gain(self, theta: Vector) -> Matrix:
        """Return K(theta)."""
        ...

    def back(self, theta: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over K into one over theta."""
        ...


@dataclass(frozen=True, eq=False)
class MaskedGain:
    """K with free entries where the mask is true and zeros elsewhere.

    Attributes
    ----------
    mask : ndarray of bool, shape (rows, columns)
    """

    mask: NDArray[np.bool_]

    @property
    def size(self) -> int:
        """Number of free numbers."""
        return int(self.mask.sum())

    def gain(self, theta: Vector) -> Matrix:
        """Return K(theta)."""
        K = np.zeros(self.mask.shape)
        K[self.mask] = theta
        return K

    def back(self, theta: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over K into one over theta."""
        return gradient[self.mask]

    def coordinates(self, K: Matrix) -> Vector:
        """Return the theta whose gain is nearest to K."""
        return K[self.mask]

    def restricted(self, left: Matrix, right: Matrix, target: Matrix) -> AffineGain | None:
        """Keep only gains with left K right = target; None if there is none."""
        rows = np.array([np.outer(left[:, i], right[j]).ravel() for i, j in np.argwhere(self.mask)])
        rows = rows.reshape(self.size, target.size).T
        missing = target.ravel()
        theta = np.linalg.lstsq(rows, missing, rcond=None)[0]
        scale = np.linalg.norm(rows) * np.linalg.norm(theta) + np.linalg.norm(target)
        if np.linalg.norm(rows @ theta - missing) > 1e-9 * scale:
            return None
        _, values, vt = np.linalg.svd(rows)
        rank = int(np.sum(values > 1e-12 * values.max(initial=0.0)))
        return AffineGain(self, theta, vt[rank:])


@dataclass(frozen=True, eq=False)
class AffineGain:
    """The free entries of a masked gain on an affine subspace.

    Attributes
    ----------
    inner : MaskedGain
    origin : ndarray, shape (m,)
        One point of the subspace.
    basis : ndarray, shape (n, m)
        Orthonormal rows that span it.
    """

    inner: MaskedGain
    origin: Vector
    basis: Matrix

    @property
    def size(self) -> int:
        """Number of free numbers."""
        return len(self.basis)

    def gain(self, theta: Vector) -> Matrix:
        """Return K(theta)."""
        return self.inner.gain(self.origin + theta @ self.basis)

    def back(self, theta: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over K into one over theta."""
        return self.basis @ self.inner.back(theta, gradient)

    def coordinates(self, K: Matrix) -> Vector:
        """Return the theta whose gain is nearest to K."""
        return self.basis @ (self.inner.coordinates(K) - self.origin)


@dataclass(frozen=True, eq=False)
class PositiveElements:
    """K = offset + sum of exp(theta_i) times element_i: coefficients that stay positive.

    Attributes
    ----------
    elements : ndarray, shape (n, rows, columns)
    """

    elements: Array

    @property
    def size(self) -> int:
        """Number of free numbers."""
        return len(self.elements)

    def gain(self, theta: Vector) -> Matrix:
        """Return K(theta)."""
        return np.tensordot(np.exp(theta), self.elements, axes=1)

    def back(self, theta: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over K into one over theta."""
        return np.exp(theta) * np.tensordot(self.elements, gradient, axes=2)


@dataclass(frozen=True, eq=False)
class ObserverGain:
    """K = [[A + B F - L C - L D F, L], [F, 0]], the Luenberger form of (10.63).

    theta holds F, shape (nu, nx), then L, shape (nx, ny), row by row.

    Attributes
    ----------
    A, B, C, D : ndarray
        The plant from u to y.
    """

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix

    @property
    def size(self) -> int:
        """Number of free numbers."""
        return self.B.size + self.C.size

    def split(self, theta: Vector) -> tuple[Matrix, Matrix]:
        """Return F and L."""
        F, L = np.split(theta, [self.B.size])
        return F.reshape(self.B.T.shape), L.reshape(self.C.T.shape)

    def join(self, F: Matrix, L: Matrix) -> Vector:
        """Return theta."""
        return np.concatenate([F.ravel(), L.ravel()])

    def coordinates(self, K: Matrix) -> Vector:
        """Return the theta of a K of this form."""
        nx = len(self.A)
        return self.join(K[nx:, :nx], K[:nx, nx:])

    def gain(self, theta: Vector) -> Matrix:
        """Return K(theta)."""
        F, L = self.split(theta)
        Ak = self.A + self.B @ F - L @ (self.C + self.D @ F)
        return np.block([[Ak, L], [F, np.zeros((len(F), L.shape[1]))]])

    def back(self, theta: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over K into one over theta."""
        F, L = self.split(theta)
        nx = len(self.A)
        on_a, on_l, on_f = gradient[:nx, :nx], gradient[:nx, nx:], gradient[nx:, :nx]
        back_f = on_f + (self.B - L @ self.D).T @ on_a
        back_l = on_l - on_a @ (self.C + self.D @ F).T
        return self.join(back_f, back_l)
