"""A stable weight with a stable inverse whose gain lies above given gains, as little as possible.

The square of a weight's gain is a ratio b / a of polynomials in the square of the frequency, both
positive, and every such ratio is one: it only has to be factorised. For a given ratio between the
weight and the gains, b and a obey linear inequalities, so that the smallest ratio is found by
bisection over linear programs [1]_.

References
----------
.. [1] S. Boyd, L. Vandenberghe, "Convex Optimization", Cambridge University Press (2004), section
   4.3.2; S.-P. Wu, S. Boyd, L. Vandenberghe, "FIR filter design via spectral factorization and
   convex optimization", in Applied and Computational Control, Signals and Circuits (1999).
"""

from __future__ import annotations

import control
import numpy as np
from numpy.polynomial import chebyshev
from scipy.optimize import linprog

from robustpolish.arrays import AnyVector, Matrix, Vector

# Gains below this share of the largest are taken as it.
_FLOOR = 1e-4
# Dips narrower than this factor of frequency are filled: no weight of a few states follows them.
_DIP = 4.0
# Beyond the first and the last frequency the weight keeps this share of the last gain.
_BEYOND = 0.5
# Width of the bisection, in the logarithm of the ratio of squares, at which it ends.
_SETTLED = 1e-3
_STEPS = 60
# Smallest size of a, relative to what it was before, that keeps roots off the axis.
_OFF_AXIS = 1e-5
# A further state has to lower the largest ratio by this share.
_WORTH = 2e-3
# Real part of a pole or zero over its size below which it is no longer off the axis.
_DAMPED = 1e-6
# By how much more a weight is raised than its response asks for, which is rounded itself.
_ROUNDING = 1e-8


def bounding_weight(omega: Vector, gains: Vector, order: int) -> control.StateSpace:
    """Return a weight W with ``|W(j omega)| >= gains``, nearest to them in decibels.

    Parameters
    ----------
    omega : ndarray, shape (n,)
        Frequencies in rad/s, rising and above 0.
    gains : ndarray, shape (n,)
        Above or equal to 0, some above.
    order : int
        Largest number of states; fewer where more are of no use.

    Returns
    -------
    control.StateSpace
        Continuous. Between the frequencies it is above the line through neighbours on logarithmic
        axes, and beyond them at least half of the gain at the end.
    """
    wanted = envelope(omega, gains)
    centre = float(np.sqrt(omega[0] * omega[-1]))
    x = (omega / centre) ** 2
    squares = wanted**2
    points = np.concatenate([x, np.sqrt(x[1:] * x[:-1]), [0.0, np.inf]])
    asked = np.concatenate(
        [squares, np.sqrt(squares[1:] * squares[:-1]), _BEYOND**2 * squares[[0, -1]]]
    )
    found: list[tuple[float, control.StateSpace]] = []
    start = np.array([asked.max()]), np.ones(1)
    for degree in range(order + 1):
        start = _Lines(points, asked, x.size, degree).nearest(start)
        b, a = start
        system = _sections(_factor(b) * centre, _factor(a) * centre)
        if system is None:
            continue
        # What programs and roots have lost is given back; nothing is believed.
        ratio = np.abs(system(1j * omega).ravel()) / wanted
        factor = 1 / float(ratio.min())
        found.append((float(ratio.max() * factor), raised(system, factor)))
    best = min(ratio for ratio, _ in found)
    return next(system for ratio, system in found if ratio <= (1 + _WORTH) * best)


def raised(system: control.StateSpace, factor: float) -> control.StateSpace:
    """Return a system of a larger gain, with something for the rounding of its response."""
    larger = factor * (1 + _ROUNDING)
    C, D = (larger * np.asarray(getattr(system, name)) for name in "CD")
    return control.StateSpace(system.A, system.B, C, D, system.dt)


def envelope(omega: Vector, gains: Vector) -> Vector:
    """Return gains with narrow dips filled: what a weight is fitted to.

    Parameters
    ----------
    omega, gains : ndarray, shape (n,)

    Returns
    -------
    ndarray, shape (n,)
    """
    floored = np.maximum(gains, _FLOOR * gains.max())
    half = np.sqrt(_DIP)
    first = np.searchsorted(omega, omega / half * (1 - 1e-12))
    last = np.searchsorted(omega, omega * half * (1 + 1e-12), side="right")
    spread = np.array([floored[i:j].max() for i, j in zip(first, last, strict=True)])
    return np.array([spread[i:j].min() for i, j in zip(first, last, strict=True)])


