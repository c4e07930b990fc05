"""State-space matrices as plain arrays, rescaled by powers of two so that nothing is rounded."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import control
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from robustpolish.arrays import Matrix
from robustpolish.exact.exponents import BeyondDoublesError, refuse_beyond, within_doubles
from robustpolish.validation import state_space

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
    """

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    discrete: bool
    step: float = 1.0
    time: float = 1.0
    gain: float = 1.0

    @property
    def states(self) -> int:
        """Number of states."""
        return self.A.shape[0]

    @property
    def matrices(self) -> dict[str, Matrix]:
        """A, B, C and D by name."""
        return {"A": self.A, "B": self.B, "C": self.C, "D": self.D}


def realisation(argument: str, system: Any) -> Realisation:
    """Read a validated ``control.StateSpace``; an unspecified `dt` means continuous time."""
    system = state_space(argument, system)
    n, m, p = system.nstates, system.ninputs, system.noutputs
    discrete = bool(system.isdtime(strict=True))
    step = 1.0 if system.dt is None or system.dt is True or not discrete else float(system.dt)
    return Realisation(
        np.array(system.A, dtype=float).reshape(n, n),
        np.array(system.B, dtype=float).reshape(n, m),
        np.array(system.C, dtype=float).reshape(p, n),
        np.array(system.D, dtype=float).reshape(p, m),
        discrete,
        step,
    )


def named_like(
    system: control.StateSpace, A: Matrix, B: Matrix, C: Matrix, D: Matrix
) -> control.StateSpace:
    """Return a system of these matrices with the sampling time and names of another."""
    return control.StateSpace(
        A,
        B,
        C,
        D,
        system.dt,
        states=system.state_labels,
        inputs=system.input_labels,
        outputs=system.output_labels,
        remove_useless_states=False,
    )


def power_of_two(value: float) -> float:
    """Return the power of two nearest to a positive `value`; 1 for zero and infinity."""
    if not (value > 0 and math.isfinite(value)):
        return 1.0
    return 2.0 ** min(max(round(math.log2(value)), -1000), 1000)


# Squares between these neither overflow nor lose digits.
_LEAST, _MOST = 1e-260, 1e260
_LEAST_NORMAL = float(np.finfo(float).tiny)


def size(M: Matrix) -> float:
    """Return the Frobenius norm, without overflow."""
    square = np.vdot(M, M)
    if _LEAST < square < _MOST:
        return math.sqrt(square)
    largest = float(np.abs(M).max(initial=0.0))
    if largest == 0 or not math.isfinite(largest):
        return largest
    return largest * float(np.linalg.norm(M / largest))


def _row_sizes(M: Matrix) -> Matrix:
    squares = np.einsum("ij,ij->i", M, M)
    if squares.size and squares.min() > _LEAST and squares.max() < _MOST:
        return np.sqrt(squares)
    largest = float(np.abs(M).max(initial=0.0)) or 1.0
    return largest * np.linalg.norm(M / largest, axis=1)


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
    n = A.shape[0]
    bordered = np.zeros((n + 1, n + 1))
    bordered[:n, :n] = A
    if B is not None and C is not None:
        bordered[:n, n] = _row_sizes(B)
        bordered[n, :n] = _row_sizes(C.T)
    if not np.isfinite(bordered).all():
        raise BeyondDoublesError
    scales = _lapack.dgebal(bordered, scale=1, permute=0, overwrite_a=1)[3]
    return scales[:n], float(scales[n])


def rescaled(system: Realisation) -> Realisation:
    """Balance the states, then choose units of time and gain that make the entries near one."""
    if system.states == 0:
        return system
    with within_doubles("system", system.matrices), np.errstate(over="ignore", under="ignore"):
        units = _Units(system)
        # The largest entry of A comes first, so that squares neither overflow nor vanish.
        units.rate(lambda A: float(np.abs(A).max()))
        units.balance(signals=False)
        units.rate(typical_rate)
        units.gains()
        for _ in range(2):
            units.balance(signals=True)
            units.gains()
        return units.exact()


