"""Equations of motion with gyroscopic terms, their normal modes, and their state matrix.

    M q'' + (C + speed G) q' + (K + speed N) q = f

M and the symmetric part of K store energy, C takes it out, the skew G turns motion without work,
and N is what damping inside the shaft does because it turns with the shaft.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.linalg import block_diag, eigh

from robustpolish.arrays import AnyArray, AnyVector, Matrix, Vector
from robustpolish.validation import described, invalid

_MASSLESS = 1e-14
"""Below this ratio of the lowest squared frequency to its own, a mode has no mass but rounding."""
_LOOSE = 1e-13
"""Below this share of its largest eigenvalue, a scaled stiffness lets the rotor go."""


@dataclass(frozen=True, eq=False)
class SecondOrder:
    """Matrices of the equation of motion, all of shape (n, n), in SI units.

    Attributes
    ----------
    mass, damping, stiffness, gyroscopic, circulatory : ndarray
        M, C, K, G and N.
    planes : tuple of int
        How many coordinates, one behind the other, neither M nor K couples with the rest.
    """

    mass: Matrix
    damping: Matrix
    stiffness: Matrix
    gyroscopic: Matrix
    circulatory: Matrix
    planes: tuple[int, ...]

    def projected(self, *bases: Matrix) -> SecondOrder:
        """Return the equations of the motions that a basis of each plane describes (Galerkin)."""
        basis = np.asarray(block_diag(*bases))
        parts = (self.mass, self.damping, self.stiffness, self.gyroscopic, self.circulatory)
        own = (basis.T @ part @ basis for part in parts)
        return SecondOrder(*own, planes=tuple(each.shape[1] for each in bases))

    @property
    def parts(self) -> list[slice]:
        """Where the coordinates of each plane are."""
        ends = np.cumsum((0, *self.planes))
        return [slice(int(a), int(b)) for a, b in pairwise(ends)]

    @cached_property
    def normal_modes(self) -> tuple[Vector, Matrix]:
        """Natural frequencies in rad/s and shapes (n, m) of modal mass 1, at rest and undamped.

        Coordinates without mass move with the others and add no mode. Planes stay apart.
        """
        K = (self.stiffness + self.stiffness.T) / 2
        found = [_normal_modes(self.mass[part, part], K[part, part]) for part in self.parts]
        frequencies = np.concatenate([each for each, _ in found])
        order = np.argsort(frequencies, kind="stable")
        return frequencies[order], np.asarray(block_diag(*(s for _, s in found)))[:, order]

    def response(self, speed: float, s: AnyVector, forces: Matrix, seen: Matrix) -> AnyArray:
        """Return displacements by forces, shape (frequencies, outputs, inputs).

        Parameters
        ----------
        speed : float
        s : ndarray of complex
            Laplace's variable: j times frequencies in rad/s.
        forces, seen : ndarray, shapes (inputs, n) and (outputs, n)
            Rows that give the displacements at which forces act, and those that are seen.

        Returns
        -------
        ndarray of complex
        """
        shapes = self.normal_modes[1]
        stiff, damping = self.normal_forces(speed)
        B, C = (forces @ shapes).T, seen @ shapes
        s = s[:, None, None]
        return C @ np.linalg.solve(stiff + s**2 * np.eye(len(stiff)) + s * damping, B)

    def normal_forces(self, speed: float) -> tuple[Matrix, Matrix]:
        """Return stiffness and damping at a speed in normal coordinates."""
        frequencies, shapes = self.normal_modes
        skew = (self.stiffness - self.stiffness.T) / 2 + speed * self.circulatory
        damping = self.damping + speed * self.gyroscopic
        return shapes.T @ skew @ shapes + np.diag(frequencies**2), shapes.T @ damping @ shapes

    def state_matrix(self, speed: float) -> Matrix:
        """Return A of the states (w_i eta_i, eta_i'), shape (2 m, 2 m).

        eta are the normal coordinates and w_i their frequencies, so that all entries are of one
        size and poles keep their digits. A mode without stiffness takes the lowest other frequency
        for its own.

        Parameters
        ----------
        speed : float
            In rad/s.

        Returns
        -------
        ndarray
        """
        sizes = self.state_scale
        stiff, damping = self.normal_forces(speed)
        return np.block([[np.zeros_like(stiff), np.diag(sizes)], [-stiff / sizes, -damping]])

    @cached_property
    def state_scale(self) -> Vector:
        """What normal coordinates are multiplied by in the states, in rad/s, shape (m,)."""
        frequencies = self.normal_modes[0]
        moving = frequencies[frequencies > 0]
        lowest = moving.min() if moving.size else 1.0
        return np.where(frequencies > 0, frequencies, lowest)


def _normal_modes(mass: Matrix, stiffness: Matrix) -> tuple[Vector, Matrix]:
    sizes = np.sqrt(np.where(np.diag(stiffness) > 0, np.diag(stiffness), 1.0))
    M, K = mass / np.outer(sizes, sizes), stiffness / np.outer(sizes, sizes)
    own = np.linalg.eigvalsh(K)
    shift = 0.0
    if own[0] < _LOOSE * own[-1]:
        # Not held: a little stiffness in proportion to mass moves all squared frequencies alike.
        rough = float(np.trace(K) / np.trace(M)) if M.any() else 0.0
        squares = 1 / _inverse_squares(M, K, rough)[0] - rough
        shift = float(min((s for s in squares if s > 1e-6 * rough), default=rough))
    inverse, shapes = _inverse_squares(M, K, shift)
    squares = 1 / inverse - shift
    squares[np.abs(squares) < 1e-7 * shift] = 0.0
    shapes = shapes / sizes[:, None]
    shapes = shapes / np.sqrt(np.einsum("ij,ij->j", shapes, mass @ shapes))
    return np.sqrt(np.maximum(squares, 0.0)), shapes


def _inverse_squares(M: Matrix, K: Matrix, shift: float) -> tuple[Vector, Matrix]:
    """Return 1 / (w^2 + shift), largest first, and shapes, without those that have no mass."""
    try:
        inverse, shapes = eigh(M, K + shift * M)
    except np.linalg.LinAlgError:
        raise invalid(
            "discs",
            described("a part that nothing holds and that has no mass"),
            "a rotor in which all that is not held has mass and inertia",
            "Give the shaft a density, or the disc a mass and diametral inertia.",
        ) from None
    keep = inverse > _MASSLESS * inverse[-1]
    return inverse[keep][::-1], shapes[:, keep][:, ::-1]
