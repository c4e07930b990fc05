"""Bounds of the peak of mu over all frequencies: scalings above, a witness below, branching."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice, product
from typing import Any

import flint
import numpy as np
import scipy.linalg as sla

from robustpolish.base.arrays import ROUNDING, SAME, SUMMED, AnyMatrix, AnyVector, Matrix, Vector
from robustpolish.base.budget import check_deadline
from robustpolish.linear.arithmetic import balls
from robustpolish.robust.branch_and_bound import (
    Goal,
    Probe,
    branch_and_bound,
    can_branch,
    can_split,
    split,
)
from robustpolish.robust.loop_model import DeltaStructure, LoopModel, signal_positions
from robustpolish.robust.scalings import (
    SLACK,
    Coverage,
    Inequality,
    ScaledBound,
    Space,
    cover,
    response,
)
from robustpolish.robust.witness import Witness, singular_directions, smallest_delta

GAP = 2e-3
"""Relative distance of both bounds that is small enough, if nothing else is asked for."""
EVERYWHERE = ((0.0, math.inf),)


# The exact stability margin of one repeated real parameter, with a proof.
#
# Poles leave the stable half-plane through the axis, where the sum of two of them is 0. With X of
# the Lyapunov operator and Y = k (C X + D Y), that is an eigenvalue 1 / k of a matrix that does not
# depend on k; and the loop stays well posed unless 1 / k is an eigenvalue of D. Discs of ball
# arithmetic that hold all eigenvalues show that there is no real one beyond a number.

_BITS = 240
# Rows of the matrix up to which it is worth while: balls of 60 x 60 take about a second.
_ROWS = 60
_STATES = 14
# What the proven size is smaller than the one of the witness, relative.
_SLACK = 1e-10


def proven_real_margin(loop: LoopModel, size: float) -> float | None:
    """Return the size of the number below which the loop is proven to be stable.

    Parameters
    ----------
    loop : LoopModel
        Stable and continuous.
    size : float
        Of the smallest number that is known to make it unstable.

    Returns
    -------
    float or None
        Just below `size`; None if there are other blocks, the loop is too large, or there is no
        proof.
    """
    blocks, n = loop.structure.blocks, loop.model.states
    if len(blocks) != 1 or blocks[0].kind != "real" or not 0 < n <= _STATES:
        return None
    if blocks[0].copies * n > _ROWS:
        return None
    least = size * (1 - _SLACK)
    with balls.precision(_BITS):
        try:
            operator, D = _operator(loop)
            clear = all(_has_no_real_eigenvalue_beyond(M, 1 / least) for M in (operator, D))
        except (ZeroDivisionError, ValueError, np.linalg.LinAlgError):
            return None
    return least if clear else None


def _operator(loop: LoopModel) -> tuple[balls.Ball, balls.Ball]:
    """Return the matrix from Y to C X + D Y with A X + X A' = -(B Y + Y' B'), and D."""
    A, B, C, D = loop.balls
    n = A.nrows()
    one = balls.identity(n)
    forward = _product(B, one)
    swapped = [j * n + i for i in range(n) for j in range(n)]
    turned = balls.part(forward, swapped, range(forward.ncols()))
    X = (_product(A, one) + _product(one, A)).solve(forward + turned)
    return flint.acb_mat(_product(D, one) - _product(C, one) * X), flint.acb_mat(D)


def _product(left: balls.Ball, right: balls.Ball) -> balls.Ball:
    """Return the Kronecker product."""
    shape = left.nrows() * right.nrows(), left.ncols() * right.ncols()
    rows = [[a * b for a in one for b in two] for one in left.tolist() for two in right.tolist()]
    return flint.arb_mat(*shape, [entry for row in rows for entry in row])


def _has_no_real_eigenvalue_beyond(matrix: balls.Ball, limit: float) -> bool:
    """Prove that no real eigenvalue has a size of a limit or more."""
    if not any(entry != 0 for entry in matrix.entries()):
        return True
    vectors = matrix.eig(right=True, algorithm="approx")[1]
    try:
        centres, radii = balls.gershgorin_discs(matrix, vectors)
    except ZeroDivisionError:  # eigenvectors that are the same: any size below the norm will do
        centres, radii = balls.gershgorin_discs(matrix, balls.complex_ball(np.eye(matrix.nrows())))
    real = np.abs(np.imag(centres)) <= radii
    return bool((np.abs(np.real(centres[real])) + radii[real] < limit).all())


