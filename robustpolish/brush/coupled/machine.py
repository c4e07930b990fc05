"""The machine that carries the brush, as its contact sees it: a linear system."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm, matrix_balance

from robustpolish.arrays import Matrix, Vector
from robustpolish.validation import described, invalid

_INSTANT = 1e-9  # share of a force's effect within a step that counts as none


@dataclass(frozen=True, eq=False)
class LinearMachine:
    """A linear machine that is pushed by the brush and by a steady force, and says where it is.

        x' = A x + B f + g,    displacement = C x,    velocity = C A x

    Attributes
    ----------
    A : ndarray, shape (n, n)
        Of the machine, or of its closed loop [1/s].
    B : ndarray, shape (n, 3)
        How the contact force on the brush, along world x, y, z [N], enters.
    g : ndarray, shape (n,)
        Steady part, such as the polishing force.
    C : ndarray, shape (3, n)
        Displacements of the brush's joint along world x, y, z [m].

    Raises
    ------
    InvalidInputError
        If a force moves the joint at once: C B has to be zero, as for every joint with a mass.

    Examples
    --------
    >>> import numpy as np
    >>> from robustpolish.brush.coupled.machine import LinearMachine
    >>> A = np.kron(np.eye(3), [[0.0, 1.0], [-1e8, -200.0]])
    >>> B, C = np.kron(np.eye(3), [[0.0], [5.0]]), np.kron(np.eye(3), [[1.0, 0.0]])
    >>> round(LinearMachine(A, B, np.zeros(6), C).stiffness[0])  # k/m = 1e8, m = 0.2 kg
    20000000
    """

    A: Matrix
    B: Matrix
    g: Vector
    C: Matrix

    def __post_init__(self) -> None:
        at_once = np.abs(self.C @ self.B)
        usual = np.abs(self.C) @ np.abs(self.B)
        if np.any(at_once > _INSTANT * usual):
            raise invalid(
                "design",
                described("a loop in which a force sets the brush in motion without delay"),
                "a brush with a mass, so that force changes its acceleration",
                "Give the place where the brush hangs a mass.",
            )

    def rest(self, force: Vector) -> Vector:
        """State of rest under a steady contact force on the brush.

        Parameters
        ----------
        force : ndarray, shape (3,)
            In N.

        Returns
        -------
        ndarray, shape (n,)

        Raises
        ------
        InvalidInputError
            If the machine has a pole at zero: then it has none.
        """
        # Balanced, for springs of 1e8 N/m and dampers of 1e-2 N s/m stand side by side.
        balanced, (scaling, _) = matrix_balance(self.A, permute=False, separate=True)
        if np.linalg.cond(balanced) > 1.0 / np.finfo(float).eps:
            raise invalid(
                "design",
                described("a loop that does not come to rest under a steady force"),
                "one without a pole at zero",
                "Add a stiffness to what can drift away.",
            )
        pushed = (self.B @ force + self.g) / scaling
        return np.asarray(-scaling * np.linalg.solve(balanced, pushed), dtype=float)

    @property
    def stiffness(self) -> Vector:
        """Static stiffness [N/m] of the joint along x, y and z against contact forces."""
        push = np.eye(3)
        zero = self.C @ self.rest(np.zeros(3))
        give = [self.C[i] @ self.rest(push[i]) - zero[i] for i in range(3)]
        return 1.0 / np.abs(np.array(give))

    def step_matrices(self, step: float) -> tuple[Matrix, Matrix, tuple[Matrix, ...]]:
        """Matrices of one step of the exponential Runge-Kutta method of order four.

        Parameters
        ----------
        step : float
            In s.

        Returns
        -------
        half, whole : ndarray, shape (n, n)
            exp(A h/2) and exp(A h).
        gains : tuple of ndarray, shape (n, 4)
            Q, f1, f2 and f3 of Cox and Matthews, times (B, g).

        References
        ----------
        S. M. Cox and P. C. Matthews, Exponential time differencing for stiff systems, Journal of
        Computational Physics 176 (2002), (26) to (29).
        """
        entry = np.column_stack([self.B, self.g])
        half, first_half = _phi_functions(self.A, 0.5 * step)[:2]
        whole, one, two, three = _phi_functions(self.A, step)
        gains = (
            0.5 * step * first_half @ entry,
            step * (one - 3.0 * two + 4.0 * three) @ entry,
            step * (two - 2.0 * three) @ entry,
            step * (4.0 * three - two) @ entry,
        )
        return half, whole, gains


def _phi_functions(A: Matrix, step: float) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """exp(h A) and phi_1, phi_2, phi_3 of h A, from one exponential of a larger matrix.

    Sidje, Expokit, ACM Transactions on Mathematical Software 24 (1998), theorem 1.
    """
    n = len(A)
    balanced, (scaling, _) = matrix_balance(A, permute=False, separate=True)
    large = np.zeros((4 * n, 4 * n))
    large[:n, :n] = step * balanced
    large[: 3 * n, n:] += np.eye(3 * n)
    blocks = np.asarray(expm(large))[:n].reshape(n, 4, n).swapaxes(0, 1)
    first, one, two, three = blocks * scaling[:, None] / scaling
    return first, one, two, three
