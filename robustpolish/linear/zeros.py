"""Invariant zeros on the stability boundary, where Riccati equations lose their solution."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import control
import numpy as np
import scipy.linalg as sla

from robustpolish.base.checks import positive
from robustpolish.linear.arithmetic.realisation import realisation
from robustpolish.linear.scaling import equilibrating_scales, in_units
from robustpolish.linear.stability import EPS


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
    M = np.block([[scaled.A, scaled.B], [scaled.C, scaled.D]])
    N = np.zeros(M.shape)
    N[: scaled.states, : scaled.states] = np.eye(scaled.states)
    rng, size = np.random.default_rng(0), float(np.linalg.norm(M, 2))
    points = rng.standard_normal(3) + 1j * rng.standard_normal(3)
    ranks = [np.linalg.matrix_rank(M - s * N, tol=100 * EPS * max(size, 1)) for s in points]
    rank = int(max(ranks))

    def smallest(angle: float) -> float:
        """Return the last singular value of the normal rank, relative to the matrices."""
        point = complex(np.exp(1j * angle)) if scaled.discrete else 1j * angle
        singular = np.linalg.svd(M - point * N, compute_uv=False)
        return float(singular[rank - 1]) / max(size, 1e-300)

    rng, starts = np.random.default_rng(1), [0.0]
    for _ in range(2):
        left, right = (rng.standard_normal(shape) for shape in ((rank, len(M)), (len(M.T), rank)))
        with np.errstate(divide="ignore", invalid="ignore"):
            values = np.asarray(sla.eigvals(left @ M @ right, left @ N @ right))
        values = values[np.isfinite(values) & (np.abs(values) < 1e3 * max(size, 1))]
        starts += list(np.abs(np.angle(values) if scaled.discrete else np.imag(values)))
    found: list[AxisZero] = []
    for start in starts:
        angle, distance = _descended(smallest, start)
        frequency = angle * scaled.time / scaled.step
        # Beside a zero the rank is full, unlike in the decay towards a zero at infinity.
        width = 0.03 * angle if angle else 0.03
        beside = min(smallest(abs(angle - width)), smallest(angle + width))
        known = any(math.isclose(frequency, zero.frequency, rel_tol=1e-6) for zero in found)
        if distance <= min(tolerance, 1e-3 * beside) and not known:
            found.append(AxisZero(float(frequency), distance))
    return tuple(sorted(found, key=lambda zero: zero.frequency))


def _descended(smallest: Callable[[float], float], start: float) -> tuple[float, float]:
    """Minimise along the boundary by shrinking steps around the start."""
    angle, value = start, smallest(start)
    step = 0.1 * start if start else 0.01
    for _ in range(120):
        reached, trial = min((smallest(x), x) for x in (abs(angle - step), angle + step))
        if reached < value:
            angle, value = trial, reached
        else:
            step *= 0.5
        if step <= EPS * max(angle, 1e-3):
            break
    # What rounding alone tells from zero is zero.
    at_rest = smallest(0.0)
    return (0.0, at_rest) if at_rest <= max(2 * value, 10 * EPS) else (angle, value)