# Stability margins along rays of all real parameters.
#
# Along a ray all numbers are one repeated real number k. The matrix A(k) has a pair of eigenvalues
# whose sum is 0 just if its Lyapunov operator is singular, which is an eigenvalue problem for 1 /
# k.

# Up to so many states the Lyapunov operator is inverted as a matrix: 900 x 900 takes 30 ms.
_RAY_STATES = 30
# Eigenvalues of the problem in one matrix: 600 take about half a second.
_LARGEST = 600
# How real an eigenvalue, and how near to the axis a pole, has to be to be a candidate that a
# search then takes to the axis.
_REAL = 1e-5
_ON_AXIS = 1e-4
# Newton steps that bring the pole to the axis, how near is enough, and how far they may go: of
# stiff loops the eigenvalues of the problem have few digits.
_NEWTON = 8
_CLOSE = 1e-2
# Corners of the box of real numbers that are looked at: all of up to six numbers.
_CORNERS = 32


@dataclass(frozen=True, eq=False)
class RayCrossing:
    """Where a ray meets the boundary of stability.

    Attributes
    ----------
    size : float
        Largest of the numbers; of those in a ball the root of the sum of squares.
    deltas : tuple of float
        Of each block.
    frequency : float
        In the units of the model.
    w : ndarray of complex
        The signals of the mode that is on the axis.
    """

    size: float
    deltas: tuple[float, ...]
    frequency: float
    w: AnyVector


def ray_crossings(loop: LoopModel, rays: Sequence[Vector] | None = None) -> list[RayCrossing]:
    """Return where rays of the real numbers leave stability to either side, nearest first.

    Parameters
    ----------
    loop : LoopModel
        Blocks that are not real are left at 0.
    rays : sequence of ndarray, optional
        Proportions of the real numbers; those of the corners of a box by default.

    Returns
    -------
    list of Crossing
        Empty where the search would be too large, or rounding hides where the poles are.
    """
    model, structure = loop.model, loop.structure
    real = [k for k, block in enumerate(structure.blocks) if block.kind == "real"]
    rows = sum(structure.blocks[k].copies for k in real)
    if not real or not 0 < model.states <= _RAY_STATES or rows * model.states > _LARGEST:
        return []
    A = model.A
    n = len(A)
    lyapunov = np.kron(A, np.eye(n)) + np.kron(np.eye(n), A)
    try:
        inverse: Any = np.linalg.inv(lyapunov)
    except np.linalg.LinAlgError:
        return []  # poles so near the axis, or of such sizes, that rounding sees them on it
    found: list[RayCrossing] = []
    for corner in _corners(structure, real) if rays is None else rays:
        deltas = np.zeros(len(structure.blocks))
        deltas[real] = corner
        found += _along(loop, inverse, deltas)
    return sorted(found, key=lambda crossing: crossing.size)


def _corners(structure: DeltaStructure, real: list[int]) -> Iterator[Vector]:
    """Yield corners of a box, one of each opposite pair: a fixed choice if there are many.

    Of numbers in a ball also those where one of them is largest.
    """
    count = len(real)
    for k in (k for group in structure.together for k in group):
        yield np.array([1.0 if j == k else 0.0 for j in real])
    if 2 ** (count - 1) <= _CORNERS:
        for signs in product((1.0, -1.0), repeat=count - 1):
            yield np.array([1.0, *signs])
        return
    random = np.random.default_rng(0)
    for _ in range(_CORNERS):
        yield random.choice([-1.0, 1.0], count)


