"""Singular values of one closed loop over frequency, quickly, and where they cross a level."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.arrays import Vector
from robustpolish.synthesis.problem.static_loop import StaticLoop

Complex = NDArray[Any]

# Eigenvectors pay from so many states on: a frequency then takes n instead of n^3 operations. On
# fewer states everything is overhead.
_MODAL_STATES = 12
# So far a response from eigenvectors may be from that of a linear solve. Loops with eigenvectors
# that are nearly parallel are worse, and take linear solves.
_MODAL_ERROR = 1e-9


class LoopResponse:
    """Singular values of one closed loop over frequency, with its level sets.

    Parameters
    ----------
    closed : StaticLoop
        Stable.
    """

    def __init__(self, closed: StaticLoop) -> None:
        self.closed = closed
        self.discrete = closed.plant.discrete
        self.A, self.B, self.C, self.D = _continuous(closed)
        self.feedthrough = float(np.linalg.norm(self.D, 2)) if self.D.any() else 0.0
        self._modal_use: bool | None = None if len(closed.A) >= _MODAL_STATES else False

    def point(self, frequency: float | Vector) -> Any:
        """Return the point of the s plane (or z plane) at a frequency."""
        return np.exp(1j * frequency) if self.discrete else 1j * frequency

    def sigma(self, frequencies: Vector) -> Vector:
        """Largest singular value at each finite frequency; an upper bound far below the largest."""
        if len(frequencies) == 0:
            return np.zeros(0)
        points = np.atleast_1d(self.point(frequencies))
        if self._modal_use is None:
            self._modal_use = self._modal is not None and self._agrees(points)
        return _largest(self._summed(points) if self._modal_use else self._solved(points))

    @cached_property
    def _modal(self) -> tuple[Complex, Complex] | None:
        vectors = self.closed.modes[1]
        try:
            return self.closed.C @ vectors, np.linalg.solve(vectors, self.closed.B + 0j)
        except np.linalg.LinAlgError:
            return None

    def _summed(self, points: Complex) -> Complex:
        """Responses at some points as a sum over modes."""
        assert self._modal is not None
        outputs, inputs = self._modal
        shares = 1.0 / (points[:, None] - self.closed.poles)
        return (outputs * shares[:, None, :]) @ inputs + self.closed.D

    def _solved(self, points: Complex) -> Complex:
        """Responses at some points by linear solves; infinite where one has no solution."""
        A, B, C, D = self.closed.A, self.closed.B, self.closed.C, self.closed.D
        pencils = points[:, None, None] * np.eye(len(A)) - A
        try:
            states = np.linalg.solve(pencils, np.broadcast_to(B, (len(points), *B.shape)))
        except np.linalg.LinAlgError:
            return np.full((len(points), *D.shape), np.inf + 0j)
        return C @ states + D

    def _agrees(self, points: Complex) -> bool:
        """Whether modes tell the largest of some responses as a linear solve does."""
        # Eigenvectors that are nearly parallel have inverses that overflow.
        with np.errstate(over="ignore", invalid="ignore"):
            top = points[[int(np.argmax(_largest(self._summed(points))))]]
            summed, solved = self._summed(top), self._solved(top)
            return bool(np.linalg.norm(summed - solved) <= _MODAL_ERROR * np.linalg.norm(solved))

    def crossings(self, level: float) -> Vector:
        """Frequencies at which a singular value equals `level`, increasing."""
        A, B, C, D = self.A, self.B, self.C, self.D
        square = level * level
        if not np.isfinite(square):
            return np.zeros(0)  # beyond doubles nobody can tell
        R = square * np.eye(D.shape[1]) - D.T @ D
        S = square * np.eye(D.shape[0]) - D @ D.T
        try:
            RB = np.linalg.solve(R, np.hstack([D.T @ C, B.T]))
            SC = np.linalg.solve(S, C)
        except np.linalg.LinAlgError:
            return np.zeros(0)
        n = len(A)
        F = A + B @ RB[:, :n]
        hamiltonian = np.block(
            [[F, level * (B @ RB[:, n:])], [-level * (C.T @ SC), -F.T]],
        )
        if not np.isfinite(hamiltonian).all():
            return np.zeros(0)
        values = np.linalg.eigvals(hamiltonian)
        # A crossing that rounding moved off the axis costs nothing but a look too many.
        near = np.abs(values.real) <= 1e-6 * np.abs(values) + 1e-13 * np.abs(values).max()
        omega = np.unique(np.abs(values[near].imag))
        return 2 * np.arctan(omega) if self.discrete else omega

    def start(self) -> Vector:
        """Frequencies near which peaks are likely."""
        poles = self.closed.poles
        if self.discrete:
            guesses = np.concatenate([np.abs(np.angle(poles)), [0.0, np.pi / 2, np.pi]])
        else:
            guesses = np.concatenate([np.abs(poles), np.abs(poles.imag), [0.0]])
        guesses = np.unique(guesses)
        between = np.sqrt(guesses[1:] * guesses[:-1])
        return np.concatenate([guesses, between, [2 * guesses[-1]]])


def _largest(values: Complex) -> Vector:
    """Return the largest singular value of each of some matrices.

    Where it is far below that of another matrix, a bound from above stands for it: nobody looks for
    peaks there. Roots of sums of the singular values' second and eighth powers are such bounds.
    """
    if not np.isfinite(values).all():
        return np.full(len(values), np.inf)
    high = float(np.max(np.abs(values), initial=0.0))
    if high and not _SQUARED < high < 1 / _SQUARED:
        unit = np.ldexp(1.0, np.frexp(high)[1] - 1) if np.isfinite(high) else 2.0**1023
        return unit * _largest(values / unit)
    found = np.linalg.norm(values, axis=(1, 2))
    if min(values.shape[1:]) == 1:
        return found
    near = np.flatnonzero(found >= _FAR * np.linalg.norm(values[int(np.argmax(found))], 2))
    adjoint = values[near].conj().swapaxes(1, 2)
    wide = values.shape[1] <= values.shape[2]
    gram = values[near] @ adjoint if wide else adjoint @ values[near]
    size = np.linalg.norm(gram, axis=(1, 2))
    unit = gram / np.where(size > 0, size, 1.0)[:, None, None]
    found[near] = np.sqrt(size * np.sqrt(np.linalg.norm(unit @ unit, axis=(1, 2))))
    top = int(near[np.argmax(found[near])])
    high = found[near] >= _FAR * np.linalg.norm(values[top], 2)
    found[near[high]] = np.sqrt(np.maximum(np.linalg.eigvalsh(gram[high])[:, -1], 0.0))
    return found


# The fourth powers of what is larger, and of its inverse, are within doubles.
_SQUARED = 1e-70
# Peaks are asked for within a twentieth of the highest; this leaves room.
_FAR = 0.9


def _continuous(closed: StaticLoop) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Map a discrete loop to a continuous one with the same norm (z = (1 + s)/(1 - s))."""
    A, B, C, D = closed.A, closed.B, closed.C, closed.D
    if not closed.plant.discrete:
        return A, B, C, D
    shifted = A + np.eye(len(A))
    X = np.linalg.solve(shifted, np.hstack([A - np.eye(len(A)), B]))
    n = len(A)
    Y = np.linalg.solve(shifted.T, C.T).T
    return X[:, :n], np.sqrt(2) * X[:, n:], np.sqrt(2) * Y, D - C @ X[:, n:]
