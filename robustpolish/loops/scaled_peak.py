"""The peak of a response under diagonal uncertainty: an upper bound that holds between all points.

For every frequency there are scales D of the signals for which the largest singular value of
D M D^-1 is least (an upper bound of the structured singular value). Scales that are best at one
frequency are good around it; how far, tell the eigenvalues of a Hamiltonian matrix. Such intervals
are laid until they cover the axis.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize

from robustpolish.base.arrays import AnyMatrix, Vector
from robustpolish.linear.arithmetic.realisation import Realisation
from robustpolish.linear.norms.hinf import hamiltonian
from robustpolish.linear.stability import eigensystem
from robustpolish.robust.scalings import balanced

_SLACK = 1e-3
MOST_INTERVALS = 400
# An interval this narrow, relative to its frequency, proves nothing.
_NARROW = 1e-9
# Powers of the smooth stand-in of the largest singular value: rough, then sharp.
_POWERS = (4, 32)
# Where one signal does not act back on another, their scales drift apart for ever.
_LARGEST_LOG = 25.0


@dataclass(frozen=True)
class ScaledPeak:
    """Bounds of the structured peak, in the units of the continuous frequency it was sought over.

    Attributes
    ----------
    upper : float
        No frequency has a larger scaled gain.
    lower : float
        The largest scaled gain that was met.
    frequency : float
        Where it was met.
    covered : bool
        Whether intervals cover the axis; otherwise `upper` holds only where it was looked.
    """

    upper: float
    lower: float
    frequency: float
    covered: bool


def best_scales(M: AnyMatrix) -> tuple[float, Vector]:
    """Return the least largest singular value of D M D^-1 and the diagonal of D.

    Parameters
    ----------
    M : ndarray of complex, shape (k, k)

    Returns
    -------
    value : float
        An upper bound of the structured singular value for k complex numbers, equal to it up
        to k = 3 [1]_.
    scales : ndarray, shape (k,)

    References
    ----------
    .. [1] A. Packard, J. Doyle, "The complex structured singular value", Automatica 29 (1993)
       71-109, sections 8 and 9.

    Examples
    --------
    >>> import numpy as np
    >>> from robustpolish.loops.scaled_peak import best_scales
    >>> round(best_scales(np.array([[1.0, 100.0], [0.0, 1.0]]))[0], 2)
    1.0
    """
    k = M.shape[0]
    if k == 2:
        return _best_of_two(M)
    logs = np.log(balanced(np.abs(M))) if np.isfinite(M).all() else np.zeros(k)
    best = (_largest(M, logs), logs)
    size = best[0]
    if k == 1 or size == 0 or not math.isfinite(size):
        return size, np.exp(logs)
    for power in _POWERS:
        smooth = _smooth(M / size, power)
        found = minimize(
            smooth,
            np.clip(best[1], -_LARGEST_LOG, _LARGEST_LOG),
            jac=True,
            method="L-BFGS-B",
            bounds=[(-_LARGEST_LOG, _LARGEST_LOG)] * k,
            options={"maxiter": 60},
        )
        value = _largest(M, found.x)
        if value < best[0]:
            best = (value, found.x)
    return best[0], np.exp(best[1])


def scaled_peak(
    size: float,
    response: Callable[[float], AnyMatrix],
    seeds: Vector,
    around: Callable[[float, Vector, float], tuple[float, float]],
    most: int = MOST_INTERVALS,
) -> ScaledPeak:
    """Bound the structured peak of a stable continuous system over all frequencies.

    Parameters
    ----------
    size : float
        A frequency near the fastest of the system.
    response : callable
        Its value at a frequency, infinity included.
    seeds : ndarray
        Frequencies that are likely to be the worst.
    around : callable
        Takes a frequency, scales and a level, and returns the ends of an interval around the
        frequency in which the scaled response stays below the level, as :func:`interval` does.
    most : int, optional
        So many intervals are laid at most.

    Returns
    -------
    ScaledPeak
    """
    looked = {omega: best_scales(response(omega)) for omega in [0.0, math.inf, *seeds]}
    frequency = max(looked, key=lambda omega: looked[omega][0])
    lower = looked[frequency][0]
    if lower == 0:
        return ScaledPeak(0.0, 0.0, frequency, True)
    bare, covered = [(0.0, math.inf)], True
    for _ in range(most):
        if not bare:
            return ScaledPeak(lower * (1 + _SLACK), lower, frequency, covered)
        low, high = bare.pop()
        omega = _inside(low, high, size)
        value, scales = looked.get(omega) or best_scales(response(omega))
        if value > lower:
            lower, frequency = value, omega
        first, last = around(omega, scales, lower * (1 + _SLACK))
        if math.isinf(first):  # nothing is known of the end of the axis
            covered, first = False, size / _NARROW
        elif last - first <= _NARROW * omega:
            covered = covered and omega in (0.0, math.inf)
            last = max(omega * (1 + _NARROW), _NARROW * size)
            first = min(omega * (1 - _NARROW), size / _NARROW)
        if first > low:
            bare.append((low, first))
        if last < high:
            bare.append((last, high))
    return ScaledPeak(lower * (1 + _SLACK), lower, frequency, False)


def interval(model: Realisation, omega: float, scales: Vector, level: float) -> tuple[float, float]:
    """Return the frequencies around `omega` at which D M D^-1 stays below a level.

    Parameters
    ----------
    model : Realisation
    omega : float
        A frequency at which it does.
    scales : ndarray
        Diagonal of D.
    level : float

    Returns
    -------
    first, last : float
        Ends of the interval: no eigenvalue of the Hamiltonian matrix lies between them on the
        axis, nor so near to it that rounding could hide it there.
    """
    if not model.states:
        return 0.0, math.inf
    scaled = replace(
        model, B=model.B / scales, C=model.C * scales[:, None], D=model.D * scales[:, None] / scales
    )
    H = hamiltonian(scaled, level)
    if H is None or not np.isfinite(H).all():
        return omega, omega
    spectrum = eigensystem(H)
    values = spectrum.values
    near = np.abs(values.real) <= spectrum.errors
    heights = np.abs(values.imag[near])
    below, above = heights[heights <= omega], heights[heights >= omega]
    return float(below.max(initial=0.0)), float(above.min(initial=math.inf))


def _inside(low: float, high: float, size: float) -> float:
    """Return a frequency between two others: the ends of the axis first."""
    if low == 0 and high == math.inf:
        return 0.0
    if high == math.inf:
        return math.inf
    if low == 0:
        return 0.0 if high > _NARROW * size else high / 2
    return math.sqrt(low) * math.sqrt(high)


def _largest(M: AnyMatrix, logs: Vector) -> float:
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = M * np.exp(logs[:, None] - logs)
    return float(np.linalg.norm(scaled, 2)) if np.isfinite(scaled).all() else math.inf


def _best_of_two(M: AnyMatrix) -> tuple[float, Vector]:
    """Return the same for two signals, whose best scales even out the entries off the diagonal.

    Scales change neither the determinant nor the diagonal, so that the largest singular value is
    least where the sum of all squares is.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        off = np.log(np.abs([M[0, 1], M[1, 0]]))
        log = np.clip((off[0] - off[1]) / 2, -_LARGEST_LOG, _LARGEST_LOG)
    logs = np.array([0.0, log if math.isfinite(log) else 0.0])
    return _largest(M, logs), np.exp(logs)


def _smooth(M: AnyMatrix, power: int) -> Callable[[Vector], tuple[float, Vector]]:
    """Return the logarithm of the sum of powers of the singular values, and its slope."""

    def value(logs: Vector) -> tuple[float, Vector]:
        U, sizes, V = np.linalg.svd(M * np.exp(logs[:, None] - logs))
        largest = sizes[0]
        shares = (sizes / largest) ** (2 * power)
        total = shares.sum()
        slope = (np.abs(U) ** 2 - np.abs(V.conj().T) ** 2) @ (shares / total)
        return math.log(largest) + math.log(total) / (2 * power), slope

    return value