def _along(loop: LoopModel, inverse: Matrix, deltas: Vector) -> Iterator[RayCrossing]:
    """Yield the nearest crossing of a ray to either side."""
    model, structure = loop.model, loop.structure
    A, n = model.A, model.states
    kept = signal_positions(structure.inputs, np.flatnonzero(deltas))
    spread = np.concatenate(
        [np.full(b.copies * b.rows, d) for b, d in zip(structure.blocks, deltas, strict=True)]
    )
    w = np.flatnonzero(spread)
    B, C = model.B[:, w] * spread[w], model.C[kept]
    D = model.D[kept][:, w] * spread[w]
    # Y of shape (r, n) to C X + D Y, with A X + X A' = -(B Y + Y' B').
    left = np.einsum("ai,jb->abij", B, np.eye(n)).reshape(n * n, -1)  # Y to B Y
    right = np.einsum("bi,ja->abij", B, np.eye(n)).reshape(n * n, -1)  # Y to Y' B'
    X = -(inverse @ (left + right))
    operator = np.kron(C, np.eye(n)) @ X + np.kron(D, np.eye(n))
    values = np.linalg.eigvals(operator)
    # Sizes beyond this many times the nearest are rounding, or of no interest.
    large = np.abs(values) > SAME * np.abs(values).max(initial=0.0)
    real = values[large & (np.abs(values.imag) <= _REAL * np.abs(values))].real

    def mode(k: float) -> tuple[complex, float, AnyVector] | None:
        """Return the pole nearest to the axis, what its real part changes by k, its signals z."""
        back = np.eye(len(D)) - k * D
        if np.linalg.cond(back) > 1e12:
            return None
        into = np.linalg.solve(back, C)
        modes: Any = sla.eig(A + k * B @ into, left=True)
        poles, lefts, rights = modes
        near = int(np.argmin(np.abs(np.real(poles)) / (np.abs(poles) + loop.rate * 1e-6)))
        x, y = rights[:, near], lefts[:, near]
        # The derivative of k (1 - k D)^-1 is (1 - k D)^-2.
        change, own = np.vdot(y, B @ np.linalg.solve(back, into @ x)), np.vdot(y, x)
        by_k = float(np.real(change / own)) if own else 0.0
        return complex(poles[near]), by_k if np.isfinite(by_k) else 0.0, into @ x

    def crossing(k: float) -> RayCrossing | None:
        """Return the mode on the axis at a number k of the ray, if there is one."""
        found = mode(k)
        for _ in range(_NEWTON):
            if found is None or not abs(found[1]) > 0 or abs(found[0].real) < SUMMED * loop.rate:
                break
            step = -found[0].real / found[1]
            nearer = mode(k + step) if abs(step) < _CLOSE * abs(k) else None
            if nearer is None or abs(nearer[0].real) >= abs(found[0].real):
                break
            k, found = k + step, nearer
        if found is None:
            return None
        pole, _, z = found
        signals = np.zeros(len(spread), complex)
        signals[w] = k * spread[w] * z
        far = abs(pole.real) > _ON_AXIS * max(abs(pole), loop.rate * 1e-3)
        if far or not np.isfinite(signals).all() or not signals.any():
            return None
        size = abs(k) * max(structure.sizes(np.abs(deltas).tolist()))
        signals = np.conj(signals) if pole.imag < 0 else signals
        return RayCrossing(size, tuple((k * deltas).tolist()), abs(pole.imag), signals)

    for sign in (1.0, -1.0):
        nearest = sorted((sign * real)[sign * real > 0], reverse=True)[:3]
        found = filter(None, (crossing(sign / float(value)) for value in nearest))
        yield from islice(found, 1)


# Local witness search where branching finds the lowest bound.