class _Lines:
    """Values of b / a that are asked for at squares of frequencies, as linear inequalities.

    Polynomials in x of a degree, over (1 + x) to that power, are polynomials in
    u = (x - 1) / (x + 1), which lies between -1 and 1: there they are sums of Chebyshev's.
    """

    def __init__(self, x: Vector, wanted: Vector, count: int, order: int) -> None:
        with np.errstate(invalid="ignore"):
            u: Vector = np.where(np.isinf(x), 1.0, (x - 1) / (x + 1))
        self.basis: Matrix = np.asarray(chebyshev.chebvander(u, order), dtype=float)
        self.wanted, self.count, self.order = wanted, count, order
        self.size = float(np.exp(np.mean(np.log(wanted[:count]))))

    def nearest(self, start: tuple[Vector, Vector]) -> tuple[Vector, Vector]:
        """Return b and a of the smallest largest ratio, from those of a degree less."""
        missing = (0, self.order + 1 - start[0].size)
        best = np.pad(start[0], missing), np.pad(start[1], missing)
        low, high = 0.0, self._reached(*best)
        for _ in range(_STEPS):
            if high - low <= _SETTLED:
                break
            middle = (low + high) / 2
            # Inequalities count relative to the a that was good enough last.
            found = self._at(float(np.exp(middle)), np.abs(self.basis @ best[1]))
            if found is not None and (reached := self._reached(*found)) < high:
                best, high = found, max(reached, low)
            else:
                low = middle
        return best

    def _reached(self, b: Vector, a: Vector) -> float:
        """Return the logarithm of the largest ratio, if b / a is raised above all that is asked."""
        ratio = (self.basis @ b) / (self.basis @ a) / self.wanted
        if not (ratio > 0).all():
            return np.inf
        return float(np.log(ratio[: self.count].max() / ratio.min()))

    def _at(self, ratio: float, weights: Vector) -> tuple[Vector, Vector] | None:
        """Return b and a with ``wanted <= b / a <= ratio wanted``, None if there are none."""
        n, T = self.order + 1, self.basis / weights[:, None]
        asked = T * (self.size / self.wanted)[:, None]  # b over what it should be
        slack, none = np.full((len(T), 1), ratio), np.zeros((len(T), 1))
        above = np.hstack([asked, -ratio * T, slack])[: self.count]
        rows = [np.hstack([-asked, T, none]), np.hstack([0 * T, -T, none]), above]
        limits = [np.zeros(len(T)), np.full(len(T), -_OFF_AXIS), np.zeros(self.count)]
        total = np.concatenate([np.zeros(n), T.mean(axis=0), [0.0]])
        found = linprog(
            np.concatenate([np.zeros(2 * n), [-1.0]]),
            np.vstack(rows), np.concatenate(limits), total[None], [1.0],
            bounds=[(None, None)] * (2 * n) + [(None, 1.0)], method="highs",
        )  # fmt: skip
        if found.x is None or found.x[-1] < 0:
            return None
        return found.x[:n] * self.size, found.x[n : 2 * n]


def _factor(values: Vector) -> AnyVector:
    """Return the roots s in the left half plane of a polynomial in -s^2 that is positive."""
    u = chebyshev.chebroots(chebyshev.chebtrim(values, 0)).astype(complex)
    x = (1 + u) / (1 - u)
    s = np.sqrt(-x)
    return np.where(np.real(s) > 0, -s, s)


def _sections(zeros: AnyVector, poles: AnyVector) -> control.StateSpace | None:
    """Return the system of zeros and poles; None if one of them is not off the axis."""
    roots = np.concatenate([zeros, poles])
    if zeros.size != poles.size or not (np.real(roots) < -_DAMPED * np.abs(roots)).all():
        return None
    result = control.StateSpace([], [], [], [[1.0]], 0)
    for top, bottom in zip(_pairs(zeros), _pairs(poles), strict=True):
        # Controllable form of top / bottom, in time units of its own rate.
        n = len(bottom) - 1
        rate = float(np.abs(bottom[-1]) ** (1 / n))
        powers = rate ** np.arange(n + 1)
        num, den = top / powers, bottom / powers
        A = np.vstack([-den[1:], np.eye(n - 1, n)]) * rate
        section = control.StateSpace(A, np.eye(n, 1) * rate, num[1:] - den[1:], [[1.0]], 0)
        result = section * result
    return result


def _pairs(roots: AnyVector) -> list[Vector]:
    """Return real polynomials of degree two, and at last one of degree one if the number is odd."""
    upper = sorted((s for s in roots.tolist() if s.imag > 1e-9 * abs(s)), key=abs)
    real = sorted((s.real for s in roots.tolist() if abs(s.imag) <= 1e-9 * abs(s)), key=abs)
    double = [np.array([1.0, -2 * s.real, abs(s) ** 2]) for s in upper]
    double += [np.poly(real[i : i + 2]) for i in range(0, len(real) - 1, 2)]
    ordered = sorted(double, key=lambda p: p[-1])
    return ordered + ([np.poly(real[-1:])] if len(real) % 2 else [])
