"""Coordinates in which the inequalities of one solve are well conditioned."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.synthesis.problem.full_state import in_states
from robustpolish.synthesis.problem.matrices import PlantMatrices
from robustpolish.synthesis.state_search.policy import POLICY


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Coordinates: x = T x_new, u = V u_new, Lyapunov rows times E, norms over `unit`.

    Attributes
    ----------
    T : ndarray, shape (nx, nx)
    V : ndarray, shape (nu, nu)
        Diagonal.
    E : ndarray, shape (nx, nx)
        A congruence: it changes the numbers that a solver sees, not the solutions.
    unit : float
    """

    T: Matrix
    V: Matrix
    E: Matrix
    unit: float

    @classmethod
    def plain(cls, p: PlantMatrices, unit: float) -> Coordinates:
        """Return the coordinates of the problem itself."""
        return cls(np.eye(p.nx), np.eye(p.nu), np.eye(p.nx), unit)

    def without_congruence(self) -> Coordinates:
        """Return the coordinates with E = I."""
        return replace(self, E=np.eye(self.T.shape[0]))

    def apply(self, p: PlantMatrices) -> PlantMatrices:
        """Return the problem in these coordinates, where its norm is about one."""
        q = in_states(p, self.T)
        root = math.sqrt(self.unit)
        return q.replace(
            B1=q.B1 / root,
            B2=q.B2 @ self.V,
            C1=q.C1 / root,
            D11=q.D11 / self.unit,
            D12=q.D12 @ self.V / root,
        )

    def gain(self, Y: Matrix, M: Matrix) -> Matrix:
        """Return F = M inv(Y) in the problem's coordinates."""
        return self.V @ np.linalg.solve(Y, M.T).T @ np.linalg.inv(self.T)

    def next(self, q: PlantMatrices, Y: Matrix, M: Matrix, even_out: bool) -> Coordinates:
        """Return the coordinates in which Y is the identity and the gain of order one.

        Parameters
        ----------
        q : PlantMatrices
            In these coordinates.
        Y, M : ndarray
            A solution in these coordinates.
        even_out : bool
            Whether E is to make the Lyapunov inequality the identity. Not for the H2 norm: there
            the inequality is tight at the optimum.

        Raises
        ------
        numpy.linalg.LinAlgError
            If Y is not positive, or if what takes us back is beyond doubles: units shrink without
            end where a gain of zero is the best.
        """
        values, vectors = np.linalg.eigh((Y + Y.T) / 2)
        if not values[-1] > 0:
            raise linalg.LinAlgError("Y is not positive")
        values = np.maximum(values, values[-1] * POLICY.smallest_share)
        step = vectors * np.sqrt(values)
        back = (vectors / np.sqrt(values)).T
        gains = np.linalg.norm(M @ back.T, axis=1)
        size = np.where(gains > 0, gains, 1.0)
        E = np.eye(q.nx)
        if even_out and not q.discrete:
            S = back @ (q.A @ Y + q.B2 @ M) @ back.T
            rates, directions = np.linalg.eigh(-(S + S.T))
            rates = np.maximum(rates, np.abs(rates).max() * POLICY.smallest_share)
            E = directions / np.sqrt(rates)
        T, V = self.T @ step, self.V * size
        if not all(np.isfinite(np.linalg.inv(M)).all() for M in (T, V)):
            raise linalg.LinAlgError("the coordinates are beyond doubles")
        return Coordinates(T, V, E, self.unit)