def local_witness(
    loop: LoopModel, numbers: Vector, frequency: float, fixed: tuple[bool, ...]
) -> Witness | None:
    """Return the smallest Delta that a search finds from real numbers and a frequency.

    Parameters
    ----------
    loop : LoopModel
        With real numbers.
    numbers : ndarray
        Of the real blocks.
    frequency : float
        Of the model.
    fixed : tuple of bool
        Blocks that have size 1 whatever the size of the others.

    Returns
    -------
    Witness or None
        None too where rounding sees a pole at the frequency.
    """
    structure = loop.structure
    real = [k for k, block in enumerate(structure.blocks) if block.kind == "real"]
    scale = np.ones(structure.shape[1])
    ends = frequency == 0 or math.isinf(frequency)
    angle = loop.angle(frequency)
    try:
        w = worst_signals(structure, loop.response(angle)[0], numbers)
    except np.linalg.LinAlgError:
        return None
    deltas: list[complex | None] = [None] * len(structure.blocks)
    for k, number in zip(real, numbers.tolist(), strict=True):
        deltas[k] = complex(number)
    starts: list[Any] = [(w, angle, not ends, tuple(deltas))]
    if len(real) == len(structure.blocks):
        for crossing in ray_crossings(loop, (numbers,)):
            angle, moves = loop.start(crossing.frequency)
            starts.append((crossing.w, angle, moves, crossing.deltas))
    found = [
        smallest_delta(structure, loop.response, w, at, moves, scale, given, fixed)
        for w, at, moves, given in starts
    ]
    return min((one for one in found if one), key=lambda one: one.size, default=None)


def worst_signals(structure: DeltaStructure, M: AnyMatrix, numbers: Vector) -> AnyMatrix:
    """Return signals w that are nearly a mode with given real numbers.

    They are those that what else there is amplifies most, or those that are left unchanged most
    nearly if there is nothing else.
    """
    gains = np.zeros(structure.shape[::-1])
    others_w, others_z = [], []
    values = iter(numbers)
    for block, w, z in zip(structure.blocks, structure.outputs, structure.inputs, strict=True):
        if block.kind == "real":
            gains[w, z] = float(next(values)) * np.eye(block.copies)
        else:
            others_w += range(w.start, w.stop)
            others_z += range(z.start, z.stop)
    if not others_w:
        return np.conj(np.linalg.svd(np.eye(len(gains)) - gains @ M)[2][-1])
    # z = M w with w = gains z + v, and v of the other blocks only
    z = np.linalg.solve(np.eye(len(M)) - M @ gains, M[:, others_w])
    v = np.conj(np.linalg.svd(z[others_z])[2][0])
    whole = gains @ (z @ v)
    whole[others_w] += v
    return whole


# Both bounds.

# Crossings, peaks and directions that a search starts from: the first ones are the best nearly
# always, the others are for real numbers, whose searches end in different places.
_CROSSINGS = 4
_PEAKS = 3
_DIRECTIONS = 4
# Relative gap at which no further search is worth it: what intervals need is above.
_NEAR = 1.5e-3
# What the level of scalings has above what is needed where branching follows, as little comes of
# short intervals then.
_ROUGH = 0.3
# Searches that begin where the last one ended.
_AGAIN = 5
# Angle beside rest and infinity from which a search along the axis begins.
_BESIDE = 1e-3
# How much larger a witness at rest or at infinity may be, relative, than one slower or faster than
# all poles, for what is left of the dynamics.
_BESIDE_END = 1e-6
# Size of real numbers, beside what was said to be possible, that is looked at without a witness.
_FAR = 1e3
# Part of the gap that branching aims at, which need not stop at the last moment.
_AIM = 0.5


@dataclass(frozen=True, eq=False)
class Bounds:
    """What was found of a loop.

    Attributes
    ----------
    coverage : Coverage
    witness : Witness or None
    """

    coverage: Coverage
    witness: Witness | None

    @property
    def gap(self) -> float:
        """Relative distance of the level above what the witness shows; infinite without either."""
        if self.witness is None or not self.coverage.complete:
            return math.inf
        return self.coverage.level * self.witness.size - 1


