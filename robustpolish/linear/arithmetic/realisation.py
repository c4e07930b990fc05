"""State-space matrices as plain arrays, rescaled by powers of two so that nothing is rounded."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import control
import numpy as np
from scipy.linalg import lapack

from robustpolish.base.arrays import AnyMatrix, Matrix
from robustpolish.linear.arithmetic.powers_of_two import (
    LARGEST,
    FloatRangeError,
    entry_range_error,
    nearest_exponent,
)
from robustpolish.linear.systems import as_system

_lapack: Any = lapack


@dataclass(frozen=True, eq=False)
class Realisation:
    """The matrices of a system in scaled units, and how to come back.

    Attributes
    ----------
    A, B, C, D : ndarray
        Scaled matrices; every scale is a power of two, so they are exact.
    discrete : bool
        True for discrete time.
    step : float
        Sampling time in s (1 if none was given); 1 in continuous time.
    time : float
        Scaled frequency times `time` is rad/s; 1 in discrete time.
    gain : float
        Scaled gain times `gain` is the gain of the original system.
    source : control.StateSpace or None
        What :func:`realisation` read.
    """

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    discrete: bool
    step: float = 1.0
    time: float = 1.0
    gain: float = 1.0
    source: Any = None

    @property
    def states(self) -> int:
        """Number of states."""
        return self.A.shape[0]

    @property
    def matrices(self) -> dict[str, Matrix]:
        """A, B, C and D by name."""
        return {"A": self.A, "B": self.B, "C": self.C, "D": self.D}


def realisation(argument: str, system: Any) -> Realisation:
    """Read a system of any kind; an unspecified `dt` means continuous time."""
    system = as_system(argument, system)
    n, m, p = system.nstates, system.ninputs, system.noutputs
    discrete = bool(system.isdtime(strict=True))
    step = 1.0 if system.dt is None or system.dt is True or not discrete else float(system.dt)
    shapes = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}
    A, B, C, D = (
        np.array(getattr(system, name), dtype=float).reshape(s) for name, s in shapes.items()
    )
    return Realisation(A, B, C, D, discrete, step, source=system)


def named_like(
    system: control.StateSpace, A: Matrix, B: Matrix, C: Matrix, D: Matrix
) -> control.StateSpace:
    """Return a system of these matrices with the sampling time and names of another."""
    kinds = ("state", "input", "output")
    names: dict[str, Any] = {f"{kind}s": getattr(system, f"{kind}_labels") for kind in kinds}
    return control.StateSpace(A, B, C, D, system.dt, remove_useless_states=False, **names)


def power_of_two(value: float) -> float:
    """Return the power of two nearest to a positive `value`; 1 for zero and infinity."""
    return 2.0 ** nearest_exponent(value)


# Squares between these neither overflow nor lose digits.
_LEAST, _MOST = 1e-260, 1e260
_LEAST_NORMAL = float(np.finfo(float).tiny)


def size(M: AnyMatrix) -> float:
    """Return the Frobenius norm, without overflow."""
    square = np.vdot(M, M).real
    if _LEAST < square < _MOST:
        return math.sqrt(square)
    largest = float(np.abs(M).max(initial=0.0))
    if largest == 0 or not math.isfinite(largest):
        return largest
    return largest * float(np.linalg.norm(M / largest))


def state_scales(
    A: Matrix, B: Matrix | None = None, C: Matrix | None = None
) -> tuple[Matrix, float]:
    """Balance A by powers of two, together with B and C if they are given.

    All inputs together, and all outputs together, are treated as one more
    state, because only a common factor of them may be traded for a gain.

    Returns
    -------
    scales : ndarray of shape (n,)
        x = scales * (scaled x).
    signal : float
        B is multiplied by `signal` and C divided by it.
    """
    from robustpolish.linear.arithmetic.even_units import balance

    n, signals = A.shape[0], False
    M = np.array(A, dtype=float, order="C")
    if B is not None and C is not None:
        M, signals = np.zeros((n + C.shape[0], n + B.shape[1])), True
        M[:n, :n], M[:n, n:], M[n:, :n] = A, B, C
    if not np.isfinite(M).all():
        raise FloatRangeError
    rows, columns = (np.zeros(size, np.int64) for size in M.shape)
    balance(M, n, rows, columns, signals)
    scales = np.ldexp(1.0, columns)
    return scales[:n], float(scales[n]) if scales.size > n else 1.0


def rescaled(system: Realisation) -> Realisation:
    """Balance the states, then choose units of time and gain that make the entries near one."""
    if system.states == 0:
        return system
    # Imports Numba, which what only holds a realisation does without.
    from robustpolish.linear.arithmetic.even_units import (
        equilibrate_signals,
        equilibrate_states,
        is_exact_scaling,
    )

    n, m, p = system.states, system.B.shape[1], system.C.shape[0]
    given = np.empty((n + p, n + m))
    given[:n, :n], given[:n, n:] = system.A, system.B
    given[n:, :n], given[n:, n:] = system.C, system.D
    M, rows, columns = given.copy(), np.zeros(n + p, np.int64), np.zeros(n + m, np.int64)
    rates = [equilibrate_states(M, n, rows, columns, not system.discrete), 0]
    if not system.discrete:
        rates[1] = nearest_exponent(typical_rate(M[:n, :n]))
    gains = equilibrate_signals(M, n, rows, columns, rates[1])
    try:
        time, gain = _times(system.time, rates), _times(system.gain, gains)
    except OverflowError:
        time = gain = math.inf
    known = _LEAST_NORMAL <= time < math.inf and 0 < gain < math.inf
    if not (known and is_exact_scaling(M, rows, columns, given, LARGEST)):
        raise entry_range_error("system", system.matrices)
    A, B, C, D = M[:n, :n].copy(), M[:n, n:].copy(), M[n:, :n].copy(), M[n:, n:].copy()
    return Realisation(A, B, C, D, system.discrete, system.step, time, gain)


def _times(value: float, exponents: Iterable[int]) -> float:
    """Multiply by powers of two, one after the other, none of which may leave the doubles."""
    for exponent in exponents:
        value = math.ldexp(value, exponent)
        if value == 0:
            raise OverflowError
    return value


def typical_rate(A: Matrix) -> float:
    """Return the geometric mean of the magnitudes of the eigenvalues that are not zero."""
    if not A.size:
        return 1.0
    factors = _lapack.dgetrf(A)[0]  # silent where A is singular
    pivots = [abs(pivot) for pivot in factors.diagonal().tolist()]
    if min(pivots) > 1e-6 * max(pivots):  # no eigenvalue is nearly zero
        return math.exp(sum(map(math.log, pivots)) / len(pivots))
    rates = np.abs(np.linalg.eigvals(A))
    rates = rates[rates > np.finfo(float).eps * size(A)]
    return float(np.exp(np.mean(np.log(rates)))) if rates.size else 1.0
