r"""Scalings D and G that commute with Delta, and the inequality that they make a proof of.

Of w = Delta z with blocks of norm at most 1/beta, ::

    z* Dz z - beta^2 w* Dw w >= 0    and    j (w* G z - z* G w) = 0

for all D > 0 that commute with Delta and Hermitian G on its real blocks. With z = M w,
the matrix ::

    beta^2 Dw - M* Dz M - j (G M - M* G)

being positive definite shows that I - M Delta is not singular. It is affine in D and G: finding
them is convex, and their analytic centre is found by Newton's method.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import flint
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from robustpolish.base.arrays import AnyArray, AnyMatrix, Matrix, Vector
from robustpolish.base.budget import check_deadline
from robustpolish.linear.arithmetic import balls
from robustpolish.linear.systems import Realisation
from robustpolish.robust.loop_model import DeltaStructure, LoopModel

Box = tuple[NDArray[np.intp], AnyArray, AnyArray]
"""Numbers of the vector, the Hermitian matrices that they multiply, and a constant one."""

# A signal that does not act back would be scaled for ever: it is taken to, so much.
_ONE_WAY = 1e-6
_ROUNDS = 50


@dataclass(frozen=True, eq=False)
class Space:
    """The scalings of a structure as a real vector space.

    Attributes
    ----------
    structure : DeltaStructure
    fixed : tuple of bool, optional
        Blocks whose size is 1 whatever beta is; none by default.
    """

    structure: DeltaStructure
    fixed: tuple[bool, ...] = ()

    def __post_init__(self) -> None:
        if not self.fixed:
            object.__setattr__(self, "fixed", (False,) * len(self.structure.blocks))

    @cached_property
    def bases(self) -> tuple[AnyArray, AnyArray, AnyArray, AnyArray]:
        """Of every unit vector Dz, Dw of the fixed blocks, Dw of the others, and G."""
        nz, nw = self.structure.shape
        shapes = (nz, nz), (nw, nw), (nw, nw), (nw, nz)
        Dz, still, scaled, G = (np.zeros((self.size, *shape), complex) for shape in shapes)
        for kind, k, numbers, units in self.pieces:
            block = self.structure.blocks[k]
            z, w = self.structure.inputs[k], self.structure.outputs[k]
            if kind == "D":
                Dz[numbers, z, z] = np.kron(units, np.eye(block.columns))
                Dw = still if self.fixed[k] else scaled
                Dw[numbers, w, w] = np.kron(units, np.eye(block.rows))
            else:
                G[numbers, w, z] = units
        return Dz, still, scaled, G

    @cached_property
    def pieces(self) -> tuple[tuple[str, int, slice, AnyArray], ...]:
        """D of every block, then G of every real one: its place in the vector, and the basis."""
        blocks = list(enumerate(self.structure.blocks))
        kinds = [*(("D", k) for k, _ in blocks),
                 *(("G", k) for k, block in blocks if block.kind == "real")]  # fmt: skip
        start, found = 0, []
        for kind, k in kinds:
            units = _hermitian(self.structure.blocks[k].copies)
            found.append((kind, k, slice(start, start + len(units)), units))
            start += len(units)
        return tuple(found)

    def blocks_of(self, x: Vector) -> dict[tuple[str, int], AnyMatrix]:
        """Return D and G of the blocks, of one copy each, by kind and block."""
        return {(kind, k): np.tensordot(x[own], units, 1) for kind, k, own, units in self.pieces}

    @property
    def size(self) -> int:
        """Number of real numbers in D and G."""
        return self.pieces[-1][2].stop

    def start(self, copies: Vector) -> Vector:
        """Return the vector of diagonal D, one number per copy, and G = 0."""
        x, first = np.zeros(self.size), 0
        for kind, _, numbers, units in self.pieces:
            if kind == "D":
                count = units.shape[1]
                x[numbers][:count] = copies[first : first + count]
                first += count
        return x

    def boxes(self, largest: float) -> tuple[Box, ...]:
        """Return what bounds the scalings: 0 < D < 1, and G between -/+ largest D."""
        found: list[Box] = []
        for kind, k, numbers, units in self.pieces:
            own, none = np.arange(numbers.start, numbers.stop), np.zeros(units.shape[1:])
            if kind == "D":
                found += [(own, units, none), (own, -units, np.eye(len(none)))]
                continue
            D = self.pieces[k][2]
            both = np.concatenate([np.arange(D.start, D.stop), own])
            for sign in (1.0, -1.0):
                found.append((both, np.concatenate([largest * units, sign * units]), none))
        return tuple(found)

    def matrices(self, x: Vector) -> tuple[AnyMatrix, AnyMatrix, AnyMatrix, AnyMatrix]:
        """Return Dz, the still and the scaled part of Dw, and G."""
        Dz, still, scaled, G = (np.tensordot(x, basis, 1) for basis in self.bases)
        return Dz, still, scaled, G

    def units(self, x: Vector) -> Vector:
        """Return sizes of the signals w that scalings make comparable, the largest 1."""
        _, still, scaled, _ = self.matrices(x)
        sizes = 1 / np.sqrt(np.maximum(np.real(np.diagonal(still + scaled)), 1e-300))
        return sizes / sizes.max()


def _hermitian(n: int) -> AnyArray:
    """Return a basis of the Hermitian matrices, those of the diagonal first."""
    found = [np.diag(row).astype(complex) for row in np.eye(n)]
    for i in range(n):
        for j in range(i):
            one, other = np.zeros((n, n), complex), np.zeros((n, n), complex)
            one[i, j] = one[j, i] = np.sqrt(0.5)
            other[i, j], other[j, i] = 1j * np.sqrt(0.5), -1j * np.sqrt(0.5)
            found += [one, other]
    return np.array(found)


def balanced(sizes: Matrix) -> Vector:
    """Return scales d that make rows and columns of ``d_i sizes_ij / d_j`` alike (Osborne 1960)."""
    logs = np.zeros(len(sizes))
    off = sizes - np.diag(np.diag(sizes))
    off = off + _ONE_WAY * off.max(initial=0.0) * (1 - np.eye(len(sizes)))
    if len(sizes) == 1 or not off.max(initial=0.0) > 0:
        return np.ones(len(sizes))
    for _ in range(_ROUNDS):
        before = logs.copy()
        for i in range(len(logs)):
            row = np.linalg.norm(off[i] * np.exp(logs[i] - logs))
            column = np.linalg.norm(off[:, i] * np.exp(logs - logs[i]))
            logs[i] += 0.5 * np.log(column / row)
        if np.abs(logs - before).max() < 0.1:
            break
    return np.exp(logs - logs.max())


@dataclass(frozen=True, eq=False)
class Inequality:
    """The inequality at one or more matrices M, affine in the scalings.

    Attributes
    ----------
    space : Space
    M : ndarray of complex, shape (k, nz, nw)
    """

    space: Space
    M: AnyArray

    @cached_property
    def _balance(self) -> tuple[Vector, float]:
        """Scales of the copies that even out M, and its norm with them."""
        blocks = self.space.structure.blocks
        rows = np.cumsum([0, *(b.columns for b in blocks for _ in range(b.copies))])[:-1]
        columns = np.cumsum([0, *(b.rows for b in blocks for _ in range(b.copies))])[:-1]
        squares = (np.abs(self.M) ** 2).max(axis=0)
        squares = np.add.reduceat(np.add.reduceat(squares, rows, axis=0), columns, axis=1)
        sizes = np.sqrt(squares)
        scales = balanced(sizes)
        return scales, float(np.linalg.norm(scales[:, None] * sizes / scales))

    @property
    def size(self) -> float:
        """Norm of M in balanced units."""
        return self._balance[1]

    def start(self) -> Vector:
        """Return scalings that balance M."""
        return self.space.start(0.5 * self._balance[0] ** 2)

    @cached_property
    def _gains(self) -> AnyArray:
        """M* Dz M + j (G M - M* G) of every unit vector, shape (k, size, nw, nw)."""
        Dz, _, _, G = self.space.bases
        M = self.M[:, None]
        star = np.conj(np.swapaxes(M, -1, -2))
        turned = 1j * (G[None] @ M)
        return star @ Dz[None] @ M + turned + np.conj(np.swapaxes(turned, -1, -2))

    def coefficients(self, square: float) -> AnyArray:
        """Return the matrices that the scalings multiply, for a beta^2."""
        _, still, scaled, _ = self.space.bases
        return (still + square * scaled)[None] - self._gains

    def least_square(self, x: Vector) -> float:
        """Return the least beta^2 for which scalings fulfil it, infinite if there is none."""
        _, still, scaled, _ = self.space.bases
        still, scaled = np.tensordot(x, still, 1), np.tensordot(x, scaled, 1)
        worst = 0.0
        for gains in np.tensordot(self._gains, x, (1, 0)):
            worst = max(worst, _least(gains - still, scaled))
        return worst


def _least(gains: AnyMatrix, scaled: AnyMatrix) -> float:
    """Return the least t with t scaled - gains >= 0, where `scaled` may be singular."""
    used = np.abs(np.diagonal(scaled)) > 0
    if not used.all():
        inner = -gains[~used][:, ~used]
        try:
            factor = np.linalg.cholesky(inner)
        except np.linalg.LinAlgError:
            return np.inf
        cross = np.linalg.solve(factor, -gains[~used][:, used])
        gains = gains[used][:, used] + np.conj(cross.T) @ cross
        scaled = scaled[used][:, used]
    if not used.any():
        return 0.0
    factor = np.linalg.cholesky(scaled)
    half = np.linalg.solve(factor, gains)
    whole = np.linalg.solve(factor, np.conj(half.T))
    if not np.isfinite(whole).all():
        return np.inf
    return float(np.linalg.eigvalsh((whole + np.conj(whole.T)) / 2)[-1])


# The barrier whose least value is the analytic centre, with its derivatives.


class Barrier:
    """Minus the logarithms of all determinants that have to stay positive.

    Their matrices are affine in the scalings; those of one size are taken at once, for most are
    tiny.

    Parameters
    ----------
    size : int
        Number of scalings.
    boxes : tuple of Box
        What bounds them.
    coefficients : ndarray, shape (k, size, n, n), optional
        What the scalings multiply in further matrices, which have no constant part.
    """

    def __init__(
        self, size: int, boxes: tuple[Box, ...], coefficients: AnyArray | None = None
    ) -> None:
        groups: list[tuple[AnyArray, AnyArray]] = []
        if coefficients is not None:
            groups.append((coefficients, np.zeros_like(coefficients[:, 0], dtype=float)))
        for n in sorted({constant.shape[0] for _, _, constant in boxes}):
            same = [box for box in boxes if box[2].shape[0] == n]
            table: AnyArray = np.zeros((len(same), size, n, n), complex)
            for own, (numbers, units, _) in zip(table, same, strict=True):
                own[numbers] = units
            table = table if np.imag(table).any() else np.real(table)
            groups.append((table, np.array([constant for _, _, constant in same])))
        # Of each group what every scaling adds to the entries, the same beside each other as
        # right-hand sides, and the constant part.
        self.parts: list[tuple[AnyArray, AnyArray, AnyArray]] = []
        for table, constant in groups:
            k, n, _ = constant.shape
            rows, columns = (np.ascontiguousarray(table.transpose(0, 2, *last))
                             for last in ((3, 1), (1, 3)))  # fmt: skip
            self.parts.append((rows.reshape(-1, size), columns.reshape(k, n, size * n), constant))

    def value(self, x: Vector) -> float:
        """Return the value; infinite where a determinant is not positive."""
        total = 0.0
        for rows, _, constant in self.parts:
            try:
                factors = np.linalg.cholesky((rows @ x).reshape(constant.shape) + constant)
            except np.linalg.LinAlgError:
                return np.inf
            total -= 2 * float(np.log(np.real(np.diagonal(factors, axis1=1, axis2=2))).sum())
        return total if np.isfinite(total) else np.inf

    def derivatives(self, x: Vector) -> tuple[Vector, Matrix]:
        """Return the slope and the curvature."""
        slope, curvature = np.zeros(len(x)), np.zeros((len(x), len(x)))
        for rows, columns, constant in self.parts:
            k, n, _ = constant.shape
            matrices = (rows @ x).reshape(constant.shape) + constant
            weighted = np.linalg.solve(matrices, columns).reshape(k, n, len(x), n)
            slope -= np.real(np.einsum("kisi->s", weighted))
            left = weighted.transpose(2, 0, 1, 3).reshape(len(x), -1)
            right = weighted.transpose(0, 3, 1, 2).reshape(-1, len(x))
            curvature += np.real(left @ right)
        return slope, curvature


# The analytic centre of the scalings that prove a level, and the least level that any prove.


# Newton steps of one centre; about ten are usual.
_STEPS = 40
# Newton decrement at which a centre is good enough: within 1 a full step is safe.
_CENTRED = 0.3
# Centres on the way to the least level.
_LEVELS = 60
# Where the next level lies between what the scalings prove and the level that they are the centre
# of: small steps would be safe and slow.
_BETWEEN = 0.1
# Where the first of these levels lies above what the first scalings prove.
_ABOVE = 2.0
# Relative distance of a level from what its centre proves at which the least one is near: it is
# closer than that times the number of rows, far below the 1e-3 of intervals.
_SETTLED = 1e-7
# Bound on G beside D and the gain: the inequality of a single real number has no other.
_LARGEST = 1e3


@dataclass(frozen=True, eq=False)
class ScaledBound:
    """Scalings and what they prove.

    Attributes
    ----------
    square : float
        The least beta^2 that they prove; infinite for none.
    x : ndarray
        The scalings.
    """

    square: float
    x: Vector

    @property
    def level(self) -> float:
        """Beta itself."""
        return math.sqrt(max(self.square, 0.0))


def reduce_level(inequality: Inequality, start: ScaledBound, target: float = 0.0) -> ScaledBound:
    """Lower the level until it is below a target, or no lower one is found.

    Parameters
    ----------
    inequality : Inequality
    start : ScaledBound
        Scalings with a finite level.
    target : float, optional
        A beta^2 that is low enough.

    Returns
    -------
    ScaledBound
        If its square is below the target, the scalings are the centre of those that prove it.
    """
    best, square = start, _ABOVE * start.square
    walls = Barrier(inequality.space.size, _bounds(inequality))
    for _ in range(_LEVELS):
        check_deadline()
        if best.square < target * (1 - 1e-9):
            x = centre(inequality, target, best.x)
            return ScaledBound(inequality.least_square(x), x)
        if best.square <= 0 or not np.isfinite(best.square):
            return best
        if square - best.square < _SETTLED * best.square:
            return best
        x = centre(inequality, square, best.x)
        found = _extrapolate(inequality, ScaledBound(inequality.least_square(x), x), best.x, walls)
        best = min(best, found, key=lambda level: level.square)
        square = best.square + _BETWEEN * (square - best.square)
    return best


def _extrapolate(
    inequality: Inequality, found: ScaledBound, before: Vector, walls: Barrier
) -> ScaledBound:
    """Go on in the direction of the last step as long as the level falls, within what bounds it.

    From outside, no centre would be found any more.
    """
    direction, reach = found.x - before, 1.0
    for _ in range(8):
        x = normalised(inequality.space, found.x + reach * direction)
        if x is None or not np.isfinite(walls.value(x)):
            break
        level = inequality.least_square(x)
        if not level < found.square:
            break
        found, reach = ScaledBound(level, x), 2 * reach
    return found


def normalised(space: Space, x: Vector) -> Vector | None:
    """Return the scalings with a largest D of 1/2; None if one is not positive."""
    largest = 0.0
    for (kind, _), D in space.blocks_of(x).items():
        if kind == "D":
            values = np.linalg.eigvalsh(D)
            if not values[0] > 0:
                return None
            largest = max(largest, float(values[-1]))
    return 0.5 * x / largest


def centre(inequality: Inequality, square: float, x: Vector) -> Vector:
    """Return the analytic centre of the scalings that prove a level, from one that does."""
    coefficients = inequality.coefficients(square)
    barrier = Barrier(len(x), _bounds(inequality), coefficients)
    value = barrier.value(x)
    if not np.isfinite(value):
        return x
    for _ in range(_STEPS):
        slope, curvature = barrier.derivatives(x)
        # Scalings differ by many orders of magnitude: each number in its own unit.
        units = np.sqrt(np.maximum(np.diagonal(curvature), 1e-300))
        try:
            factor = cho_factor(curvature / np.outer(units, units) + 1e-13 * np.eye(len(x)))
        except (np.linalg.LinAlgError, ValueError):  # not definite, or not even finite
            return x
        step = -cho_solve(factor, slope / units) / units
        decrement = np.sqrt(max(-(slope @ step), 0.0))
        length, moved, trial, after = 1.0, False, x, value
        while length > 1e-6 and not moved:
            trial = x + length * step
            after = barrier.value(trial)
            moved = after < value - 0.1 * length * decrement**2 or (
                decrement < 0.1 and after <= value
            )
            length /= 2
        if not moved:
            return x
        x, value = trial, after
        if decrement < _CENTRED:
            return x
    return x


def _bounds(inequality: Inequality) -> tuple[Box, ...]:
    return inequality.space.boxes(_LARGEST * (inequality.size or 1.0))


def initial_scalings(inequality: Inequality) -> ScaledBound:
    """Return scalings of a finite level to begin with; of an infinite one if none were found.

    Those that balance M have one, unless the size of some blocks is fixed: then these alone are
    looked at first, and all others are given so small a D that they do not matter.
    """
    space = inequality.space
    held = [k for k, fixed in enumerate(space.fixed) if fixed]
    x = inequality.start()
    if not held:
        return ScaledBound(inequality.least_square(x), x)
    structure = space.structure.only(held)
    rows = np.concatenate([np.r_[space.structure.inputs[k]] for k in held])
    columns = np.concatenate([np.r_[space.structure.outputs[k]] for k in held])
    alone = Inequality(Space(structure), inequality.M[:, rows][:, :, columns])
    inner = best_scalings(alone, 1.0)
    if not inner.square < 1:
        return ScaledBound(np.inf, x)
    x = np.zeros(space.size)
    first = 0
    free = []
    for kind, k, numbers, units in space.pieces:
        if k in held:
            x[numbers] = inner.x[first : first + len(units)]
            first += len(units)
        elif kind == "D":
            x[numbers][: units.shape[1]] = 1.0
            free.append(numbers)
    for _ in range(60):
        level, inside = inequality.least_square(x), normalised(space, x)
        if np.isfinite(level) and inside is not None:
            return ScaledBound(level, inside)
        for numbers in free:
            x[numbers] *= 0.1
    return ScaledBound(np.inf, x)


def best_scalings(
    inequality: Inequality, target: float = 0.0, others: Iterable[Vector] = ()
) -> ScaledBound:
    """Return the scalings of the least level, or those of a level that is low enough.

    Parameters
    ----------
    inequality : Inequality
    target : float, optional
        A beta^2 that is low enough.
    others : iterable of ndarray, optional
        Scalings to begin with, if they prove more than those that balance M.

    Returns
    -------
    ScaledBound
        Of an infinite level if none were found.
    """
    known = (ScaledBound(inequality.least_square(x), x) for x in others)
    start = min([initial_scalings(inequality), *known], key=lambda level: level.square)
    return reduce_level(inequality, start, target) if math.isfinite(start.square) else start


# An upper bound of the structured singular value that holds between all frequencies.


# What constant scalings prove, in ball arithmetic: at a matrix, and over a range of frequencies.
#
# With constant D and G the inequality holds at one frequency and fails nowhere around it before it
# gets singular, and it is singular at a frequency just if the Hamiltonian matrix has an eigenvalue
# there on the imaginary axis [1]_. Discs that hold all eigenvalues tell how far that is.
#
# References
# ----------
# .. [1] G. Ferreres, J.-F. Magni, J.-M. Biannic, "Robustness analysis of flexible structures:
#    practical algorithms", International Journal of Robust and Nonlinear Control 13 (2003) 715-733.

_BITS = 160


@dataclass(frozen=True, eq=False)
class BallScalings:
    """Scalings as balls: Dz, G, and beta^2 Dw with the blocks of fixed size as they are."""

    Dz: balls.Ball
    G: balls.Ball
    E: balls.Ball

    @classmethod
    def of(cls, space: Space, x: Vector, level: float) -> BallScalings | None:
        """Return the scalings at a level beta, None if a D is not proven to be positive."""
        # Exactly Hermitian, so that they commute with Delta without rounding.
        Dz, still, scaled, G = (
            M if M.shape[0] != M.shape[1] else (M + np.conj(M.T)) / 2 for M in space.matrices(x)
        )
        with balls.precision(_BITS):
            square = flint.acb(flint.arb(level) ** 2)
            E = balls.complex_ball(still) + balls.complex_ball(scaled) * square
            if not (
                balls.is_definite(balls.complex_ball(Dz))
                and balls.is_definite(balls.complex_ball(still + scaled))
            ):
                return None
        return cls(balls.complex_ball(Dz), balls.complex_ball(G), E)


def proves_inequality(M: balls.Ball, weights: BallScalings) -> bool:
    """Prove the inequality at a matrix."""
    turned = weights.G * M * flint.acb(0, 1)
    return balls.is_definite(
        weights.E - balls.adjoint(M) * weights.Dz * M - turned - balls.adjoint(turned)
    )


def proven_interval(
    model: balls.BallSystem, weights: BallScalings, omega: float
) -> tuple[float, float] | None:
    """Prove the inequality around a frequency, as far as it holds.

    Parameters
    ----------
    model : BallSystem
        Stable and continuous.
    weights : BallScalings
    omega : float
        In rad/s; infinity is allowed.

    Returns
    -------
    (low, high) or None
        It holds between, both included; None if it is not proven at `omega`.
    """
    with balls.precision(_BITS):
        try:
            if not proves_inequality(model.response(omega), weights):
                return None
            if not model.A.nrows():
                return 0.0, math.inf
            A, B, C, D = map(flint.acb_mat, model)
            seen = balls.adjoint(C) * weights.Dz
            turned = weights.G * D * flint.acb(0, 1)
            R = balls.adjoint(D) * weights.Dz * D + turned + balls.adjoint(turned) - weights.E
            S = balls.adjoint(C) * (weights.Dz * D - balls.adjoint(weights.G) * flint.acb(0, 1))
            H = balls.hamiltonian(*balls.riccati_terms(A, B, seen * C, S, R))
            return balls.interval_without_eigenvalues(H, omega)
        except (ZeroDivisionError, ValueError, np.linalg.LinAlgError):
            return None


SLACK = 1e-3
"""What the level is above the largest one that was needed anywhere, relative.

