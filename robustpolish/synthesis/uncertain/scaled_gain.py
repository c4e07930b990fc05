r"""The scaled gain: the bound of mu by D and G scalings, as a smooth function of M and of them.

With D = T* T per block, G = T* g T and ``N = T_z M T_w^-1``, the inequality ::

    beta^2 Dw - M* Dz M - j (G M - M* G) >= 0

says that beta^2 is at least the largest eigenvalue of ::

    H = N* N + j (g N - N* g)

which has derivatives in M, in T (upper triangular, its diagonal written as exponentials) and in
the Hermitian g, that is free.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import control
import numpy as np
from numpy.typing import NDArray

from robustpolish.base.arrays import AnyArray, Array, Vector
from robustpolish.base.arrays import AnyMatrix as Matrix
from robustpolish.linear.arithmetic.exact import power_of_two
from robustpolish.linear.systems import named_system
from robustpolish.plants.plant import GeneralizedPlant
from robustpolish.plants.uncertain.system import UncertainSystem
from robustpolish.robust.loop_model import DeltaBlock, DeltaStructure, Kind, LoopModel, structure_of
from robustpolish.robust.scalings import (
    Coverage,
    Inequality,
    ScaledBound,
    Space,
    best_scalings,
    cover,
    initial_scalings,
)
from robustpolish.synthesis.nonsmooth.descent import MaskedGain
from robustpolish.synthesis.problem.matrices import (
    Controller,
    PlantMatrices,
    StaticLoop,
    augmented,
    close_static_loop,
    controller_matrix,
)
from robustpolish.synthesis.problem.preflight import SolverPlant
from robustpolish.synthesis.proofs.bounded_real import responses

# Mu bounds over a grid of frequencies.

# Frequencies per decade, and how far they reach beyond the rates of the loop.
_DENSITY = 9.0
_BEYOND = 30.0


@dataclass(frozen=True, eq=False)
class MuBounds:
    """What scalings prove at frequencies.

    Attributes
    ----------
    omega : ndarray, shape (k,)
    found : list of ScaledBound
    space : Space
    """

    omega: Vector
    found: list[ScaledBound]
    space: Space

    @classmethod
    def over(
        cls, structure: DeltaStructure, omega: Vector, M: AnyArray, best: bool = True
    ) -> MuBounds:
        """Find scalings at each frequency: the best ones, or quickly those that balance M.

        Parameters
        ----------
        structure : DeltaStructure
        omega : ndarray, shape (k,)
        M : ndarray of complex, shape (k, nz, nw)
        best : bool, optional
            Neighbours then help each other.
        """
        space = Space(structure)
        found: list[ScaledBound] = []
        for one in M:
            asked = Inequality(space, one[None])
            neighbours = [level.x for level in found[-1:]]
            found.append(
                best_scalings(asked, others=neighbours) if best else initial_scalings(asked)
            )
        return cls(omega, found, space)

    @cached_property
    def values(self) -> Vector:
        """The beta at each frequency; infinite where none was found."""
        return np.array([level.level for level in self.found])

    @property
    def peak(self) -> float:
        """The largest."""
        return float(self.values.max())

    def diagonals(self) -> Array:
        """Return the square roots of the diagonal of D per copy, the last one 1; shape (k, n)."""
        pieces = [self.space.blocks_of(level.x) for level in self.found]
        D = [np.concatenate([_diagonal(M) for (kind, _), M in each.items() if kind == "D"])
             for each in pieces]  # fmt: skip
        roots = np.sqrt(D)
        return roots / roots[:, -1:]


def grid(poles: Iterable[AnyArray]) -> Vector:
    """Return frequencies that cover the rates of the poles, those of each, 0 and infinity."""
    rates = np.abs(np.concatenate([np.asarray(p) for p in poles]))
    rates = rates[rates > 0]
    low, high = (rates.min(), rates.max()) if len(rates) else (1.0, 1.0)
    low, high = max(low, 1e-9 * high) / _BEYOND, high * _BEYOND
    count = math.ceil(_DENSITY * math.log10(high / low))
    kept: list[float] = []
    for omega in np.sort(np.concatenate([np.geomspace(low, high, count), rates[rates > low]])):
        if not kept or omega > kept[-1] * 1.02:
            kept.append(float(omega))
    return np.array([0.0, *kept, np.inf])


# The robust synthesis problem: the plant in scaled units, and the structure of Delta.


@dataclass(frozen=True, eq=False)
class RobustProblem:
    """The plant from (w of Delta, w) to (z of Delta, z), u to y, and the structure of Delta.

    Attributes
    ----------
    plant : GeneralizedPlant
        In its own units; z in units of `gamma`, so that a mu of 1 is what is asked for.
    structure : DeltaStructure
        The blocks, the last one for the performance.
    part : SolverPlant
        The plant in scaled units, continuous, without D22.
    """

    plant: GeneralizedPlant
    structure: DeltaStructure
    part: SolverPlant

    @classmethod
    def of(cls, system: UncertainSystem, ny: int, nu: int, gamma: float) -> RobustProblem:
        """State the problem of a system whose last signals are measured and driven."""
        whole = system.interconnection
        nz, nw = system.noutputs - ny, system.ninputs - nu
        rows = np.ones(whole.noutputs)
        rows[whole.noutputs - system.noutputs :][:nz] = 1 / gamma
        matrices = (whole.A, whole.B, rows[:, None] * whole.C, rows[:, None] * whole.D)
        names = (whole.input_labels, whole.output_labels, whole.state_labels)
        plant = GeneralizedPlant(named_system(matrices, whole.dt, *names), ny, nu)
        last = DeltaBlock("complex" if nz == nw == 1 else "full", 1, nw, nz, "performance")
        structure = DeltaStructure((*structure_of(system.blocks).blocks, last))
        return cls(plant, structure, SolverPlant.of(plant, mapped=True))

    @cached_property
    def matrices(self) -> PlantMatrices:
        """The plant in scaled units of time, states, u and y; levels are those of the plant."""
        m, gain = self.part.matrices, self.part.norm(1.0)
        return m.replace(C1=gain * m.C1, D11=gain * m.D11, D12=gain * m.D12)

    @property
    def scaled(self) -> GeneralizedPlant:
        """The same as a plant."""
        return GeneralizedPlant.from_matrices(**self.matrices.matrices)

    @cached_property
    def as_complex(self) -> DeltaStructure:
        """The structure with every copy of every number a complex number of its own.

        It holds more than the true one, and its scalings are positive numbers, one per copy.
        """
        found = []
        for block in self.structure.blocks:
            kind: Kind = "complex" if block.is_scalar else "full"
            found += [DeltaBlock(kind, 1, block.rows, block.columns)] * block.copies
        return DeltaStructure(tuple(found))

    def loop(self, K: Controller) -> StaticLoop | None:
        """Return the loop with a controller in scaled units; None if it is not stable."""
        loop = close_static_loop(augmented(self.matrices, len(K.A)), controller_matrix(K))
        return loop if loop is not None and loop.stable else None

    def cover(self, loop: StaticLoop, level: float) -> tuple[Coverage, LoopModel]:
        """Prove a level of a stable loop, raised as far as it has to be."""
        model = LoopModel.around((loop.A, loop.B, loop.C, loop.D), 0, self.structure)
        space = Space(self.structure)
        return cover(model, space, level / model.gain, model.seeds()), model

    def controller(self, K: Controller) -> control.StateSpace | None:
        """Return a controller in the plant's units; None if its loop is not well posed."""
        return self.part.controller(K)


