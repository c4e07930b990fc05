"""Plant and controller as bare arrays, for the inner loops of the searches."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg

from robustpolish.arrays import AnyMatrix as Matrix
from robustpolish.models import GeneralizedPlant


@dataclass(frozen=True, eq=False)
class PlantMatrices:
    """The nine matrices of a plant as bare arrays: the one type that all searches work on.

    Attributes
    ----------
    A, B1, B2, C1, C2, D11, D12, D21, D22 : ndarray
        As in :class:`robustpolish.GeneralizedPlant`.
    discrete : bool
        Whether the plant is a discrete-time system.
    """

    A: Matrix
    B1: Matrix
    B2: Matrix
    C1: Matrix
    C2: Matrix
    D11: Matrix
    D12: Matrix
    D21: Matrix
    D22: Matrix
    discrete: bool = False

    @classmethod
    def of(cls, plant: GeneralizedPlant) -> PlantMatrices:
        """Copy the matrices out of a plant."""
        matrices = {name: getattr(plant, name) for name in _NAMES}
        return cls(**matrices, discrete=plant.is_discrete)

    @property
    def nx(self) -> int:
        """Number of states."""
        return self.A.shape[0]

    @property
    def nw(self) -> int:
        """Number of disturbances."""
        return self.B1.shape[1]

    @property
    def nu(self) -> int:
        """Number of controls."""
        return self.B2.shape[1]

    @property
    def nz(self) -> int:
        """Number of performance outputs."""
        return self.C1.shape[0]

    @property
    def ny(self) -> int:
        """Number of measurements."""
        return self.C2.shape[0]

    @cached_property
    def has_d22(self) -> bool:
        """Whether u reaches y directly."""
        return bool(np.any(self.D22))

    def replace(self, **matrices: Any) -> PlantMatrices:
        """Return the plant with some matrices exchanged."""
        return replace(self, **matrices)

    def in_states(self, into: Matrix, back: Matrix) -> PlantMatrices:
        """Return the plant in the states x_new = into x, with `back` the inverse of `into`."""
        return self.replace(
            A=into @ self.A @ back,
            B1=into @ self.B1,
            B2=into @ self.B2,
            C1=self.C1 @ back,
            C2=self.C2 @ back,
        )

    def without_d22(self) -> PlantMatrices:
        """Return the plant whose y lacks D22 u, which :func:`shift` accounts for."""
        return self.replace(D22=np.zeros_like(self.D22)) if self.has_d22 else self

    @cached_property
    def fingerprint(self) -> tuple[bytes, ...]:
        """What is the same for parts with the same matrices."""
        matrices = [np.ascontiguousarray(getattr(self, name)) for name in _NAMES]
        return (*(str(M.shape).encode() + M.tobytes() for M in matrices), bytes([self.discrete]))


_NAMES = ("A", "B1", "B2", "C1", "C2", "D11", "D12", "D21", "D22")


def with_price_and_noise(plant: PlantMatrices, epsilon: float) -> PlantMatrices:
    """Append epsilon times u to z and epsilon times noise on y to w; zero returns the plant."""
    if epsilon == 0:
        return plant
    P = plant
    return P.replace(
        B1=np.hstack([P.B1, np.zeros((P.nx, P.ny))]),
        C1=np.vstack([P.C1, np.zeros((P.nu, P.nx))]),
        D11=linalg.block_diag(P.D11, np.zeros((P.nu, P.ny))),
        D12=np.vstack([P.D12, epsilon * np.eye(P.nu)]),
        D21=np.hstack([P.D21, epsilon * np.eye(P.ny)]),
    )


def regularise(plant: PlantMatrices, epsilon: float) -> PlantMatrices:
    """Price u and x, and disturb y and x, a little.

    Appends epsilon times u and x to z, and epsilon times noise on y and x to w. Then D12
    and D21 have full rank and no zeros lie on the imaginary axis, whatever the plant. The norm
    of a loop with the regularised plant bounds the norm with the true one from above.

    Parameters
    ----------
    plant : PlantMatrices
        Scaled, so that epsilon is small compared with the entries.
    epsilon : float
        Zero returns the plant itself.
    """
    if epsilon == 0:
        return plant
    P, n = plant, plant.nx
    disturbed = P.replace(
        B1=np.hstack([P.B1, epsilon * np.eye(n)]),
        C1=np.vstack([P.C1, epsilon * np.eye(n)]),
        D11=linalg.block_diag(P.D11, np.zeros((n, n))),
        D12=np.vstack([P.D12, np.zeros((n, P.nu))]),
        D21=np.hstack([P.D21, np.zeros((P.ny, n))]),
    )
    return with_price_and_noise(disturbed, epsilon)


def shifted(plant: PlantMatrices, by: float) -> PlantMatrices:
    """Return a continuous plant whose imaginary axis lies at -by: A + by I in place of A.

    Zeros on the axis then lie beside it. A controller that stabilises the shifted plant, its own
    A shifted back, has a loop whose poles lie to the left of -by and whose norm over the
    half plane right of -by, and so over the axis (maximum principle), is that of the shifted
    loop. Hence the infimum rises with the shift: negative shifts bound the true one from below,
    positive ones from above.

    Parameters
    ----------
    plant : PlantMatrices
        Continuous.
    by : float
        In the plant's unit of frequency, of either sign.
    """
    return plant.replace(A=plant.A + by * np.eye(plant.nx)) if by else plant


class SystemMatrices(NamedTuple):
    """x' = A x + B u, y = C x + D u, without names: a closed loop from w to z, or a controller."""

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix


