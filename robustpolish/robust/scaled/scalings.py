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

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from robustpolish.arrays import AnyArray, AnyMatrix, Matrix, Vector
from robustpolish.robust.structure import Structure

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
    structure : Structure
    fixed : tuple of bool
        Blocks whose size is 1 whatever beta is.
    """

    structure: Structure
    fixed: tuple[bool, ...]

    @cached_property
    def bases(self) -> tuple[AnyArray, AnyArray, AnyArray, AnyArray]:
        """Of every unit vector Dz, Dw of the fixed blocks, Dw of the others, and G."""
        nz, nw = self.structure.shape
        parts: list[tuple[AnyMatrix, AnyMatrix, AnyMatrix, AnyMatrix]] = []
        for kind, k in self.layout:
            block = self.structure.blocks[k]
            z, w = self.structure.inputs[k], self.structure.outputs[k]
            for unit in _hermitian(block.copies):
                Dz, G = np.zeros((nz, nz), complex), np.zeros((nw, nz), complex)
                still, scaled = np.zeros((nw, nw), complex), np.zeros((nw, nw), complex)
                if kind == "D":
                    Dz[z, z] = np.kron(unit, np.eye(block.columns))
                    (still if self.fixed[k] else scaled)[w, w] = np.kron(unit, np.eye(block.rows))
                else:
                    G[w, z] = unit
                parts.append((Dz, still, scaled, G))
        Dz, still, scaled, G = (np.array(part) for part in zip(*parts, strict=True))
        return Dz, still, scaled, G

    @cached_property
    def layout(self) -> tuple[tuple[str, int], ...]:
        """What the vector holds: D of every block, then G of every real one."""
        blocks = self.structure.blocks
        real = [k for k, block in enumerate(blocks) if block.kind == "real"]
        return (*(("D", k) for k in range(len(blocks))), *(("G", k) for k in real))

    @cached_property
    def pieces(self) -> tuple[tuple[str, slice, AnyArray], ...]:
        """Of each D and G its numbers in the vector, and the matrices that they multiply."""
        start, found = 0, []
        for kind, k in self.layout:
            units = _hermitian(self.structure.blocks[k].copies)
            found.append((kind, slice(start, start + len(units)), units))
            start += len(units)
        return tuple(found)

    @property
    def size(self) -> int:
        """Number of real numbers in D and G."""
        return self.pieces[-1][1].stop

    def start(self, copies: Vector) -> Vector:
        """Return the vector of diagonal D, one number per copy, and G = 0."""
        x, first = np.zeros(self.size), 0
        for kind, numbers, units in self.pieces:
            if kind == "D":
                count = units.shape[1]
                x[numbers][:count] = copies[first : first + count]
                first += count
        return x

    def boxes(self, largest: float) -> tuple[Box, ...]:
        """Return what bounds the scalings: 0 < D < 1, and G between -/+ largest D."""
        found: list[Box] = []
        for (kind, k), (_, numbers, units) in zip(self.layout, self.pieces, strict=True):
            own, count = np.arange(numbers.start, numbers.stop), units.shape[1]
            if kind == "D":
                found += [(own, units, np.zeros((count, count))), (own, -units, np.eye(count))]
            else:
                D = self.pieces[k][1]
                both = np.concatenate([np.arange(D.start, D.stop), own])
                found += [
                    (
                        both,
                        np.concatenate([largest * units, sign * units]),
                        np.zeros((count, count)),
                    )
                    for sign in (1.0, -1.0)
                ]
        return tuple(found)

    def matrices(self, x: Vector) -> tuple[AnyMatrix, AnyMatrix, AnyMatrix, AnyMatrix]:
        """Return Dz, the still and the scaled part of Dw, and G."""
        Dz, still, scaled, G = (np.tensordot(x, basis, 1) for basis in self.bases)
        return Dz, still, scaled, G


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
