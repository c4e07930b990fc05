"""The matrices of a state-feedback problem and its loop, without names and units."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.analysis import h2_norm, hinf_norm
from robustpolish.models import GeneralizedPlant

Matrix = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class StateFeedbackProblem:
    """x' = A x + B1 w + B2 u, z = C x + D11 w + D12 u, u = F x; in discrete time x' is x(k + 1).

    Attributes
    ----------
    A, B1, B2, C, D11, D12 : ndarray
        Shapes (nx, nx), (nx, nw), (nx, nu), (nz, nx), (nz, nw), (nz, nu).
    discrete : bool
        Whether time is discrete.
    """

    A: Matrix
    B1: Matrix
    B2: Matrix
    C: Matrix
    D11: Matrix
    D12: Matrix
    discrete: bool

    @classmethod
    def of(cls, plant: GeneralizedPlant) -> StateFeedbackProblem:
        """Copy the matrices out of a plant."""
        return cls(plant.A, plant.B1, plant.B2, plant.C1, plant.D11, plant.D12, plant.is_discrete)

    @property
    def nx(self) -> int:
        """Number of states."""
        return self.A.shape[0]

    @property
    def nu(self) -> int:
        """Number of controls."""
        return self.B2.shape[1]

    def loop(self, F: Matrix) -> control.StateSpace:
        """Return the loop from w to z."""
        return control.StateSpace(
            self.A + self.B2 @ F,
            self.B1,
            self.C + self.D12 @ F,
            self.D11,
            True if self.discrete else 0,
        )

    def achieved(self, F: Matrix | None, norm: str) -> float:
        """Return the norm that F achieves; infinite where the loop is unstable."""
        if F is None or not np.isfinite(F).all() or not self.is_stable(F):
            return math.inf
        if not self.B1.size or not self.C.size:
            return 0.0
        loop = self.loop(F)
        return float(hinf_norm(loop) if norm == "hinf" else h2_norm(loop))

    def is_stable(self, F: Matrix) -> bool:
        """Return whether all poles of the loop are stable."""
        poles = np.linalg.eigvals(self.A + self.B2 @ F)
        return bool((np.abs(poles) < 1).all() if self.discrete else (poles.real < 0).all())

    def with_price(self, price: float) -> StateFeedbackProblem:
        """Append `price` times u to z, and a thousandth of it times x: no rank is missing then."""
        nx, nu, nw = self.nx, self.nu, self.B1.shape[1]
        return replace(
            self,
            C=np.vstack([self.C, np.zeros((nu, nx)), 1e-3 * price * np.eye(nx)]),
            D11=np.vstack([self.D11, np.zeros((nu + nx, nw))]),
            D12=np.vstack([self.D12, price * np.eye(nu), np.zeros((nx, nu))]),
        )

    def only_effort(self, state_weight: float) -> StateFeedbackProblem:
        """Return the problem of stabilising with little effort, whatever w and z are."""
        nx, nu = self.nx, self.nu
        return replace(
            self,
            B1=np.eye(nx),
            C=np.vstack([state_weight * np.eye(nx), np.zeros((nu, nx))]),
            D11=np.zeros((nx + nu, nx)),
            D12=np.vstack([np.zeros((nx, nu)), np.eye(nu)]),
        )

    def with_noise(self, share: float) -> StateFeedbackProblem:
        """Append a disturbance on every state, `share` times as large as those that are there."""
        nx = self.nx
        size = share * (float(np.linalg.norm(self.B1, 2)) if self.B1.size else 1.0)
        return replace(
            self,
            B1=np.hstack([self.B1, size * np.eye(nx)]),
            D11=np.hstack([self.D11, np.zeros((self.C.shape[0], nx))]),
        )

    def compressed(self) -> StateFeedbackProblem:
        """Return the problem with as few performance outputs as give the same norms."""
        columns = np.hstack([self.C, self.D11, self.D12])
        if columns.shape[0] <= columns.shape[1]:
            return self
        R: Any = np.linalg.qr(columns, mode="r")
        nx, nw = self.nx, self.B1.shape[1]
        return replace(self, C=R[:, :nx], D11=R[:, nx : nx + nw], D12=R[:, nx + nw :])

    def in_states(self, T: Matrix) -> StateFeedbackProblem:
        """Return the problem for states x = T x_new; gains go back as F = F_new inv(T)."""
        return replace(
            self,
            A=np.linalg.solve(T, self.A @ T),
            B1=np.linalg.solve(T, self.B1),
            B2=np.linalg.solve(T, self.B2),
            C=self.C @ T,
        )