class Controller(SystemMatrices):
    """A controller x' = A x + B y, u = C x + D y."""

    @property
    def gain(self) -> float:
        """Largest absolute entry: how hard the controller is to verify and to build."""
        return max(float(np.abs(M).max(initial=0.0)) for M in self)

    def shifted_back(self, by: float) -> Controller:
        """Return the controller for a plant from that for the one :func:`shifted` by `by`."""
        return self._replace(A=self.A - by * np.eye(len(self.A))) if by else self


def close(plant: PlantMatrices, K: Controller) -> SystemMatrices:
    """Connect u = K y to a plant without D22."""
    P = plant
    return SystemMatrices(
        np.block([[P.A + P.B2 @ K.D @ P.C2, P.B2 @ K.C], [K.B @ P.C2, K.A]]),
        np.vstack([P.B1 + P.B2 @ K.D @ P.D21, K.B @ P.D21]),
        np.hstack([P.C1 + P.D12 @ K.D @ P.C2, P.D12 @ K.C]),
        P.D11 + P.D12 @ K.D @ P.D21,
    )


def shift(K: Controller, D22: Matrix) -> Controller | None:
    """Return the controller for the plant with D22 that acts as K does on the one without.

    K sees y - D22 u. None if I + Dk D22 is singular to working accuracy.
    """
    if not D22.any() or not (K.C.any() or K.D.any()):
        return K
    loop = np.eye(K.D.shape[0]) + K.D @ D22
    unit = balancing_scale(loop)
    if np.linalg.cond(loop * unit / unit[:, None]) > 1e10:
        return None
    C, D = np.linalg.solve(loop, K.C), np.linalg.solve(loop, K.D)
    return Controller(K.A - K.B @ D22 @ C, K.B - K.B @ D22 @ D, C, D)


def balanced(K: Controller) -> Controller:
    """Balance the controller's states by powers of two, which rounds nothing."""
    n = K.A.shape[0]
    if n == 0:
        return K
    size = np.zeros((n + 1, n + 1))
    size[:n, :n] = np.abs(K.A)
    size[:n, n] = np.abs(K.B).max(axis=1, initial=0.0)
    size[n, :n] = np.abs(K.C).max(axis=0, initial=0.0)
    scale = balancing_scale(size)
    t = scale[:n] / scale[n]
    return Controller(K.A * t / t[:, None], K.B / t[:, None], K.C * t, K.D)


def balancing_scale(size: Matrix) -> Matrix:
    """Return s such that the rows and columns of size * s / s[:, None] are alike in size.

    Parameters
    ----------
    size : ndarray, shape (n, n)
        Absolute values count only. Where an entry is not finite nothing is scaled.

    Returns
    -------
    ndarray, shape (n,)
        Powers of two.
    """
    if not (size.size and np.isfinite(size).all()):
        return np.ones(len(size))
    # SciPy casts permutation indices that were never set, and may complain about their values.
    with np.errstate(invalid="ignore"):
        _, (scale, _) = linalg.matrix_balance(size, permute=False, separate=True)
    return np.asarray(scale)