class _Units:
    """The four matrices as one, and the powers of two that its rows and columns were given.

    What an exponent pushes out of the range of doubles on the way stays lost, so that one look back
    at the end says whether every step was exact.
    """

    def __init__(self, system: Realisation) -> None:
        n, m, p = system.states, system.B.shape[1], system.C.shape[0]
        self.system, self.n, self.time, self.gain = system, n, system.time, system.gain
        self.given = np.empty((n + p, n + m))
        self.given[:n, :n], self.given[:n, n:] = system.A, system.B
        self.given[n:, :n], self.given[n:, n:] = system.C, system.D
        self.found = self.given
        self.rows, self.columns = np.zeros(n + p, np.intc), np.zeros(n + m, np.intc)

    def _times(self, rows: NDArray[np.intc], columns: NDArray[np.intc]) -> None:
        self.rows += rows
        self.columns += columns
        self.found = np.ldexp(self.found, rows[:, None] + columns)

    def rate(self, of: Callable[[Matrix], float]) -> None:
        """Bring a rate of the state matrix near one; discrete time is left alone."""
        if self.system.discrete:
            return
        time = power_of_two(of(self.found[: self.n, : self.n]))
        self.time *= time
        if not _LEAST_NORMAL <= self.time < math.inf:
            raise BeyondDoublesError
        rows = np.zeros_like(self.rows)
        rows[: self.n] = -_exponent(time)
        self._times(rows, np.zeros_like(self.columns))

    def balance(self, signals: bool) -> None:
        """Balance the states, with the sizes of B and C or without."""
        n, rows, columns = self.n, np.zeros_like(self.rows), np.zeros_like(self.columns)
        given = (self.found[:n, n:], self.found[n:, :n]) if signals else ()
        scales, signal = state_scales(self.found[:n, :n], *given)
        if not (scales.min() > 0 and scales.max() < math.inf and 0 < signal < math.inf):
            raise BeyondDoublesError
        columns[:n] = np.frexp(scales)[1] - 1
        rows[:n] = -columns[:n]
        columns[n:] = _exponent(signal)
        rows[n:] = -_exponent(signal)
        self._times(rows, columns)

    def gains(self) -> None:
        """Bring the sizes of B and C near one, the gain takes what they lose."""
        n, rows, columns = self.n, np.zeros_like(self.rows), np.zeros_like(self.columns)
        b, c = (power_of_two(size(M)) for M in (self.found[:n, n:], self.found[n:, :n]))
        self.gain = b * c * self.gain
        if not 0 < self.gain < math.inf:
            raise BeyondDoublesError
        columns[n:], rows[n:] = -_exponent(b), -_exponent(c)
        self._times(rows, columns)

    def exact(self) -> Realisation:
        """Return the scaled system, if nothing was rounded."""
        refuse_beyond(self.found)
        back = np.ldexp(self.found, -(self.rows[:, None] + self.columns))
        if not np.array_equal(back, self.given):
            raise BeyondDoublesError
        n = self.n
        return replace(
            self.system,
            A=self.found[:n, :n].copy(),
            B=self.found[:n, n:].copy(),
            C=self.found[n:, :n].copy(),
            D=self.found[n:, n:].copy(),
            time=self.time,
            gain=self.gain,
        )


def _exponent(power: float) -> int:
    """Return the exponent of a power of two."""
    return math.frexp(power)[1] - 1


def typical_rate(A: Matrix) -> float:
    """Return the geometric mean of the magnitudes of the eigenvalues that are not zero."""
    if not A.size:
        return 1.0
    factors = _lapack.dgetrf(A)[0]  # silent where A is singular
    pivots = np.abs(np.diag(factors))
    if pivots.size and pivots.min() > 1e-6 * pivots.max():  # no eigenvalue is nearly zero
        return math.exp(np.log(pivots).sum() / pivots.size)
    rates = np.abs(np.linalg.eigvals(A))
    rates = rates[rates > np.finfo(float).eps * size(A)]
    return float(np.exp(np.mean(np.log(rates)))) if rates.size else 1.0