# Controllers of a given order in modal form, as a function of free numbers.

# Condition of a pair of eigenvectors beyond which an orthonormal basis takes their place.
_PARALLEL = 30.0
# Unit of the rate of an integrator, beside the slower one of the median and a thousandth of the
# fastest rate: slow poles that do move keep their own.
_SLOWEST = 1e-3


@dataclass(frozen=True, eq=False)
class ModalGain(MaskedGain):
    """K = [[Ak, Bk], [Ck, Dk]] with Ak made of free 2x2 blocks, each in units of its rate.

    In companion forms a descent stalls; here each mode moves by itself, and two real modes can
    become a complex pair.

    Attributes
    ----------
    units : ndarray
        Of the entries of K: products of square roots of rates for states, and 1 for signals.
    order : int
    """

    units: Matrix
    order: int

    @classmethod
    def of(cls, K: Controller) -> tuple[ModalGain, Vector]:
        """Return the form of a controller, and its numbers."""
        n = len(K.A)
        A, B, C, rates = _modal(K)
        left, right = (np.concatenate([np.sqrt(rates), np.ones(k)]) for k in K.D.shape)
        mask = np.ones((len(left), len(right)), bool)
        mask[:n, :n] = _pairs(n)
        form = cls(mask, np.outer(left, right), n)
        return form, form.coordinates(controller_matrix(Controller(A, B, C, K.D)) / form.units)

    def gain(self, theta: Vector) -> Matrix:
        """Return K(theta)."""
        return self.units * super().gain(theta)

    def back(self, theta: Vector, gradient: Matrix) -> Vector:
        """Turn a gradient over K into one over theta."""
        return super().back(theta, self.units * gradient)


