"""Branch and bound over real numbers, by polynomials in Bernstein's form."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import count, product
from math import comb, prod
from typing import Any, Literal

import flint
import numpy as np
from scipy.optimize import nnls

from robustpolish.base.arrays import SOLVED, AnyArray, Matrix, Vector
from robustpolish.base.budget import check_deadline
from robustpolish.linear.arithmetic.balls import identity, part, precision
from robustpolish.linear.arithmetic.exact import fraction
from robustpolish.robust.loop_model import (
    BITS,
    DeltaStructure,
    LoopModel,
    rounded,
    signal_positions,
)
from robustpolish.robust.scalings import Space, cover

# Polynomials in Bernstein's form: their values over a box lie between their coefficients.
#
# [1] M. Zettler, J. Garloff, "Robustness analysis of polynomials with polynomial parameter
# dependency using Bernstein expansion", IEEE Transactions on Automatic Control 43 (1998) 425-431.


def nodes(degree: int) -> list[Any]:
    """Return as many numbers as a polynomial needs, between 1/4 and 3/4, as flint.fmpq."""
    return [flint.fmpq(degree + 2 * j, 4 * degree) for j in range(degree + 1)]


@cache
def from_values(degree: int) -> AnyArray:
    """Return the matrix from values at the nodes to the coefficients between 0 and 1, exactly."""
    rows = [
        [comb(degree, k) * x**k * (1 - x) ** (degree - k) for k in range(degree + 1)]
        for x in nodes(degree)
    ]
    return np.array(flint.fmpq_mat(rows).inv().tolist(), dtype=object)


def from_powers(degree: int, low: float, high: float) -> Any:
    """Return the matrix from coefficients of powers to those over an interval, as arb_mat.

    Parameters
    ----------
    degree : int
    low, high : float
        Taken as exact.

    Returns
    -------
    flint.arb_mat, shape (degree + 1, degree + 1)
        To be multiplied from the right with rows of coefficients, the constant one first.
    """
    a, b = fraction(low), fraction(high)
    powers = range(degree + 1)
    # Of t between 0 and 1, which stands for a + (b - a) t.
    moved = [
        [comb(i, j) * a ** (i - j) * (b - a) ** j if j <= i else 0 for j in powers] for i in powers
    ]
    bernstein = [[flint.fmpq(comb(k, j), comb(degree, j)) for k in powers] for j in powers]
    return flint.arb_mat(flint.fmpq_mat(moved) * flint.fmpq_mat(bernstein))


def apply_along_axis(table: AnyArray, coefficients: AnyArray, axis: int) -> AnyArray:
    """Return what a matrix makes of an array along one of its axes."""
    return np.moveaxis(np.tensordot(table, coefficients, (1, axis)), 0, axis)


@cache
def halving_matrices(degree: int) -> tuple[Matrix, Matrix]:
    """Return the matrices from coefficients to those over the lower and the upper half.

    Their entries are exact, not negative, and sum up to 1 in a row.
    """
    count = range(degree + 1)
    lower = np.array([[comb(i, j) / 2.0**i for j in count] for i in count])
    return lower, lower[::-1, ::-1].copy()


def square(low: float, high: float, degree: int) -> AnyArray:
    """Return the coefficients of x^2 over an interval, for a degree of at least 2."""
    k = np.arange(degree + 1)
    mixed, last = k / degree, k * (k - 1) / (degree * (degree - 1))
    return low * low * (1 - 2 * mixed + last) + 2 * low * high * (mixed - last) + high * high * last


# Regions of real parameters and frequencies, with polynomials over each of them.

_UNIT = 2.0**-53
# Balls are taken so many times larger, for their weights not to count as length.
_CHEAP = 1e3


@dataclass(frozen=True)
class ParameterNorm:
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
        # What quotients and sums of doubles may be off beside the bounds that are counted,
        # relative.
        return self.size(nearest) * (1 - SOLVED)


def _cut(low: Vector, high: Vector, axis: int) -> tuple[Vector, Vector]:
    """Return the upper end of the lower half of a box, and the lower end of the upper one."""
    below, above = high.copy(), low.copy()
    below[axis] = above[axis] = (low[axis] + high[axis]) / 2
    return below, above


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
            return np.linalg.norm(N, axis=0) * (1 + SOLVED) + off
        matrices = np.moveaxis(N, 0, -1).reshape(*N.shape[1:], ny, nu)
        return np.linalg.norm(matrices, 2, axis=(-2, -1)) * (1 + SOLVED) + off

    def halved(self, axis: int) -> tuple[Region, Region]:
        """Return both halves across an axis."""
        sizes = np.abs(self.rows).max(axis=tuple(range(1, self.rows.ndim)))
        degree = self.rows.shape[axis + 1] - 1
        errors = self.errors + 4 * (degree + 2) * _UNIT * sizes
        if axis == len(self.low):
            middle = sum(self.band) / 2
            ends = {"band": (self.band[0], middle)}, {"band": (middle, self.band[1])}
        else:
            below, above = _cut(self.low, self.high, axis)
            ends = {"high": below}, {"low": above}
        one, two = (
            replace(self, rows=apply_along_axis(half, self.rows, axis + 1), errors=errors, **own)
            for half, own in zip(halving_matrices(degree), ends, strict=True)
        )
        return one, two

    def ball(self, together: tuple[int, ...], radius: float) -> AnyArray:
        """Return the coefficients of the sum of squares of some numbers less that of a radius."""
        shape = self.rows.shape[1:]
        total: AnyArray = np.full(shape, -radius * radius)
        for axis in together:
            own = square(float(self.low[axis]), float(self.high[axis]), shape[axis] - 1)
            total = total + own.reshape([-1 if i == axis else 1 for i in range(len(shape))])
        reach = np.maximum(np.abs(self.low), np.abs(self.high))[list(together)]
        return total - SOLVED * (radius * radius + float(reach @ reach))

    def crosses(self, together: tuple[int, ...], radius: float) -> bool:
        """Say whether a ball ends within the box."""
        reach = np.maximum(np.abs(self.low), np.abs(self.high))[list(together)]
        return bool(reach @ reach > radius * radius)


def bound(
    region: Region, parameter_norm: ParameterNorm, radius: float, aim: float
) -> tuple[float, tuple[AnyArray, ...]]:
    """Return what Bernstein coefficients prove over a region.

    With a direction y and weights of the balls (which are not positive within them), ::

        Re(conj(y) P) + weights . balls >= k ||N||    at all coefficients

    shows that ``|P| >= k ||N||``: a convex problem, with the nearest point of a hull as solution.

    Parameters
    ----------
    region : Region
    parameter_norm : ParameterNorm
    radius : float
        Of the balls.
    aim : float
        The size that one would like to prove.

    Returns
    -------
    size : float
        A k below which ``|P| > k ||N||`` within balls of the numbers: 0 for none; infinite if N is
        0, or there is none, and P is not 0.
    parts : tuple of ndarray
        Bernstein coefficients of what would have to be linear for the bound to be exact: what is
        left of P in the direction that proves it, or P and the balls if there is none.
    """
    P, norms = region.rows[0], region.norms
    error = float(region.errors[0]) + SOLVED * float(np.abs(P).max())
    wanted = norms.ravel() if norms.any() else np.ones(P.size)
    balls = [region.ball(g, radius) for g in parameter_norm.together if region.crosses(g, radius)]
    if any(ball.min() > 0 for ball in balls):
        return math.inf, ()
    unit = float(np.abs(P).max()) or 1.0
    rows = [P.real.ravel() / unit, P.imag.ravel() / unit]
    rows += [_CHEAP * ball.ravel() / np.abs(ball).max() for ball in balls]
    weights = _least(np.array(rows), wanted / wanted.max(), len(balls))
    length = math.hypot(*weights[:2])
    curved = (P / unit, *(ball / np.abs(ball).max() for ball in balls))
    if not length > 0:
        return 0.0, curved
    y = complex(*weights[:2]) / length
    excess = np.real(np.conj(y) * P)
    for ball, weight in zip(balls, weights[2:], strict=True):
        excess = excess + unit * _CHEAP * weight / length / np.abs(ball).max() * ball
    sure = excess - error - SOLVED * np.abs(excess)
    if not (sure > 0).all():
        return 0.0, curved
    if not norms.any():
        return math.inf, ()
    used = norms > 0
    size = float((sure[used] / norms[used]).min()) * (1 - SOLVED)
    return size, (excess - aim * norms,)


def _least(rows: Matrix, wanted: Vector, positive: int) -> Vector:
    """Return the shortest y with ``y @ rows >= wanted``, its last entries positive; else 0.

    By Lawson and Hanson's least distance programming.
    """
    count, columns = rows.shape
    table = np.zeros((count + 1, columns + positive))
    table[:count, :columns], table[count, :columns] = rows, wanted
    table[count - positive : count, columns:] = np.eye(positive)
    aim = np.eye(count + 1)[count]
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


def least_linear_axis(parts: tuple[AnyArray, ...]) -> int:
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


# Branch and bound over real parameters and frequencies.
#
# What scalings prove of many real numbers may be far below what is true, for they forget that a
# number is the same at all frequencies, and more. Over a small box and a short band, polynomials
# are nearly linear, and their Bernstein coefficients prove nearly all that is true [1]. The
# region with the lowest bound is halved, again and again, until none has one far below the
# witness.

Goal = Literal["pole", "both", "gain"]


# Of a polynomial at the beginning, beyond which there is no branching at all: those of five
# numbers that occur once each, and a gain, with 15 states.
_COEFFICIENTS = 4000
# Coefficients of all regions that are looked at: a few seconds.
_WORK = 1e8
# What looking at a region costs beside, in coefficients.
_OVERHEAD = 5e3
# Of frequency at the beginning, each an octave wide or more.
_BANDS = 10
# Regions after which a witness is looked for, and again after twice as many.
_PROBED = 8
# Part of the gap by which the size of numbers has to fall for a new beginning.
_AGAIN = 0.25

Probe = Callable[[Vector, float], float]
"""Looks for a witness near real numbers and a frequency; returns the size of the smallest yet."""


def can_branch(loop: LoopModel) -> bool:
    """Say whether a loop is one of few real numbers, with at most one other block, of one copy."""
    blocks, n = loop.structure.blocks, loop.model.states
    real = [block.copies for block in blocks if block.kind == "real"]
    others = [block for block in blocks if block.kind != "real"]
    if not real or not n or len(others) > 1 or any(block.copies != 1 for block in others):
        return False
    entries = 1 + sum(block.rows * block.columns for block in others)
    return prod(copies + 1 for copies in real) * (n + 1) * entries <= _COEFFICIENTS


def branch_and_bound(
    loop: LoopModel, goal: Goal, gap: float, proven: float, best: float, probe: Probe
) -> float:
    """Raise what is proven of a loop until it is near the smallest witness, or work runs out.

    Parameters
    ----------
    loop : LoopModel
        Stable, and one that :func:`can_branch`.
    goal : {"pole", "both", "gain"}
        Least size of real numbers that put a pole on the axis; least size of these and of the one
        other block together; or of that block alone, with the numbers up to size 1.
    gap : float
        Relative distance at which to stop.
    proven, best : float
        Sizes that are known: nothing happens below the first, the second is that of a witness.
    probe : callable
        Looks for a smaller witness: where the bound is lowest after 8, 16, 32, ... regions.

    Returns
    -------
    float
        A size below which nothing happens: at most the smallest witness less the gap.
    """
    norm, heap, begun = parameter_norm_of(loop.structure), [], 0.0
    numbers = count()

    def target() -> float:
        """Return the size that is to be proven."""
        return best / (1 + gap)

    def radius() -> float:
        """Return the radius of the balls of numbers that count together."""
        return 1.0 if goal == "gain" else target()

    def begin() -> None:
        """Take the whole box: regions that reach beyond the radius would have low bounds."""
        nonlocal begun
        begun = radius()
        heap.clear()
        with precision(BITS):
            regions = list(_regions(loop, begun, norm))
        for region in regions:
            add(region, proven)

    def add(region: Region, least: float) -> None:
        """Keep a region unless it is done, by its bound."""
        far = np.maximum(np.abs(region.low), np.abs(region.high)).max()
        near = norm.least(region.low, region.high)
        if near > radius() or (goal == "pole" and far <= proven):
            return
        size, parts = bound(region, norm, radius(), target())
        if goal == "pole":
            size = max(least, near) if size == 0 else math.inf
        else:
            size = max(least, size, near if goal == "both" else 0.0)
        if size < target():
            heapq.heappush(heap, (size, next(numbers), region, parts))

    try:
        begin()
    except ZeroDivisionError:
        return proven
    work, steps = 0.0, 0
    while heap and heap[0][0] < target() and work < _WORK:
        check_deadline()
        least, _, region, parts = heapq.heappop(heap)
        work += 2 * (region.rows.size + _OVERHEAD)
        steps += 1
        if steps >= _PROBED and steps & (steps - 1) == 0:
            best = probe(region.centre, region.frequency)
            if radius() < begun * (1 - _AGAIN * gap):
                begin()
                continue
        for half in region.halved(least_linear_axis(parts)):
            add(half, least)
    return max(proven, min(heap[0][0] if heap else math.inf, target()))


def parameter_norm_of(structure: DeltaStructure) -> ParameterNorm:
    """Return the gauge of the real numbers of a structure, in their order."""
    real = structure.only([k for k, b in enumerate(structure.blocks) if b.kind == "real"])
    alone = tuple(i for i, block in enumerate(real.blocks) if not block.group)
    return ParameterNorm(alone, real.together)


# A loop around real numbers as polynomials in them and in the frequency, in ball arithmetic.
#
# P is the characteristic polynomial of a loop with numbers in it, all denominators multiplied out,
# and N / P the system that the one other block sees: the loop has a pole at j w just if P(j w) = 0,
# and a block of size k that puts one there just if |P| <= k ||N||.


def _regions(loop: LoopModel, size: float, norm: ParameterNorm) -> Iterator[Region]:
    """Yield regions of the box of real numbers up to a size, one for each band of frequency.

    Raises
    ------
    ZeroDivisionError
        If the loop is not well posed at one of the numbers that are tried.
    """
    blocks, n = loop.structure.blocks, loop.model.states
    degrees = [block.copies for block in blocks if block.kind == "real"]
    shape = [degree + 1 for degree in degrees]
    polynomials, rest = _polynomials(loop)
    values = [
        polynomials([flint.arb(size) * flint.arb(2 * nodes(degree)[j] - 1)
                     for j, degree in zip(place, degrees, strict=True)])
        for place in np.ndindex(*shape)
    ]  # fmt: skip
    parts = np.array(values, dtype=object).reshape(*shape, -1, n + 1)
    parts = np.moveaxis(parts, -2, 0)
    for axis, degree in enumerate(degrees):
        parts = apply_along_axis(from_values(degree), parts, axis + 1)
    for axis in (i + 1 for group in norm.together for i in group):  # a ball is of degree 2
        if parts.shape[axis] == 2:
            low, high = np.take(parts, [0], axis), np.take(parts, [1], axis)
            parts = np.concatenate([low, (low + high) / 2, high], axis=axis)
    # At s = j w, as coefficients of powers of w.
    real, imag = (
        parts * np.array([signs[power % 4] for power in range(n + 1)], dtype=object)
        for signs in ((1, 0, -1, 0), (0, 1, 0, -1))
    )
    ends = np.full(len(degrees), size)
    middle, radius = (
        np.vectorize(number, otypes=[float]) for number in (float, lambda x: float(x.rad()))
    )
    edges = _edges(loop)
    for start, stop in zip([0.0, *edges], [*edges, math.inf], strict=True):
        above = math.isinf(stop)
        band = (0.0, 1 / start) if above else (start, stop)
        matrix, both = from_powers(n, *band), []
        for one in (real, imag):
            flat = (one[..., ::-1] if above else one).reshape(-1, n + 1)
            both.append(np.array((flint.arb_mat(flat.tolist()) * matrix).tolist(), dtype=object))
        rows = (middle(both[0]) + 1j * middle(both[1])).reshape(parts.shape)
        largest = np.abs(rows).reshape(len(rows), -1).max(axis=1)
        radii = np.maximum(*map(radius, both)).reshape(len(rows), -1).max(axis=1)
        errors = 2 * radii + 4 * _UNIT * largest
        yield Region(rows, errors, rest, -ends, ends.copy(), band, above)


def _polynomials(loop: LoopModel) -> tuple[Callable[[list[Any]], list[list[Any]]], tuple[int, int]]:
    """Return P and the entries of N as functions of the real numbers, and the shape of N.

    Each is a list of coefficients, the constant one first.
    """
    structure, n = loop.structure, loop.model.states
    kinds = [block.kind == "real" for block in structure.blocks]
    real, others = np.flatnonzero(kinds), np.flatnonzero(np.logical_not(kinds))
    z, out = (signal_positions(structure.inputs, own) for own in (real, others))
    w, into = (signal_positions(structure.outputs, own) for own in (real, others))
    A, B, C, D = loop.balls
    B1, B2, C1, C2 = part(B, columns=w), part(B, columns=into), part(C, z), part(C, out)
    (D11, D12), (D21, D22) = ([part(D, rows, own) for own in (w, into)] for rows in (z, out))
    copies = [structure.blocks[k].copies for k in real]

    def polynomials(numbers: list[Any]) -> list[list[Any]]:
        gains = flint.arb_mat(len(w), len(w))
        for i, value in enumerate(np.repeat(np.array(numbers, dtype=object), copies)):
            gains[i, i] = value
        back = identity(len(w)) - D11 * gains
        scale, onto = back.det(), gains * back.inv()
        closed = A + B1 * onto * C1
        P = closed.charpoly()
        found = [P * scale]
        entering, leaving = B2 + B1 * onto * D12, C2 + D21 * onto * C1
        direct = D22 + D21 * onto * D12
        for i, j in product(range(len(out)), range(len(into))):
            # det(s - A + b c) = det(s - A) (1 + c (s - A)^-1 b)
            shifted = (closed - part(entering, columns=[j]) * part(leaving, [i])).charpoly()
            found.append((shifted - P + P * direct[i, j]) * scale)
        return [[one[power] for power in range(n + 1)] for one in found]

    return polynomials, (len(out), len(into))


def _edges(loop: LoopModel) -> list[float]:
    """Return where bands of frequency meet: powers of 2."""
    poles = np.abs(np.linalg.eigvals(loop.model.A))
    poles = poles[poles > 0]
    low = math.floor(math.log2(poles.min() if poles.size else 1.0))
    high = math.ceil(math.log2(poles.max() if poles.size else 1.0)) + 1
    step = max(1, math.ceil((high - low) / _BANDS))
    return [2.0**power for power in range(low, high + 1, step)]


# Branch and bound over real numbers beside any other blocks: scalings for each part of their box.
#
# Over a small box a real number has little left to do, and scalings of the other blocks prove
# nearly all that is true there. Each part costs a cover of the axis, so there are few of them.


# Parts whose frequencies are covered: some tenths of a second each.
_COVERS = 24
# Of all covers together: some hundredths of a second each.
_INTERVALS = 200
# Of one cover.
_MOST = 50
# Of a cover, as a part of the gap that is left.
_SLACK = 0.2
# The largest one.
_MOST_SLACK = 0.1


def can_split(loop: LoopModel) -> bool:
    """Say whether there are real numbers beside other blocks."""
    kinds = {block.kind == "real" for block in loop.structure.blocks}
    return kinds == {True, False} and loop.model.states > 0


def split(
    loop: LoopModel, fixed: tuple[bool, ...] | None, gap: float, proven: float, best: float,
    probe: Probe,
) -> float:  # fmt: skip
    """Raise what is proven of a loop until it is near the smallest witness, or work runs out.

    Parameters
    ----------
    loop : LoopModel
        Stable, and one that :func:`can_split`.
    fixed : tuple of bool or None
        Blocks that have size 1 whatever the size of the others: all but the last one, or none.
    gap : float
        Relative distance at which to stop.
    proven, best : float
        Sizes that are known: nothing happens below the first, the second is that of a witness.
    probe : callable
        Looks for a smaller witness near real numbers and a frequency, where the bound is lowest
        after 1, 2, 4, ... steps; returns the size of the smallest yet.

    Returns
    -------
    float
        A size below which nothing happens.
    """
    parameter_norm = parameter_norm_of(loop.structure)
    real = [k for k, block in enumerate(loop.structure.blocks) if block.kind == "real"]
    radius = 1.0 if fixed else best / (1 + gap)
    ends = (radius,) * len(real)
    heap: list[Any] = [(proven, 0, -np.array(ends), np.array(ends), math.nan)]
    count = steps = work = 0
    while heap[0][0] < best / (1 + gap) and count < _COVERS and work < _INTERVALS:
        worst, _, low, high, _ = heapq.heappop(heap)
        steps += 1
        left = best / worst - 1 if worst > 0 else math.inf
        slack = min(_SLACK * max(gap, left), _MOST_SLACK)
        below, above = _cut(low, high, int(np.argmax(high - low)))
        for box in ((low, below), (above, high)):
            near = parameter_norm.least(*box)
            if near > radius:
                continue
            count += 1
            size, frequency, spent = _size(loop, fixed, real, box, best, slack)
            work += spent
            size = max(size, worst, 0.0 if fixed else near)
            heapq.heappush(heap, (size, count, *box, frequency))
        if not heap:
            return best / (1 + gap)
        _, _, low, high, frequency = heap[0]
        if steps & (steps - 1) == 0 and not math.isnan(frequency):
            best = probe((low + high) / 2, frequency)
    return max(proven, min(heap[0][0], best / (1 + gap)))


def _size(
    loop: LoopModel,
    fixed: tuple[bool, ...] | None,
    real: list[int],
    box: tuple[Vector, Vector],
    best: float,
    slack: float,
) -> tuple[float, float, int]:
    """Return a size of the other blocks that is proven for a box, where, and the intervals."""
    low, high = box
    reach = (high - low) / 2 + SOLVED * np.maximum(np.abs(low), np.abs(high))
    part = moved(loop, real, (low + high) / 2, reach)
    if part is None or np.linalg.eigvals(part.model.A).real.max() >= 0:
        return 0.0, math.nan, 0
    held = fixed or tuple(block.kind == "real" for block in loop.structure.blocks)
    space, start = Space(part.structure, held), 1 / best / (1 + slack)
    found = cover(part, space, start, part.seeds(), slack, _MOST)
    frequency = found.peaks[0][0] if found.peaks else math.nan
    spent = len(found.intervals) if found.complete else _MOST
    return (1 / found.level if found.complete else 0.0), frequency, spent


def moved(loop: LoopModel, real: list[int], centre: Vector, reach: Vector) -> LoopModel | None:
    """Return the loop around numbers of size 1, which stand for those of a box.

    Parameters
    ----------
    loop : LoopModel
    real : list of int
        Positions of the blocks that are real numbers.
    centre, reach : ndarray
        Of the box.

    Returns
    -------
    LoopModel or None
        With numbers that count alone; None if it is not well posed at the centre.
    """
    structure = loop.structure
    nz, nw = structure.shape
    A, B, C, D = loop.balls
    with precision(BITS):
        onto, scale = flint.arb_mat(nw, nz), identity(nw)
        for k, c, h in zip(real, centre, reach, strict=True):
            own = (
                signal_positions(places, [k]) for places in (structure.outputs, structure.inputs)
            )
            for w, z in zip(*own, strict=True):
                onto[w, z], scale[w, w] = float(c), float(h)
        try:
            back = (identity(nz) - D * onto).inv()
        except ZeroDivisionError:
            return None
        through = onto * back
        forward = (identity(nw) + through * D) * scale
        balls = A + B * through * C, B * forward, back * C, back * D * scale
    blocks = tuple(replace(block, group="") for block in structure.blocks)
    return replace(loop, structure=DeltaStructure(blocks), model=rounded(balls), balls=balls)
