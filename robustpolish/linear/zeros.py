"""Invariant zeros on the stability boundary, where Riccati equations lose their solution."""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np
import scipy.linalg as sla
from numpy.typing import NDArray

from robustpolish.base.checks import positive
from robustpolish.linear.arithmetic.realisation import Realisation, realisation
from robustpolish.linear.eigen import EPS
from robustpolish.linear.scaling import equilibrating_scales, in_units


@dataclass(frozen=True)
class AxisZero:
    """An invariant zero on or near the stability boundary.

    Attributes
    ----------
    frequency : float
        In rad/s, at least 0 (in discrete time the angle over the sampling time).
    distance : float
        Size of a relative change of the scaled matrices that puts a zero exactly
        on the boundary there: the smallest singular value that the normal rank leaves.
    """

    frequency: float
    distance: float


def zeros_on_axis(system: control.StateSpace, *, tolerance: float = 1e-9) -> tuple[AxisZero, ...]:
    r"""Find where on the stability boundary the system matrix loses rank.

    The matrix (A - lambda I, B; C, D) has its normal rank except at the invariant zeros. Those
    of (A, B2, C1, D12) and of (A, B1, C2, D21) on the imaginary axis (unit circle) break
    the assumptions of Riccati-based synthesis. Candidates are the generalised eigenvalues of the
    matrix, squared by two random compressions; each is then moved along the boundary to the least
    smallest singular value. It counts if that is within the tolerance and far below its
    surroundings. Zeros at infinity (a rank-deficient D)
    are not listed.

    Parameters
    ----------
    system : control.StateSpace
        The channel in question, continuous or discrete.
    tolerance : float, optional
        Largest relative distance that counts, in scaled units.

    Returns
    -------
    tuple of AxisZero
        By frequency; a pair counts once.

    Raises
    ------
    InvalidInputError
        If it is no ``StateSpace``, not finite, or the tolerance is not positive.

    Examples
    --------
    >>> import control
    >>> from robustpolish.linear import zeros_on_axis
    >>> notch = control.ss([[0, 1], [-1, -1]], [[0], [1]], [[3, -1]], 1)  # (s^2 + 4)/(s^2 + s + 1)
    >>> [round(zero.frequency, 6) for zero in zeros_on_axis(notch)]
    [2.0]
    """
    tolerance = positive("tolerance", tolerance)
    model = realisation("system", system)
    if 0 in model.D.shape:
        return ()
    m, p = model.B.shape[1], model.C.shape[0]
    each = [np.array([i]) for i in range(m)], [np.array([i]) for i in range(p)]
    scaled = in_units(model, equilibrating_scales(model, *each))
    pencil = _Pencil.of(scaled)
    found: list[AxisZero] = []
    for start in pencil.candidates():
        angle, distance = pencil.descend(start)
        frequency = angle * scaled.time / scaled.step
        if (
            distance <= tolerance
            and pencil.dips(angle, distance)
            and all(not _same(frequency, zero.frequency) for zero in found)
        ):
            found.append(AxisZero(float(frequency), distance))
    return tuple(sorted(found, key=lambda zero: zero.frequency))


def _same(one: float, other: float) -> bool:
    return abs(one - other) <= 1e-6 * max(abs(one), abs(other))


@dataclass(frozen=True, eq=False)
class _Pencil:
    """The system matrix P(s) = M - s N, its normal rank and its size."""

    M: NDArray[np.float64]
    N: NDArray[np.float64]
    rank: int
    size: float
    discrete: bool

    @classmethod
    def of(cls, model: Realisation) -> _Pencil:
        M = np.block([[model.A, model.B], [model.C, model.D]])
        N = np.zeros(M.shape)
        N[: model.states, : model.states] = np.eye(model.states)
        rng = np.random.default_rng(0)
        points = rng.standard_normal(3) + 1j * rng.standard_normal(3)
        size = float(np.linalg.norm(M, 2))
        rank = max(np.linalg.matrix_rank(M - s * N, tol=100 * EPS * max(size, 1)) for s in points)
        return cls(M, N, int(rank), size, model.discrete)

    def point(self, angle: float) -> complex:
        """Return the point of the boundary at a frequency (an angle in discrete time)."""
        return complex(np.exp(1j * angle)) if self.discrete else 1j * angle

    def candidates(self) -> list[float]:
        """Return frequencies near which a zero may lie."""
        rng = np.random.default_rng(1)
        rows, columns = self.M.shape
        found: list[float] = [0.0]
        for _ in range(2):
            left = rng.standard_normal((self.rank, rows))
            right = rng.standard_normal((columns, self.rank))
            with np.errstate(divide="ignore", invalid="ignore"):
                values = np.asarray(sla.eigvals(left @ self.M @ right, left @ self.N @ right))
            values = values[np.isfinite(values) & (np.abs(values) < 1e3 * max(self.size, 1))]
            found += list(np.abs(np.angle(values) if self.discrete else np.imag(values)))
        return found

    def smallest(self, angle: float) -> float:
        """Return the last singular value of the normal rank, relative to the matrices."""
        P = self.M - self.point(angle) * self.N
        singular = np.linalg.svd(P, compute_uv=False)
        return float(singular[self.rank - 1]) / max(self.size, 1e-300)

    def dips(self, angle: float, value: float) -> bool:
        """Tell a zero from the decay towards a zero at infinity: beside a zero the rank is full."""
        width = 0.03 * angle if angle else 0.03
        beside = min(self.smallest(abs(angle - width)), self.smallest(angle + width))
        return value <= 1e-3 * beside

    def descend(self, start: float) -> tuple[float, float]:
        """Minimise along the boundary by shrinking steps around the start."""
        angle, value = start, self.smallest(start)
        step = 0.1 * start if start else 0.01
        for _ in range(120):
            trials = [abs(angle - step), angle + step]
            values = [self.smallest(trial) for trial in trials]
            best = int(np.argmin(values))
            if values[best] < value:
                angle, value = trials[best], values[best]
            else:
                step *= 0.5
            if step <= EPS * max(angle, 1e-3):
                break
        # What rounding alone tells from zero is zero.
        if self.smallest(0.0) <= max(2 * value, 10 * EPS):
            angle, value = 0.0, self.smallest(0.0)
        return angle, value
