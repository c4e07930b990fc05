r"""The level that scalings prove at many frequencies, as a smooth function of M and of them.

With D = T* T per block, G = T* g T and ``N = T_z M T_w^-1``, the inequality ::

    beta^2 Dw - M* Dz M - j (G M - M* G) >= 0

says that beta^2 is at least the largest eigenvalue of ::

    H = N* N + j (g N - N* g)

which has derivatives in M, in T (upper triangular, its diagonal written as exponentials) and in
the Hermitian g, that is free.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robustpolish.arrays import AnyArray, AnyMatrix, Array, Vector
from robustpolish.robust.scaled.scalings import Space
from robustpolish.robust.structure import DeltaBlock, Structure

# Logarithm of a scaling beyond which it stays.
_STEEP = 80.0


@dataclass(frozen=True, eq=False)
class Scalings:
    """The free numbers of T and g for a structure: of the last block T is 1.

    Attributes
    ----------
    structure : Structure
    """

    structure: Structure

    @cached_property
    def size(self) -> int:
        """Number of real numbers per frequency."""
        return sum(stop - start for start, stop, _, _ in self.places)

    @cached_property
    def places(self) -> tuple[tuple[int, int, str, int], ...]:
        """Where the numbers of each T and g are: start, stop, kind, block."""
        found, first = [], 0
        blocks = self.structure.blocks
        wanted = [("T", k) for k in range(len(blocks) - 1)]
        wanted += [("g", k) for k, block in enumerate(blocks) if block.kind == "real"]
        for kind, k in wanted:
            count = blocks[k].copies ** 2
            found.append((first, first + count, kind, k))
            first += count
        return tuple(found)

    def of_weights(self, x: Vector, space: Space, gain: float) -> Vector:
        """Return the numbers of the scalings that the analysis found.

        Parameters
        ----------
        x : ndarray
            A vector of `space`, of a model whose gains times `gain` are those of M.
        space : Space
        gain : float
        """
        pieces = {}
        for (kind, k), (_, numbers, units) in zip(space.layout, space.pieces, strict=True):
            pieces[kind, k] = np.tensordot(x[numbers], units, 1)
        last = float(np.real(pieces["D", len(self.structure.blocks) - 1][0, 0]))
        roots = {k: np.conj(np.linalg.cholesky(D / last).T) for (kind, k), D in pieces.items()
                 if kind == "D"}  # fmt: skip
        found = np.zeros(self.size)
        for start, stop, kind, k in self.places:
            T = roots[k]
            if kind == "T":
                found[start:stop] = _of_triangle(T)
            else:
                inverse = np.linalg.inv(T)
                found[start:stop] = _of_hermitian(
                    gain * np.conj(inverse.T) @ (pieces["G", k] / last) @ inverse
                )
        return found

    def split(self, theta: Array) -> tuple[dict[int, AnyArray], dict[int, AnyArray]]:
        """Return T and g of the blocks, each of shape (k, copies, copies)."""
        T, g = {}, {}
        for start, stop, kind, k in self.places:
            copies = self.structure.blocks[k].copies
            values = theta[:, start:stop]
            (T if kind == "T" else g)[k] = (_triangle if kind == "T" else _hermitian)(
                values, copies
            )
        return T, g


@dataclass(frozen=True, eq=False)
class ScaledGain:
    """H at frequencies, and its derivatives.

    Attributes
    ----------
    scalings : Scalings
    theta : ndarray, shape (k, scalings.size)
    M : ndarray of complex, shape (k, nz, nw)
    """

    scalings: Scalings
    theta: Array
    M: AnyArray

    @cached_property
    def _parts(self) -> tuple[dict[int, AnyArray], dict[int, AnyArray]]:
        return self.scalings.split(self.theta)

    @cached_property
    def _whole(self) -> tuple[AnyArray, AnyArray, AnyArray]:
        """T of z, the inverse of T of w, and g, as whole matrices."""
        structure, count = self.scalings.structure, len(self.theta)
        nz, nw = structure.shape
        Tz, Tw = _ones(count, nz), _ones(count, nw)
        G = np.zeros((count, nw, nz), complex)
        T, g = self._parts
        for k, block in enumerate(structure.blocks):
            z, w = structure.inputs[k], structure.outputs[k]
            if k in T:
                Tz[:, z, z] = _repeated(T[k], block.columns)
                Tw[:, w, w] = _repeated(np.linalg.inv(T[k]), block.rows)
            if k in g:
                G[:, w, z] = g[k]
        return Tz, Tw, G

    @cached_property
    def N(self) -> AnyArray:
        """M in scaled signals."""
        Tz, Tw, _ = self._whole
        return Tz @ self.M @ Tw

    @cached_property
    def H(self) -> AnyArray:
        """The Hermitian matrices, shape (k, nw, nw)."""
        turned = 1j * (self._whole[2] @ self.N)
        return _star(self.N) @ self.N + turned + _star(turned)

    def back(self, weights: AnyArray) -> tuple[AnyArray, Array]:
        """Return derivatives of sum tr(weights_k H_k).

        Parameters
        ----------
        weights : ndarray of complex, shape (k, nw, nw)
            Hermitian.

        Returns
        -------
        on_M : ndarray of complex, shape (k, nw, nz)
            The sum changes by Re tr(on_M dM).
        on_theta : ndarray, shape (k, scalings.size)
        """
        structure = self.scalings.structure
        Tz, Tw, G = self._whole
        N = self.N
        X = 2 * weights @ (_star(N) + 1j * G)
        turned, before = N @ X, X @ N
        gram = 1j * (N @ weights)
        on_theta = np.zeros_like(self.theta)
        T, _ = self._parts
        for start, stop, kind, k in self.scalings.places:
            block = structure.blocks[k]
            z, w = structure.inputs[k], structure.outputs[k]
            if kind == "T":
                Q = _summed(turned[:, z, z], block, block.columns)
                Q = Q - _summed(before[:, w, w], block, block.rows)
                on_theta[:, start:stop] = _back_triangle(np.linalg.solve(T[k], Q), T[k])
            else:
                Y = gram[:, z, w] + _star(gram[:, z, w])
                on_theta[:, start:stop] = _back_hermitian(Y)
        return Tw @ X @ Tz, on_theta


def _star(M: AnyArray) -> AnyArray:
    return np.conj(np.swapaxes(M, -1, -2))


def _ones(count: int, n: int) -> AnyArray:
    return np.broadcast_to(np.eye(n, dtype=complex), (count, n, n)).copy()


def _repeated(T: AnyArray, times: int) -> AnyArray:
    """Return the Kronecker product with a unit matrix."""
    if times == 1:
        return T
    count, n, _ = T.shape
    return np.einsum("kab,ij->kaibj", T, np.eye(times)).reshape(count, n * times, n * times)


def _summed(Q: AnyArray, block: DeltaBlock, times: int) -> AnyArray:
    """Return the trace over the unit matrix of a Kronecker product."""
    count, n = len(Q), block.copies
    return np.einsum("kaibi->kab", Q.reshape(count, n, times, n, times))


def _upper(n: int) -> tuple[Sequence[int], Sequence[int]]:
    rows, columns = np.triu_indices(n, 1)
    return rows.tolist(), columns.tolist()


def _triangle(values: Array, n: int) -> AnyArray:
    T = np.zeros((len(values), n, n), complex)
    T[:, range(n), range(n)] = np.exp(np.clip(values[:, :n], -_STEEP, _STEEP))
    rows, columns = _upper(n)
    half = len(rows)
    T[:, rows, columns] = values[:, n : n + half] + 1j * values[:, n + half :]
    return T


def _of_triangle(T: AnyMatrix) -> Vector:
    off = T[_upper(len(T))]
    return np.concatenate([np.log(np.real(np.diag(T))), np.real(off), np.imag(off)])


def _back_triangle(P: AnyArray, T: AnyArray) -> Array:
    """Turn Re tr(dT P) into derivatives over the numbers of T."""
    n = T.shape[-1]
    own = np.real(P[:, range(n), range(n)] * T[:, range(n), range(n)])
    rows, columns = _upper(n)
    off = P[:, columns, rows]
    return np.concatenate([own, np.real(off), -np.imag(off)], axis=1)


def _hermitian(values: Array, n: int) -> AnyArray:
    g = np.zeros((len(values), n, n), complex)
    g[:, range(n), range(n)] = values[:, :n]
    rows, columns = _upper(n)
    half = len(rows)
    off = values[:, n : n + half] + 1j * values[:, n + half :]
    g[:, rows, columns], g[:, columns, rows] = off, np.conj(off)
    return g


def _of_hermitian(g: AnyMatrix) -> Vector:
    off = g[_upper(len(g))]
    return np.concatenate([np.real(np.diag(g)), np.real(off), np.imag(off)])


def _back_hermitian(Y: AnyArray) -> Array:
    """Turn tr(dg Y) of Hermitian matrices into derivatives over the numbers of g."""
    n = Y.shape[-1]
    rows, columns = _upper(n)
    off = Y[:, columns, rows]
    return np.concatenate(
        [np.real(Y[:, range(n), range(n)]), 2 * np.real(off), -2 * np.imag(off)], axis=1
    )
