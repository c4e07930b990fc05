"""Controllers of a given order in modal form, as a function of free numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.arrays import Vector
from robustpolish.exact.realisation import power_of_two
from robustpolish.synthesis.problem.matrices import Controller
from robustpolish.synthesis.uncertain.problem import stacked

# Condition of a pair of eigenvectors beyond which an orthonormal basis takes their place.
_PARALLEL = 30.0
# Unit of the rate of an integrator, beside the slower one of the median and a thousandth of the
# fastest rate: slow poles that do move keep their own.
_SLOWEST = 1e-3


@dataclass(frozen=True, eq=False)
class ModalGain:
    """K = [[Ak, Bk], [Ck, Dk]] with Ak made of free 2x2 blocks, each in units of its rate.

    In companion forms a descent stalls; here each mode moves by itself, and two real modes can
    become a complex pair.

    Attributes
    ----------
    order : int
    left, right : ndarray
        Units of rows and columns: square roots of rates for states, 1 for signals.
    shape : (int, int)
        Of K.
    """

    order: int
    left: Vector
    right: Vector
    shape: tuple[int, int]

    @classmethod
    def of(cls, K: Controller) -> tuple[ModalGain, Vector]:
        """Return the form of a controller, and its numbers."""
        n = len(K.A)
        A, B, C, rates = _modal(K)
        roots = np.sqrt(rates)
        ones_u, ones_y = np.ones(len(K.D)), np.ones(K.D.shape[1])
        left, right = np.concatenate([roots, ones_u]), np.concatenate([roots, ones_y])
        form = cls(n, left, right, (n + len(K.D), n + K.D.shape[1]))
        entries = stacked(Controller(A, B, C, K.D)) / left[:, None] / right
        return form, entries[form.mask]

    @property
    def mask(self) -> NDArray[np.bool_]:
        """Which entries of K are free."""
        n = self.order
        free = np.ones(self.shape, bool)
        free[:n, :n] = _pairs(n)
        return free

    @property
    def size(self) -> int:
        """Number of free numbers."""
        return int(self.mask.sum())

    def gain(self, theta: Vector) -> Matrix:
        """Return K(theta)."""
        K = np.zeros(self.shape)
        K[self.mask] = theta
        return self.left[:, None] * K * self.right

    def back(self, theta: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over K into one over theta."""
        return (self.left[:, None] * gradient * self.right)[self.mask]


def _modal(K: Controller) -> tuple[Matrix, Matrix, Matrix, Vector]:
    """Return A, B and C in modal coordinates with even gains, and a rate per state."""
    n = len(K.A)
    if not n:
        return K.A, K.B, K.C, np.zeros(0)
    values, vectors = np.linalg.eig(K.A)
    real = np.flatnonzero(np.abs(np.imag(values)) <= 1e-12 * np.abs(values))
    real = real[np.argsort(np.abs(values[real]))]
    upper = np.flatnonzero(np.imag(values) > 1e-12 * np.abs(values))
    parts, rates = [], []
    size = np.abs(values)
    moving = size[size > 0]
    floor = 1e-3 * float(size.max()) or 1.0
    floor = min(floor, float(np.median(moving))) if len(moving) else floor
    least = _SLOWEST * floor
    for i in upper[np.argsort(size[upper])]:
        parts.append(np.column_stack([np.real(vectors[:, i]), np.imag(vectors[:, i])]))
        rates += [size[i]] * 2
    for i in range(0, len(real), 2):
        pair = np.real(vectors[:, real[i : i + 2]])
        if np.linalg.cond(pair) > _PARALLEL:
            pair = np.linalg.qr(pair)[0]
        parts.append(pair)
        rates += [max(float(r), least) for r in size[real[i : i + 2]]]
    T = np.hstack(parts)
    A, B, C = np.linalg.solve(T, K.A @ T), np.linalg.solve(T, K.B), K.C @ T
    for i in range(0, n, 2):
        pair = slice(i, min(i + 2, n))
        b, c = np.linalg.norm(B[pair]), np.linalg.norm(C[:, pair])
        even = np.sqrt(c / b) if b > 0 and c > 0 else 1.0
        even = power_of_two(float(even))
        B[pair] *= even
        C[:, pair] /= even
    return np.where(_pairs(n), A, 0.0), B, C, np.array(rates)


def _pairs(n: int) -> NDArray[np.bool_]:
    """Tell which entries of A belong to 2x2 blocks on the diagonal."""
    place = np.arange(n) // 2
    return place[:, None] == place