That is the room that constant scalings have around the worst frequency. With half of the 0.2 % that
a bracket may be wide, the other half is left for the lower bound.
"""
_MOST = 600
"""Intervals before the bound is given up."""
# Width, relative to its frequency, of an interval that gets nowhere: the level is raised by this
# much, relative.
_NARROW, _RAISED = 1e-7, 1e-3


@dataclass(frozen=True, eq=False)
class Coverage:
    """A level that is proven over intervals of frequency.

    Attributes
    ----------
    level : float
        beta: no Delta with all sizes below 1 / beta makes the loop singular on the intervals.
    intervals : tuple of (float, float)
        In the units of the model, ascending.
    complete : bool
        Whether they cover the axis from 0 to infinity.
    peaks : tuple of (float, float, Level)
        Frequencies at which a level was needed, the level, and its scalings; the largest first.
    """

    level: float
    intervals: tuple[tuple[float, float], ...]
    complete: bool
    peaks: tuple[tuple[float, float, ScaledBound], ...]


def response(model: Realisation, omega: float) -> AnyMatrix:
    """Return M at a frequency, infinity included, in double precision.

    Raises
    ------
    numpy.linalg.LinAlgError
        If rounding sees a pole there.
    """
    D = model.D.astype(complex)
    if not model.states or not math.isfinite(omega):
        return D
    return D + model.C @ np.linalg.solve(1j * omega * np.eye(model.states) - model.A, model.B + 0j)


def cover(
    loop: LoopModel,
    space: Space,
    level: float,
    seeds: Sequence[float],
    slack: float = SLACK,
    most: int = _MOST,
) -> Coverage:
    """Lay intervals with constant scalings until they cover the axis.

    Parameters
    ----------
    loop : LoopModel
        Stable.
    space : Space
        What scalings there are.
    level : float
        A lower bound of the peak, or where else to begin; it is raised where it has to be.
    seeds : sequence of float
        Frequencies to look at first.
    slack : float, optional
        What the level has above what is needed: more of it makes longer intervals.
    most : int, optional
        Intervals before the bound is given up.

    Returns
    -------
    Coverage
    """
    level, exact = level * (1 + slack), balls.BallSystem(*loop.balls)
    peaks: list[tuple[float, float, ScaledBound]] = []
    last: list[Vector] = []

    def scalings(omega: float) -> ScaledBound | None:
        """Return scalings that prove the level at a frequency, or raise the level.

        None where there are none, or where rounding sees a pole at the frequency.
        """
        nonlocal level, last
        try:
            inequality = Inequality(space, response(loop.model, omega)[None])
        except np.linalg.LinAlgError:
            return None
        found = best_scalings(inequality, level**2, last)
        if not math.isfinite(found.square):
            return None
        if not found.level < level:
            peaks.append((omega, found.level, found))
            level = found.level * (1 + slack)
            found = reduce_level(inequality, found, level**2)
        last = [found.x, *last][:2]
        return found

    for omega in dict.fromkeys([0.0, math.inf, *seeds]):
        if scalings(omega) is None:
            return Coverage(math.inf, (), False, tuple(peaks))
    gaps, intervals = [(0.0, math.inf)], []
    for _ in range(most):
        if not gaps:
            break
        check_deadline()
        low, high = gaps.pop()
        omega = _inside(low, high, loop.rate)
        found = scalings(omega)
        if found is None or not math.isfinite(level):
            return Coverage(math.inf, (), False, tuple(peaks))
        weights = BallScalings.of(space, found.x, level)
        interval = weights and proven_interval(exact, weights, omega)
        if interval is None or interval[1] <= interval[0] * (1 + _NARROW):
            level *= 1 + _RAISED
            gaps.append((low, high))
            continue
        intervals.append(interval)
        if interval[0] > low:
            gaps.append((low, interval[0]))
        if interval[1] < high:
            gaps.append((interval[1], high))
    peaks.sort(key=lambda peak: -peak[1])
    return Coverage(level, tuple(sorted(intervals)), not gaps, tuple(peaks))


def _inside(low: float, high: float, rate: float) -> float:
    """Return a frequency of a gap: an end of the axis first, else the middle of logarithms."""
    if low == 0 and high == math.inf:
        return rate
    if high == math.inf:
        return math.inf
    if low == 0:
        return 0.0
    return math.sqrt(low) * math.sqrt(high)