def bounds(loop: LoopModel, fixed: tuple[bool, ...] | None = None, gap: float = GAP) -> Bounds:
    """Bound the peak of the structured singular value of a stable loop from both sides.

    Parameters
    ----------
    loop : LoopModel
    fixed : tuple of bool, optional
        Blocks that have size 1 whatever the level is; none by default.
    gap : float, optional
        Relative distance of both bounds that is small enough: what is above is branched over, if
        the loop is small.

    Returns
    -------
    Bounds
    """
    held = fixed or (False,) * len(loop.structure.blocks)
    branches = can_branch(loop)
    found = _settled(loop, fixed, _by_scalings(loop, fixed, _ROUGH if branches else SLACK))
    if found.witness is None:
        if branches and found.coverage.complete:
            found = _with_short_intervals(loop, fixed, found)
        if not (fixed or found.coverage.complete):
            # Real numbers up to a size far beyond what was said to be possible may do nothing.
            far, size = _FAR * loop.gain, None
            if all(block.kind == "real" for block in loop.structure.blocks):
                size = proven_real_margin(loop, far)
                if size is None and branches:
                    size = branch_and_bound(loop, "pole", gap, 0.0, far, lambda *_: far)
            if size:
                return replace(found, coverage=_everywhere(found.coverage, 1 / size))
        return found
    exact = None if fixed else proven_real_margin(loop, found.witness.size)
    if exact is not None:
        return replace(found, coverage=_everywhere(found.coverage, 1 / exact))

    def raised(found: Bounds, prove: Callable[[float, float, Probe], float]) -> Bounds:
        """Raise the size that is proven, with looks for smaller witnesses on the way."""
        coverage, best = found.coverage, found.witness

        def probe(numbers: Vector, frequency: float) -> float:
            nonlocal best
            best = _better(best, local_witness(loop, numbers, frequency, held))
            return best.size if best else math.inf

        start = 1 / coverage.level if coverage.complete and coverage.level else 0.0
        size = prove(start, best.size if best else math.inf, probe)
        if size > start:
            coverage = _everywhere(coverage, 1 / size)
        return _settled(loop, fixed, Bounds(coverage, best))

    aim = _AIM * gap
    if found.gap > gap and branches:
        # Both bounds together, by branch and bound over the real numbers.
        real_alone = all(block.kind == "real" for block in loop.structure.blocks)
        goal: Goal = "pole" if real_alone else "gain" if fixed else "both"
        found = raised(found, partial(branch_and_bound, loop, goal, aim))
        if found.gap > gap:
            found = _with_short_intervals(loop, fixed, found)
    if found.gap > gap and can_split(loop):
        # Both bounds together, by scalings for each part of the box of real numbers.
        found = raised(found, partial(split, loop, fixed, aim))
    return found


def _settled(loop: LoopModel, fixed: tuple[bool, ...] | None, found: Bounds) -> Bounds:
    """Search on from a witness while it gets smaller, then bring it to an end of the axis if near.

    A search may stop early where many numbers are nearly as good.
    """
    witness = found.witness
    for _ in range(_AGAIN):
        check_deadline()
        if witness is None:
            return found
        frequency = loop.frequency(witness.at)
        moves = loop.start(frequency)[1] and math.isfinite(frequency)
        near = _from_witness(loop, fixed, witness, witness.at, moves)
        # Relative difference of sizes that are the same but for rounding.
        if near is None or near.size >= witness.size * (1 - SAME):
            break
        if not moves and _is_real(witness) and not _is_real(near):
            break
        witness = near
    return replace(found, witness=witness and _at_the_ends(loop, fixed, witness))


def _from_witness(
    loop: LoopModel, fixed: tuple[bool, ...] | None, witness: Witness, at: float, moves: bool
) -> Witness | None:
    """Return what a search finds that begins with a witness, at its angle or at an end beside."""
    structure = loop.structure
    try:
        delta, M = witness.matrix(structure), loop.response(at)[0]
    except np.linalg.LinAlgError:
        return None
    if at != witness.at or (not moves and _is_real(witness)):
        delta, M = np.real(delta), np.real(M)
    w = np.conj(np.linalg.svd(np.eye(len(delta)) - delta @ M)[2][-1]).astype(complex)
    return smallest_delta(structure, loop.response, w, at, moves, np.ones(len(w)), fixed=fixed)


def _at_the_ends(loop: LoopModel, fixed: tuple[bool, ...] | None, witness: Witness) -> Witness:
    """Bring a witness beyond all poles to rest or to infinity, if it is as small there.

    There its values are real. Its lags would turn phases that are nothing but rounding.
    """
    poles = np.abs(np.linalg.eigvals(loop.model.A)) if loop.model.states else np.zeros(0)
    poles = poles[poles > 0]
    frequency = loop.frequency(witness.at)
    if not poles.size or frequency in (0.0, math.inf):
        return witness
    if poles.min() <= frequency <= poles.max():
        return witness
    end = 0.0 if frequency < poles.min() else math.pi / 2
    there = _from_witness(loop, fixed, witness, end, False)
    if there is None or not _is_real(there) or there.size > witness.size * (1 + _BESIDE_END):
        return witness
    return there


