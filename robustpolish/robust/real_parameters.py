"""Stability margins of real parameters: along rays, and exactly for one repeated parameter."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, product
from typing import Any

import flint
import numpy as np
import scipy.linalg as sla

from robustpolish.base.arrays import AnyVector, Matrix, Vector
from robustpolish.linear.arithmetic.balls import Ball, complex_ball, identity, part, precision
from robustpolish.linear.proofs.bounded_real import gershgorin_discs
from robustpolish.robust.loop_model import DeltaStructure, LoopModel, signal_positions

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
    with precision(_BITS):
        try:
            operator, D = _operator(loop)
            clear = all(_has_no_real_eigenvalue_beyond(M, 1 / least) for M in (operator, D))
        except (ZeroDivisionError, ValueError, np.linalg.LinAlgError):
            return None
    return least if clear else None


def _operator(loop: LoopModel) -> tuple[Ball, Ball]:
    """Return the matrix from Y to C X + D Y with A X + X A' = -(B Y + Y' B'), and D."""
    A, B, C, D = loop.balls
    n = A.nrows()
    one = identity(n)
    forward = _product(B, one)
    swapped = [j * n + i for i in range(n) for j in range(n)]
    turned = part(forward, swapped, range(forward.ncols()))
    X = (_product(A, one) + _product(one, A)).solve(forward + turned)
    return flint.acb_mat(_product(D, one) - _product(C, one) * X), flint.acb_mat(D)


def _product(left: Ball, right: Ball) -> Ball:
    """Return the Kronecker product."""
    shape = left.nrows() * right.nrows(), left.ncols() * right.ncols()
    rows = [[a * b for a in one for b in two] for one in left.tolist() for two in right.tolist()]
    return flint.arb_mat(*shape, [entry for row in rows for entry in row])


def _has_no_real_eigenvalue_beyond(matrix: Ball, limit: float) -> bool:
    """Prove that no real eigenvalue has a size of a limit or more."""
    if not any(entry != 0 for entry in matrix.entries()):
        return True
    vectors = matrix.eig(right=True, algorithm="approx")[1]
    try:
        centres, radii = gershgorin_discs(matrix, vectors)
    except ZeroDivisionError:  # eigenvectors that are the same: any size below the norm will do
        centres, radii = gershgorin_discs(matrix, complex_ball(np.eye(matrix.nrows())))
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
_SETTLED = 1e-14
_CLOSE = 1e-2
# Corners of the box of real numbers that are looked at: all of up to six numbers.
_CORNERS = 32
_FARTHEST = 1e-9


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
    large = np.abs(values) > _FARTHEST * np.abs(values).max(initial=0.0)
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
            if found is None or not abs(found[1]) > 0 or abs(found[0].real) < _SETTLED * loop.rate:
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