def _modal(K: Controller) -> tuple[Matrix, Matrix, Matrix, Vector]:
    """Return A, B and C in modal coordinates with even gains, and a rate per state."""
    n = len(K.A)
    if not n:
        return K.A, K.B, K.C, np.zeros(0)
    values, vectors = np.linalg.eig(K.A)
    size = np.abs(values)
    order = np.argsort(size)
    moving = size[size > 0]
    floor = 1e-3 * float(size.max()) or 1.0
    least = _SLOWEST * (min(floor, float(np.median(moving))) if len(moving) else floor)
    parts, rates = [], []
    for i in order[np.imag(values[order]) > 1e-12 * size[order]]:
        parts.append(np.column_stack([np.real(vectors[:, i]), np.imag(vectors[:, i])]))
        rates += [size[i]] * 2
    real = order[np.abs(np.imag(values[order])) <= 1e-12 * size[order]]
    for i in range(0, len(real), 2):
        pair = np.real(vectors[:, real[i : i + 2]])
        parts.append(np.linalg.qr(pair)[0] if np.linalg.cond(pair) > _PARALLEL else pair)
        rates += np.maximum(size[real[i : i + 2]], least).tolist()
    T = np.hstack(parts)
    A, B, C = np.linalg.solve(T, K.A @ T), np.linalg.solve(T, K.B), K.C @ T
    for i in range(0, n, 2):
        pair = slice(i, min(i + 2, n))
        b, c = np.linalg.norm(B[pair]), np.linalg.norm(C[:, pair])
        even = power_of_two(float(np.sqrt(c / b) if b > 0 and c > 0 else 1.0))
        B[pair] *= even
        C[:, pair] /= even
    return np.where(_pairs(n), A, 0.0), B, C, np.array(rates)


def _pairs(n: int) -> NDArray[np.bool_]:
    """Tell which entries of A belong to 2x2 blocks on the diagonal."""
    place = np.arange(n) // 2
    return place[:, None] == place


# Frequency responses of a loop, and the chain rule from them back to K.