def _everywhere(coverage: Coverage, level: float) -> Coverage:
    """Return what is proven if a level is proven over all of the axis."""
    return replace(coverage, level=level, intervals=EVERYWHERE, complete=True)


def _with_short_intervals(loop: LoopModel, fixed: tuple[bool, ...] | None, found: Bounds) -> Bounds:
    """Lower the level by scalings that hold over shorter intervals, if they prove more."""
    near = 0.0 if found.witness is None else 1 / found.witness.size
    fine = cover(loop, Space(loop.structure, fixed or ()), near, loop.seeds())
    better = fine.complete and (not found.coverage.complete or fine.level < found.coverage.level)
    return replace(found, coverage=fine) if better else found


def _by_scalings(loop: LoopModel, fixed: tuple[bool, ...] | None, slack: float) -> Bounds:
    """Bound the peak by scalings that hold over intervals, and by searches from where they end."""
    space = Space(loop.structure, fixed or ())
    found, seeds, scale = None, loop.seeds(), np.ones(loop.structure.shape[1])
    for crossing in () if fixed else ray_crossings(loop)[:_CROSSINGS]:
        start, given = loop.start(crossing.frequency), crossing.deltas
        args = (loop.structure, loop.response, crossing.w, *start, scale, given)
        found = _better(found, smallest_delta(*args))
    if found is not None:
        seeds = [loop.frequency(found.at), *seeds]
    start = 1 / found.size if found else 0.0
    coverage = cover(loop, space, start, seeds, slack)
    branches = can_branch(loop)
    for frequency, _, level in coverage.peaks[:_PEAKS]:
        if found and (branches or coverage.level * found.size <= 1 + _NEAR):
            break
        # Where branching follows, it finds the place, and any witness is enough.
        count = 1 if branches else _DIRECTIONS
        near = _from_peak(loop, space, frequency, level, coverage.level, count)
        found = _better(found, near)
    return Bounds(coverage, found)


def _from_peak(
    loop: LoopModel, space: Space, frequency: float, level: ScaledBound, reached: float, count: int
) -> Witness | None:
    """Return the smallest Delta near what the scalings of a peak say is the worst."""
    inequality = Inequality(space, response(loop.model, frequency)[None])
    scale = space.units(level.x)
    best: Witness | None = None
    angle, ends = loop.angle(frequency), frequency in (0.0, math.inf)
    # At rest and at infinity a stable real system has real values: look there, and nearby.
    near = min(max(angle, _BESIDE), math.pi / 2 - _BESIDE)
    for w in singular_directions(inequality, level.square, level.x, count):
        starts = [(w, near, True)]
        if ends:
            starts = [(np.real(w).astype(complex), angle, False), *starts]
        else:  # a search along the axis may leap off a narrow peak, and end on another
            starts = [*starts, (w, angle, False)]
        for signals, at, moves in starts:
            if best and reached * best.size <= 1 + _NEAR:
                break
            found = smallest_delta(
                loop.structure, loop.response, signals, at, moves, scale, fixed=space.fixed
            )
            if found and (moves or not ends or _is_real(found)):
                best = _better(best, found)
        if best and reached * best.size <= 1 + _NEAR:
            break
    return best


def _is_real(witness: Witness) -> bool:
    """Say whether all values are real but for rounding."""
    # Imaginary parts of values at rest that are nothing but rounding, relative.
    return all(np.abs(np.imag(d)).max() <= ROUNDING * witness.size for d in witness.deltas)


def _better(one: Witness | None, other: Witness | None) -> Witness | None:
    """Return the smaller one; the first of equals, which is the one at rest or at infinity."""
    if one is None or other is None:
        return one or other
    return one if one.size <= other.size * (1 + SAME) else other
