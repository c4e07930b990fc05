"""Parts of the space of real numbers and frequencies, with polynomials over each of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import nnls

from robustpolish.arrays import AnyArray, Matrix, Vector
from robustpolish.robust.branching.bernstein import along, halves, square

_UNIT = 2.0**-53
# What quotients and sums of doubles may be off beside the bounds that are counted, relative.
_ROUNDING = 1e-13
# Balls are taken so many times larger, for their weights not to count as length.
_CHEAP = 1e3


@dataclass(frozen=True)
class Gauge:
    """How large real numbers are: alone, or together within a ball.

    Attributes
    ----------
    alone : tuple of int
        Axes of numbers that count by themselves.
    together : tuple of tuple of int
        Axes of numbers of which the root of the sum of squares counts.
    """

    alone: tuple[int, ...]
    together: tuple[tuple[int, ...], ...]

    def size(self, numbers: Vector) -> float:
        """Return the size of numbers."""
        own = [abs(float(numbers[i])) for i in self.alone]
        return max([*own, *(float(np.linalg.norm(numbers[list(g)])) for g in self.together)])

    def least(self, low: Vector, high: Vector) -> float:
        """Return a size below that of all numbers of a box."""
        nearest = np.maximum(np.maximum(low, -high), 0.0)
        return self.size(nearest) * (1 - _ROUNDING)


@dataclass(frozen=True, eq=False)
class Region:
    """A box of real numbers and a band of frequencies, with polynomials over it.

    Attributes
    ----------
    rows : ndarray of complex, shape (1 + entries, degree + 1, ..., degree + 1)
        Bernstein coefficients of P and of the entries of N; an axis per number, the last one is
        that of the frequency.
    errors : ndarray, shape (1 + entries,)
        By how much coefficients may be off.
    rest : (int, int)
        Rows and columns of N.
    low, high : ndarray
        Ends of the box.
    band : (float, float)
        Ends of the band: frequencies, or their inverses.
    above : bool
        Whether they are inverses.
    """

    rows: AnyArray
    errors: Vector
    rest: tuple[int, int]
    low: Vector
    high: Vector
    band: tuple[float, float]
    above: bool

    @property
    def centre(self) -> Vector:
        """The middle of the box."""
        return (self.low + self.high) / 2

    @property
    def frequency(self) -> float:
        """The middle of the band; the end of the axis if that is in it."""
        if not self.band[0]:
            return math.inf if self.above else 0.0
        middle = (self.band[0] + self.band[1]) / 2
        return 1 / middle if self.above else middle

    @property
    def norms(self) -> AnyArray:
        """Bernstein coefficients of a function that is nowhere below the norm of N."""
        ny, nu = self.rest
        if not ny * nu:
            return np.zeros(self.rows.shape[1:])
        N, off = self.rows[1:], float(np.linalg.norm(self.errors[1:]))
        if min(ny, nu) == 1:
            return np.linalg.norm(N, axis=0) * (1 + _ROUNDING) + off
        matrices = np.moveaxis(N, 0, -1).reshape(*N.shape[1:], ny, nu)
        return np.linalg.norm(matrices, 2, axis=(-2, -1)) * (1 + _ROUNDING) + off

    def halved(self, axis: int) -> tuple[Region, Region]:
        """Return both halves across an axis."""
        sizes = np.abs(self.rows).max(axis=tuple(range(1, self.rows.ndim)))
        degree = self.rows.shape[axis + 1] - 1
        errors = self.errors + 4 * (degree + 2) * _UNIT * sizes
        lower, upper = (along(half, self.rows, axis + 1) for half in halves(degree))
        if axis == len(self.low):
            start, stop = self.band
            middle = (start + stop) / 2
            return (
                replace(self, rows=lower, errors=errors, band=(start, middle)),
                replace(self, rows=upper, errors=errors, band=(middle, stop)),
            )
        below, over = self.high.copy(), self.low.copy()
        below[axis] = over[axis] = (self.low[axis] + self.high[axis]) / 2
        return (
            replace(self, rows=lower, errors=errors, high=below),
            replace(self, rows=upper, errors=errors, low=over),
        )

    def ball(self, together: tuple[int, ...], radius: float) -> AnyArray:
        """Return the coefficients of the sum of squares of some numbers less that of a radius."""
        shape = self.rows.shape[1:]
        total: AnyArray = np.full(shape, -radius * radius)
        for axis in together:
            own = square(float(self.low[axis]), float(self.high[axis]), shape[axis] - 1)
            total = total + own.reshape([-1 if i == axis else 1 for i in range(len(shape))])
        reach = np.maximum(np.abs(self.low), np.abs(self.high))[list(together)]
        return total - _ROUNDING * (radius * radius + float(reach @ reach))

    def crosses(self, together: tuple[int, ...], radius: float) -> bool:
        """Say whether a ball ends within the box."""
        reach = np.maximum(np.abs(self.low), np.abs(self.high))[list(together)]
        return bool(reach @ reach > radius * radius)


@dataclass(frozen=True, eq=False)
class Bound:
    """A size k below which ``|P| > k ||N||`` over a region, within balls of its numbers.

    Attributes
    ----------
    size : float
        0 for none; infinite if N is 0, or there is none, and P is not 0.
    parts : tuple of ndarray
        Bernstein coefficients of what would have to be linear for the bound to be exact: what is
        left of P in the direction that proves it, or P and the balls if there is none.
    """

    size: float
    parts: tuple[AnyArray, ...]


def bound(region: Region, gauge: Gauge, radius: float, aim: float) -> Bound:
    """Return what Bernstein coefficients prove over a region.

    With a direction y and weights of the balls (which are not positive within them), ::

        Re(conj(y) P) + weights . balls >= k ||N||    at all coefficients

    shows that ``|P| >= k ||N||``: a convex problem, with the nearest point of a hull as solution.

    Parameters
    ----------
    region : Region
    gauge : Gauge
    radius : float
        Of the balls.
    aim : float
        The size that one would like to prove.
    """
    P, norms = region.rows[0], region.norms
    error = float(region.errors[0]) + _ROUNDING * float(np.abs(P).max())
    wanted = norms.ravel() if norms.any() else np.ones(P.size)
    balls = [region.ball(g, radius) for g in gauge.together if region.crosses(g, radius)]
    if any(ball.min() > 0 for ball in balls):
        return Bound(math.inf, ())
    unit = float(np.abs(P).max()) or 1.0
    rows = [P.real.ravel() / unit, P.imag.ravel() / unit]
    rows += [_CHEAP * ball.ravel() / np.abs(ball).max() for ball in balls]
    weights = _least(np.array(rows), wanted / wanted.max(), len(balls))
    length = math.hypot(*weights[:2])
    curved = (P / unit, *(ball / np.abs(ball).max() for ball in balls))
    if not length > 0:
        return Bound(0.0, curved)
    y = complex(*weights[:2]) / length
    excess = np.real(np.conj(y) * P)
    for ball, weight in zip(balls, weights[2:], strict=True):
        excess = excess + unit * _CHEAP * weight / length / np.abs(ball).max() * ball
    sure = excess - error - _ROUNDING * np.abs(excess)
    if not (sure > 0).all():
        return Bound(0.0, curved)
    if not norms.any():
        return Bound(math.inf, ())
    used = norms > 0
    size = float((sure[used] / norms[used]).min()) * (1 - _ROUNDING)
    return Bound(size, (excess - aim * norms,))


def _least(rows: Matrix, wanted: Vector, positive: int) -> Vector:
    """Return the shortest y with ``y @ rows >= wanted``, its last entries positive; else 0.

    By Lawson and Hanson's least distance programming.
    """
    count, columns = rows.shape
    table = np.zeros((count + 1, columns + positive))
    table[:count, :columns], table[count, :columns] = rows, wanted
    for i in range(positive):
        table[count - positive + i, columns + i] = 1.0
    aim = np.zeros(count + 1)
    aim[count] = 1.0
    try:
        found, _ = nnls(table, aim)
    except RuntimeError:  # too many steps: no proof here
        return np.zeros(count)
    left = aim - table @ found
    if not left[count] > 0:
        return np.zeros(count)
    y = -left[:count]
    if positive:
        y[-positive:] = np.maximum(y[-positive:], 0.0)
    return y


def bent(parts: tuple[AnyArray, ...]) -> int:
    """Return the axis across which functions are least linear."""
    axes = [axis for axis, count in enumerate(parts[0].shape) if count > 1]
    bends = dict.fromkeys(axes, 0.0)
    for i in axes:
        slopes = [np.diff(one, axis=i) for one in parts]
        for j in axes[axes.index(i) :]:
            bend = sum(float(np.abs(np.diff(s, axis=j)).max(initial=0.0)) for s in slopes)
            bends[i] += bend
            bends[j] += bend
    return max(axes, key=lambda axis: bends[axis])