@dataclass(frozen=True, eq=False)
class LoopResponses:
    """M of a loop at frequencies, with what a change of K does to it: dM = left dT right.

    Attributes
    ----------
    M : ndarray of complex, shape (k, nz, nw)
    left, right : ndarray of complex
        From a change of T = K (I - D22 K)^-1 to M.
    loop : StaticLoop
    """

    M: AnyArray
    left: AnyArray
    right: AnyArray
    loop: StaticLoop

    @classmethod
    def of(cls, loop: StaticLoop, omega: Vector) -> LoopResponses:
        """Return the responses of a loop; frequencies may be infinite."""
        plant, (nz, nw) = loop.plant, loop.D.shape
        B, C = np.hstack([loop.B, plant.B2]), np.vstack([loop.C, plant.C2])
        D = np.block([[loop.D, plant.D12], [plant.D21, np.zeros((plant.ny, plant.nu))]])
        found = responses(loop.A, B, C, D, omega)
        return cls(found[:, :nz, :nw], found[:, :nz, nw:], found[:, nz:, :nw], loop)

    def back(self, gradient: AnyArray) -> Matrix:
        """Return the gradient over K of sum Re tr(gradient_k dM_k), gradients (k, nw, nz)."""
        on_T = np.einsum("kwz,kzi,kjw->ij", gradient, self.left, self.right, optimize=True)
        return self.loop.back(np.real(on_T))


# Logarithm of a scaling beyond which it stays.
_STEEP = 80.0


@dataclass(frozen=True, eq=False)
class Scalings:
    """The free numbers of T and g for a structure: of the last block T is 1.

    Attributes
    ----------
    structure : DeltaStructure
    """

    structure: DeltaStructure

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

    def of_bounds(self, bounds: Sequence[ScaledBound], gain: float = 1.0) -> Array:
        """Return the numbers of scalings that the analysis found, a row for each.

        Parameters
        ----------
        bounds : sequence of ScaledBound
            Of a model whose gains times `gain` are those of M.
        gain : float, optional
        """
        found = np.zeros((len(bounds), self.size))
        for row, bound in zip(found, bounds, strict=True):
            pieces = Space(self.structure).blocks_of(bound.x)
            last = float(np.real(pieces["D", len(self.structure.blocks) - 1][0, 0]))
            for start, stop, kind, k in self.places:
                T = np.conj(np.linalg.cholesky(pieces["D", k] / last).T)
                if kind == "T":
                    row[start:stop] = _packed(T, np.log(_diagonal(T)))
                else:
                    inverse = np.linalg.inv(T)
                    g = gain * np.conj(inverse.T) @ (pieces["G", k] / last) @ inverse
                    row[start:stop] = _packed(g, _diagonal(g))
        return found

    def split(self, theta: Array) -> tuple[dict[int, AnyArray], dict[int, AnyArray]]:
        """Return T and g of the blocks, each of shape (k, copies, copies)."""
        found: dict[str, dict[int, AnyArray]] = {"T": {}, "g": {}}
        for start, stop, kind, k in self.places:
            unpacked = _triangle if kind == "T" else _hermitian
            found[kind][k] = unpacked(theta[:, start:stop], self.structure.blocks[k].copies)
        return found["T"], found["g"]


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
        return _adjoint(self.N) @ self.N + turned + _adjoint(turned)

    @property
    def squares(self) -> Vector:
        """The beta^2 that they prove at each frequency."""
        return np.linalg.eigvalsh(self.H)[:, -1]

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
        X = 2 * weights @ (_adjoint(N) + 1j * G)
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
                # Re tr(dT P) over the numbers of T, whose diagonal is that of exponentials.
                P = np.linalg.solve(T[k], Q)
                on_theta[:, start:stop] = _packed(_adjoint(P), _diagonal(P) * _diagonal(T[k]))
            else:
                Y = gram[:, z, w] + _adjoint(gram[:, z, w])
                on_theta[:, start:stop] = _packed(Y, _diagonal(Y), 2.0)
        return Tw @ X @ Tz, on_theta


def _adjoint(M: AnyArray) -> AnyArray:
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


