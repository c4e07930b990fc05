"""How far all real numbers of a loop can change together in given proportions: exactly, by size.

Along a ray all numbers are one repeated real number k. The matrix A(k) has a pair of eigenvalues
whose sum is 0 just if its Lyapunov operator is singular, which is an eigenvalue problem for 1 / k.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import scipy.linalg as sla

from robustpolish.arrays import AnyVector, Matrix, Vector
from robustpolish.robust.loop_model import LoopModel
from robustpolish.robust.numbers.sums_of_poles import both_sides
from robustpolish.robust.structure import Structure, positions

# Up to so many states the Lyapunov operator is inverted as a matrix: 900 x 900 takes 30 ms.
_STATES = 30
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
class Crossing:
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


def crossings(loop: LoopModel, rays: Sequence[Vector] | None = None) -> list[Crossing]:
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
    if not real or not 0 < model.states <= _STATES or rows * model.states > _LARGEST:
        return []
    A = model.A
    n = len(A)
    lyapunov = np.kron(A, np.eye(n)) + np.kron(np.eye(n), A)
    try:
        inverse: Any = np.linalg.inv(lyapunov)
    except np.linalg.LinAlgError:
        return []  # poles so near the axis, or of such sizes, that rounding sees them on it
    found: list[Crossing] = []
    for corner in _corners(structure, real) if rays is None else rays:
        deltas = np.zeros(len(structure.blocks))
        deltas[real] = corner
        found += _along(loop, inverse, deltas)
    return sorted(found, key=lambda crossing: crossing.size)


def _corners(structure: Structure, real: list[int]) -> Iterator[Vector]:
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


def _along(loop: LoopModel, inverse: Matrix, deltas: Vector) -> Iterator[Crossing]:
    """Yield the nearest crossing of a ray to either side."""
    model, structure = loop.model, loop.structure
    A, n = model.A, model.states
    kept = _kept(structure, deltas)
    spread = np.concatenate(
        [np.full(b.copies * b.rows, d) for b, d in zip(structure.blocks, deltas, strict=True)]
    )
    w = np.flatnonzero(spread)
    B, C = model.B[:, w] * spread[w], model.C[kept]
    D = model.D[kept][:, w] * spread[w]
    # Y of shape (r, n) to C X + D Y, with A X + X A' = -(B Y + Y' B').
    left, right = both_sides(B)
    X = -(inverse @ (left + right))
    operator = np.kron(C, np.eye(n)) @ X + np.kron(D, np.eye(n))
    values = np.linalg.eigvals(operator)
    # Sizes beyond this many times the nearest are rounding, or of no interest.
    large = np.abs(values) > _FARTHEST * np.abs(values).max(initial=0.0)
    real = values[large & (np.abs(values.imag) <= _REAL * np.abs(values))].real
    for sign in (1.0, -1.0):
        for value in sorted((sign * real)[sign * real > 0], reverse=True)[:3]:
            k = sign / float(value)
            crossing = _crossing(loop, k, deltas, (A, B, C, D), w, spread)
            if crossing is not None:
                yield crossing
                break


def _crossing(
    loop: LoopModel,
    k: float,
    deltas: Vector,
    matrices: tuple[Matrix, Matrix, Matrix, Matrix],
    places: AnyVector,
    spread: Vector,
) -> Crossing | None:
    """Return the mode on the axis at a number k of a ray, if there is one."""
    mode = _mode(k, matrices, loop.rate)
    for _ in range(_NEWTON):
        if mode is None or not abs(mode.by_k) > 0 or abs(mode.value.real) < _SETTLED * loop.rate:
            break
        step = -mode.value.real / mode.by_k
        nearer = _mode(k + step, matrices, loop.rate) if abs(step) < _CLOSE * abs(k) else None
        if nearer is None or abs(nearer.value.real) >= abs(mode.value.real):
            break
        k, mode = k + step, nearer
    if mode is None:
        return None
    value = mode.value
    if abs(value.real) > _ON_AXIS * max(abs(value), loop.rate * 1e-3):
        return None
    w = np.zeros(len(spread), complex)
    w[places] = k * spread[places] * mode.z
    if not np.isfinite(w).all() or not w.any():
        return None
    if value.imag < 0:
        w = np.conj(w)
    frequency = abs(value.imag)
    size = abs(k) * max(loop.structure.sizes(np.abs(deltas).tolist()))
    return Crossing(size, tuple((k * deltas).tolist()), frequency, w)


@dataclass(frozen=True, eq=False)
class _Mode:
    """The pole that is nearest to the axis, what its real part changes by k, and its signals z."""

    value: complex
    by_k: float
    z: AnyVector


def _mode(k: float, matrices: tuple[Matrix, Matrix, Matrix, Matrix], rate: float) -> _Mode | None:
    A, B, C, D = matrices
    back = np.eye(len(D)) - k * D
    if np.linalg.cond(back) > 1e12:
        return None
    into = np.linalg.solve(back, C)
    modes: Any = sla.eig(A + k * B @ into, left=True)
    values, left, right = modes
    near = int(np.argmin(np.abs(np.real(values)) / (np.abs(values) + rate * 1e-6)))
    x, y = right[:, near], left[:, near]
    # The derivative of k (1 - k D)^-1 is (1 - k D)^-2.
    change, own = np.vdot(y, B @ np.linalg.solve(back, into @ x)), np.vdot(y, x)
    by_k = float(np.real(change / own)) if own else 0.0
    return _Mode(complex(values[near]), by_k if np.isfinite(by_k) else 0.0, into @ x)


def _kept(structure: Structure, deltas: Vector) -> list[int]:
    """Return the signals z of the blocks that move."""
    return positions(structure.inputs, np.flatnonzero(deltas))