def _packed(M: AnyArray, diagonal: Array, twice: float = 1.0) -> Array:
    """Return numbers for the diagonal, then real and imaginary parts of what is above it."""
    off = M[..., *np.triu_indices(M.shape[-1], 1)]
    return np.concatenate([diagonal, twice * np.real(off), twice * np.imag(off)], axis=-1)


def _diagonal(M: AnyArray) -> Array:
    return np.real(np.diagonal(M, axis1=-2, axis2=-1))


def _above(values: Array, n: int) -> AnyArray:
    """Return the matrices that are zero but above the diagonal, from packed numbers."""
    found = np.zeros((len(values), n, n), complex)
    real, imag = np.split(values[:, n:], 2, axis=1)
    found[:, *np.triu_indices(n, 1)] = real + 1j * imag
    return found


def _triangle(values: Array, n: int) -> AnyArray:
    T = _above(values, n)
    T[:, range(n), range(n)] = np.exp(np.clip(values[:, :n], -_STEEP, _STEEP))
    return T


def _hermitian(values: Array, n: int) -> AnyArray:
    g = _above(values, n)
    g = g + _adjoint(g)
    g[:, range(n), range(n)] = values[:, :n]
    return g


# Frequency refinement: where the bound rises between the frequencies of a set.

# Frequencies that are looked at between two of the set, and beyond its ends in decades.
_BETWEEN = 12
_BEYOND_SET = 3.0
# Share of its rate by which a lightly damped pole is looked at on both sides.
_BESIDE = np.array([-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0])
# Peaks that are looked at closely in one go.
_MOST = 12


def unproven_frequencies(
    loop: StaticLoop, scalings: Scalings, omega: Vector, weights: Array, level: float
) -> tuple[Vector, Array]:
    """Return frequencies at which no scalings prove a level, with the best scalings there.

    Parameters
    ----------
    loop : StaticLoop
        Stable.
    scalings : Scalings
    omega : ndarray, shape (k,)
        The set.
    weights : ndarray, shape (k, scalings.size)
        Scalings of the set; between its frequencies they are interpolated.
    level : float
    """
    dense, between = _dense(loop, omega, weights)
    M = LoopResponses.of(loop, dense).M
    squares = ScaledGain(scalings, between, M).squares
    space, found = Space(scalings.structure), dict[float, ScaledBound]()
    around = np.pad(squares, 1, constant_values=-np.inf)
    local = (squares >= around[:-2]) & (squares > around[2:])
    peaks = np.flatnonzero(local & (squares > level**2))
    for i in peaks[np.argsort(-squares[peaks], kind="stable")][:_MOST]:
        best = best_scalings(Inequality(space, M[i][None]), level**2)
        if level**2 * (1 - 1e-9) < best.square < math.inf:
            found[float(dense[i])] = best
    return np.array([*found]), scalings.of_bounds([*found.values()])


def _dense(loop: StaticLoop, omega: Vector, weights: Array) -> tuple[Vector, Array]:
    """Return frequencies between those of a set and beside the poles, and scalings there."""
    order = np.argsort(omega)
    inner = order[(omega[order] > 0) & np.isfinite(omega[order])]
    logs, values = np.log(omega[inner]), weights[inner]
    steps = np.linspace(0, 1, _BETWEEN + 1, endpoint=False)[1:]
    found = [logs[:-1] + step * np.diff(logs) for step in steps]
    ends = np.linspace(0, _BEYOND_SET * np.log(10), 3 * _BETWEEN)[1:]
    poles = loop.poles[loop.poles.imag > 0]
    beside = poles.imag[:, None] + poles.real[:, None] * _BESIDE
    beside = np.log(beside[beside > 0])
    all_logs = np.sort(np.concatenate([*found, logs[0] - ends, logs[-1] + ends, beside]))
    between = np.array([np.interp(all_logs, logs, column) for column in values.T]).T
    return np.exp(all_logs), between.reshape(len(all_logs), -1)
